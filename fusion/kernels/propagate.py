"""One inertial sample: both filters forward, and whether the accelerometer is in doubt."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.covariance import predict_covariance
from axialnav.fusion.kernels.shaking import note_shaking
from axialnav.fusion.kernels.window import note_motion
from axialnav.models.imu import strapdown
from axialnav.models.jit import Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import (
    E_ACCEL_BIAS,
    E_ATT,
    E_BLUR_SCALE,
    E_GYRO_BIAS,
    E_POS,
    E_UWB_BIAS,
    E_VEL,
    E_WALL_OFFSET,
    N_BIASES,
    UWB_BIAS,
    VEL,
)

Array = NDArray[np.float64]
MAX_IMU_GAP_S = 0.1
GAP_ACCEL_VARIANCE = 9.0  # [m^2 s^-3] manoeuvres of 3 m/s^2 that last half a second
GAP_GYRO_VARIANCE = 0.25  # [rad^2 s^-1] turns of 0.5 rad/s that last half a second


@kernel
def rotate_sample(values: Array, R_BS: Array, out: Array) -> None:
    """Write rate and specific force of a sample, turned into body axes, into ``out`` (6,)."""
    for i in range(3):
        out[i] = R_BS[i, 0] * values[0] + R_BS[i, 1] * values[1] + R_BS[i, 2] * values[2]
        out[3 + i] = R_BS[i, 0] * values[3] + R_BS[i, 1] * values[4] + R_BS[i, 2] * values[5]


@kernel
def bias_decay(x: Array, dt: float, c: Record) -> float:
    """What is left after ``dt`` [s] of the biases of UWB paths: they change with time and with the way flown."""
    way = dt * math.sqrt(x[VEL] * x[VEL] + x[VEL + 1] * x[VEL + 1] + x[VEL + 2] * x[VEL + 2])
    return math.exp(-dt / c.uwb_bias_time_s - way / c.uwb_bias_length_m)


@kernel
def propagate_filter(row: int, fault: bool, dt: float, m: Record, w: Record, c: Record) -> None:
    """Predict filter ``row`` over ``dt`` with the mean sample in ``w.mean_imu``; ``fault`` selects the noise."""
    decay = bias_decay(m.x[row], dt, c)
    strapdown(m.x[row], w.mean_imu[0:3], w.mean_imu[3:6], dt, c.gravity_m_s2, w.R, w.F)
    accel = c.fault_accel_variance if fault else c.accel_variance
    accel_walk = c.fault_accel_walk if fault else c.accel_walk
    gyro = c.gyro_variance
    unseen = 0.0
    if dt > MAX_IMU_GAP_S:
        # nobody knows how the vehicle moved between the two samples
        accel += GAP_ACCEL_VARIANCE
        gyro += GAP_GYRO_VARIANCE
        unseen = GAP_ACCEL_VARIANCE * dt * dt * dt / 3.0
    for i in range(3):
        w.Q[E_POS + i] = unseen
        jolt = 0.0
        for k in range(3):
            jolt += w.R[i, k] * w.R[i, k] * m.jolt[k]
        w.Q[E_VEL + i] = (accel * (1.0 if fault else m.margin[i]) + jolt) * dt
        w.Q[E_ATT + i] = gyro * dt
        w.Q[E_GYRO_BIAS + i] = c.gyro_walk * dt
        w.Q[E_ACCEL_BIAS + i] = (accel_walk + m.shaken_walk[i]) * dt
    w.Q[E_BLUR_SCALE] = c.blur_scale_walk * dt
    for k in range(N_BIASES):
        w.Q[E_UWB_BIAS + k] = m.path_variance[k] * (1.0 - decay * decay)
        m.x[row, UWB_BIAS + k] *= decay
    w.Q[E_WALL_OFFSET] = c.wall_offset_walk * dt
    predict_covariance(m.P[row], w.F, dt, decay, w.Q)


@kernel
def propagate(t_ns: int, values: Array, R_BS: Array, m: Record, w: Record, c: Record) -> float:
    """Advance to the inertial sample at ``t_ns``; return the step [s], 0 for the first or a repeated sample.

    Rate and specific force over the step are the mean of the samples at its two ends.
    """
    dt = (t_ns - m.t_imu) * 1e-9
    if m.started == 0:
        rotate_sample(values, R_BS, m.imu)
        for i in range(3):
            m.force[i] = m.imu[3 + i]
        m.started = 1
        m.t_imu = t_ns
        return 0.0
    if dt <= 0.0:
        return 0.0
    for i in range(6):
        w.mean_imu[i] = m.imu[i]
    rotate_sample(values, R_BS, m.imu)
    for i in range(6):
        w.mean_imu[i] = 0.5 * (w.mean_imu[i] + m.imu[i])
    note_shaking(dt, w.mean_imu[3:6], w.y, m, c)
    for k in range(3):
        w.gained[k] = m.x[0, VEL + k]
    for row in range(1 + m.on_trial):
        # the rival believes the opposite of the estimate
        propagate_filter(row, (m.imu_fault == 1) == (row == 0), dt, m, w, c)
    for k in range(3):
        w.gained[k] = m.x[0, VEL + k] - w.gained[k]
    note_motion(t_ns, w.mean_imu[0:3], dt, w.gained, m)
    m.t_imu = t_ns
    return float(dt)
