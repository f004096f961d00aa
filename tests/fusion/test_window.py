"""Pixel motion is an average over its window: the filter compares it with the same average of what it believes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from axialnav.fusion.batch import run_batch
from axialnav.fusion.config import Config, Initial
from axialnav.fusion.kernels.propagate import propagate
from axialnav.fusion.kernels.window import state_in_window
from axialnav.fusion.memory import build_settings, new_memory, new_scratch
from axialnav.models.rig import Flow, Imu, Surface
from tests.fusion.made_flights import DOWN_BS, GRAVITY, Table, transform

STEP_NS = 5_000_000
FOCAL_PX, HEIGHT_M = 400.0, 2.0


def swinging(rate_hz: float, seconds: float):
    """Rate and specific force (n, 6) of a vehicle that rolls, pitches and is pushed about, and their stamps."""
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    rate = np.stack([0.8 * np.sin(7 * t), 0.6 * np.cos(9 * t), 0.2 * np.sin(2 * t)], axis=1)
    force = np.stack([2.0 * np.sin(5 * t), np.cos(6 * t), GRAVITY + np.sin(8 * t)], axis=1)
    return (t * 1e9).astype(np.int64) + STEP_NS, np.hstack([rate, force])


@pytest.mark.parametrize("rate_hz", [50.0, 200.0, 1000.0])
@pytest.mark.parametrize("late_ns", [0, 3_100_000])
def test_the_state_in_the_middle_is_the_one_the_filter_had_there(rate_hz: float, late_ns: int) -> None:
    """Run to the end, look back by half a window, compare with the states on the way; between them, interpolated."""
    memory, scratch = new_memory(1), new_scratch()
    settings = build_settings(Config(sensor={"imu0": Imu()}))[0]
    m, w = memory.core[0], scratch[0]
    m["x"][:, 6] = 1.0
    m["x"][:, 3:6] = [1.0, -0.5, 0.2]
    m["P"][:] = np.eye(m["P"].shape[1])
    t_ns, samples = swinging(rate_hz, 1.0)
    states = []
    for t, sample in zip(t_ns.tolist(), samples, strict=True):
        propagate(t, np.r_[sample, 0.0, 0.0], np.eye(3), m, w, settings)
        states.append(m["x"][0].copy())
    end, window_s = int(t_ns[-1]) + late_ns, 0.1
    state_in_window(end, window_s, m["x"][0], m, w)
    middle = end - 50_000_000
    history = np.array(states)
    expected = [np.interp(middle, t_ns, history[:, k]) for k in range(6)]
    tolerance = 2e-3 if rate_hz > 60 else 2e-2
    np.testing.assert_allclose(w["p"], expected[:3], atol=tolerance)
    np.testing.assert_allclose(w["x"][3:6], expected[3:], atol=tolerance)
    near = int(np.argmin(np.abs(t_ns - middle)))
    turned = Rotation.from_quat(history[near, 6:10], scalar_first=True).inv() * Rotation.from_matrix(w["R"])
    assert turned.magnitude() < 1.2 * (np.abs(t_ns[near] - middle) * 1e-9) + tolerance
    inside = (t_ns >= end - 100_000_000) & (t_ns <= end)
    np.testing.assert_allclose(w["rate"], samples[inside, :3].mean(axis=0), atol=0.1 if rate_hz < 60 else 0.04)


def test_before_a_window_is_remembered_the_newest_sample_serves() -> None:
    memory, w = new_memory(1), new_scratch()[0]
    m = memory.core[0]
    m["x"][:, 6], m["imu"][:3] = 1.0, [0.1, 0.2, 0.3]
    m["t_imu"] = 10**9
    w["p"], w["R"] = 5.0, np.eye(3)
    state_in_window(10**9, 0.1, m["x"][0], m, w)
    np.testing.assert_array_equal(w["rate"], m["imu"][:3])
    np.testing.assert_array_equal(w["x"], m["x"][0])
    np.testing.assert_array_equal(w["p"], 5.0)


def shaken(seed: int, window_s: float = 0.1) -> tuple[Config, dict[str, Table]]:
    """A camera at rest that looks down and is shaken about its own centre: every motion of the image is rotation.

    The swing of 3 Hz makes the mean rate over the window differ from the rate in its middle by a seventh.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 40.0, 0.005)
    angle = np.stack([0.03 * np.sin(18.85 * t), 0.03 * np.sin(18.85 * t + 1.0)], axis=1) * np.minimum(t, 1.0)[:, None]
    attitude = Rotation.from_euler("xy", angle)
    rate = np.vstack([(attitude[:-1].inv() * attitude[1:]).as_rotvec() / 0.005, np.zeros(3)])
    rate = np.vstack([rate[0], 0.5 * (rate[1:] + rate[:-1])]) + rng.normal(0, 0.02, rate.shape)
    force = attitude.inv().apply([0.0, 0.0, GRAVITY]) + rng.normal(0, 0.1, (len(t), 3))
    ends = np.arange(2.0, 39.0, window_s)
    at = [np.stack([np.interp(e, t, angle[:, k]) for k in range(2)], axis=1) for e in (ends - window_s, ends)]
    turned = at[1] - at[0]
    w_S = np.hstack([turned, np.zeros((len(ends), 1))]) @ np.array(DOWN_BS)
    noise = rng.normal(0, 0.5, (len(ends), 2))
    stamps = ((ends - 0.5 * window_s) * 1e9).astype(np.int64)
    flow = {"window_s": np.full(len(ends), window_s), "dx_px": -FOCAL_PX * w_S[:, 1] + noise[:, 0],
            "dy_px": FOCAL_PX * w_S[:, 0] + noise[:, 1]}  # fmt: skip
    config = Config(
        initial=Initial(position_m=(0.0, 0.0, HEIGHT_M)),
        surface={"floor": Surface(normal=(0.0, 0.0, 1.0))},
        sensor={
            "imu0": Imu(),
            "flow0": Flow(T_BS=transform(DOWN_BS), surface="floor", focal_px=(FOCAL_PX, FOCAL_PX), sigma_px=0.7),
        },
    )
    tables = {
        "imu0": Table((t * 1e9).astype(np.int64), {"gyro_rad_s": rate, "accel_m_s2": force}),
        "flow0": Table(stamps, flow),
    }
    return config, tables


def test_rotation_within_the_window_does_not_pull_the_scale() -> None:
    """Taken in the middle instead, the rate is a seventh too large; the blur scale would take that up, and with it
    every speed would be read too high."""
    for seed in range(3):
        config, tables = shaken(seed)
        result = run_batch(config, tables)
        mine = result.log.source == result.log.sensors.index("flow0")
        assert abs(result.track.blur_scale[-1]) < 0.03
        assert result.log.nis[mine].sum() / result.log.dof[mine].sum() < 1.3
