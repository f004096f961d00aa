"""Is the accelerometer to be believed?  A rival filter with the other answer is asked on the same readings.

Healthy and faulty differ in the noise given to the accelerometer.  The rival starts as a copy of the estimate and sees
the same readings; the difference of log-likelihoods, counted once per independent reading, decides (a sequential
probability ratio test).  Running it only in doubt costs nothing on a healthy flight, and a trial that does not speak
for the rival is followed by a rest, so that doubt without reason costs half.

Source: Bar-Shalom, Li, Kirubarajan (2001), section 11.6.2 (static multiple models); Wald (1945).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.margin import note_moves
from axialnav.models.jit import Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import N_ERROR, N_NOMINAL

Array = NDArray[np.float64]
GIVE_UP = 5.0  # nats by which the healthy filter has to be better for a trial to end early; doubt starts another


@kernel
def in_doubt(dt: float, m: Record, c: Record) -> bool:
    """Update the mean velocity correction [m/s^2] that the aids ask for; whether it is more than a bias could be.

    It is where the mean is large, and larger than noise would make it: a filter that is right expects corrections of
    the variance that it gives them, and their mean over a while to be near zero.
    """
    decay = math.exp(-dt / c.doubt_time_s)
    size2, sigmas2 = 0.0, 0.0
    for i in range(3):
        rate = m.correction_rate[i] * decay + m.correction[i] / c.doubt_time_s
        variance = m.correction_rate_variance[i] * decay * decay
        fresh = m.correction_variance[i] / (c.doubt_time_s * c.doubt_time_s)
        variance += fresh
        m.correction_rate[i] = rate
        m.correction_rate_variance[i] = variance
        m.correction[i] = 0.0
        m.correction_variance[i] = 0.0
        size2 += rate * rate
        if variance > 0.0:
            moved = rate * rate / variance
            sigmas2 += moved
            note_moves(i, moved, fresh / variance, m, c)
    return bool(size2 > c.doubt_m_s2 * c.doubt_m_s2 and sigmas2 > c.doubt_sigmas * c.doubt_sigmas)


@kernel
def supervise_imu(dt: float, m: Record, c: Record) -> None:
    """Start, judge and end trials of the rival after an inertial step."""
    doubtful = in_doubt(dt, m, c)
    fault = m.imu_fault == 1
    if m.on_trial == 1:
        _judge(fault, (m.t_imu - m.t_trial) * 1e-9 > c.trial_s, m, c)
        fault = m.imu_fault == 1
    rested = (m.t_imu - m.t_failed) * 1e-9 > c.trial_s
    if m.on_trial == 0 and rested and (fault or doubtful):
        m.on_trial = 1
        m.t_trial = m.t_imu
        m.evidence = 0.0
        copy_filter(m.x[0], m.P[0], m.x[1], m.P[1])


@kernel
def _judge(fault: bool, over: bool, m: Record, c: Record) -> None:
    """End the trial, or let it go on; one that does not speak for the rival is followed by a rest of that length."""
    evidence = m.evidence
    if fault:
        if evidence < -c.evidence:
            _fail(m)
        elif over:
            m.on_trial = 0
            m.good_trials += 1
            if evidence < -c.evidence_to_clear:
                _fail(m)
            elif m.good_trials >= c.trials_to_clear:
                _take_over(m)
    elif evidence > c.evidence:
        _take_over(m)
    elif over or evidence < -GIVE_UP:
        m.on_trial = 0
        if evidence < c.evidence_to_clear:
            _fail(m)


@kernel
def _fail(m: Record) -> None:
    m.on_trial = 0
    m.good_trials = 0
    m.t_failed = m.t_imu


@kernel
def _take_over(m: Record) -> None:
    """The rival becomes the estimate, and with it its belief about the accelerometer."""
    m.imu_fault = 1 - m.imu_fault
    m.on_trial = 0
    m.good_trials = 0
    for i in range(3):
        m.correction_rate[i] = 0.0
        m.correction_rate_variance[i] = 0.0
    copy_filter(m.x[1], m.P[1], m.x[0], m.P[0])


@kernel
def copy_filter(from_x: Array, from_P: Array, to_x: Array, to_P: Array) -> None:
    """Copy one filter over another (loops: slice assignment compiles ten times as long)."""
    for i in range(N_NOMINAL):
        to_x[i] = from_x[i]
    for i in range(N_ERROR):
        for j in range(N_ERROR):
            to_P[i, j] = from_P[i, j]
