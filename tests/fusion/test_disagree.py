"""UWB and pixel motion wrong at once, each in its own way, and an inertial unit that contradicts both."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.outcome import Health
from tests.fusion.made_corridor import EVENT_S, FOCAL_PX, WALL_Y_M, WINDOW_S, Corridor, fly
from tests.fusion.made_flights import MadeFlight, Table

SEEDS = range(3)
LASTS_S = 6.0
FASTER_M_S2, SLIDES_M_S = 0.8, -2.0


@functools.cache
def flown(seed: int, pixel_motion_wrong: bool, uwb_wrong: bool) -> tuple[MadeFlight, BatchResult]:
    """The picture speeds up while the fixes slide back; or one of the two does; or neither."""
    clean = fly(Corridor(seed=seed, uwb="fix", duration_s=60.0))
    motion, uwb, began = clean.tables["motion0"], clean.tables["uwb0"], clean.tables["imu0"].t_ns[0]
    since, then = ((table.t_ns - began) * 1e-9 - EVENT_S for table in (motion, uwb))
    faster = FASTER_M_S2 * np.clip(since, 0.0, LASTS_S) * (since < LASTS_S)
    dx_px = motion.columns["dx_px"] - pixel_motion_wrong * FOCAL_PX * WINDOW_S * faster / WALL_Y_M
    position_m = uwb.columns["position_m"].copy()
    position_m[:, 0] += uwb_wrong * SLIDES_M_S * np.clip(then, 0.0, LASTS_S) * (then < LASTS_S)
    tables = {
        **clean.tables,
        "motion0": Table(motion.t_ns, {**motion.columns, "dx_px": dx_px}),
        "uwb0": Table(uwb.t_ns, {"position_m": position_m}),
    }
    flight = MadeFlight(tables, clean.config, clean.truth, clean.gyro_bias, clean.accel_bias)
    return flight, run_batch(flight.config, flight.tables)


def said(seed: int, pixel_motion_wrong: bool, uwb_wrong: bool, start_s: float, end_s: float) -> np.ndarray:
    """Whether the flag was up, at the samples between two instants of the event."""
    flight, result = flown(seed, pixel_motion_wrong, uwb_wrong)
    since = flight.t_s - EVENT_S
    return (result.track.flags[(since >= start_s) & (since < end_s)] & Health.DISAGREE) > 0


@pytest.mark.parametrize("seed", SEEDS)
def test_two_wrong_sources_that_inertia_contradicts_are_said_to_disagree(seed: int) -> None:
    assert not said(seed, True, True, -EVENT_S, 0.0).any()
    assert said(seed, True, True, 1.0, 3.0).any()
    assert said(seed, True, True, 0.0, LASTS_S).mean() > 0.15


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("pixel_motion_wrong", "uwb_wrong"), [(False, False), (True, False), (False, True)])
def test_one_wrong_source_has_a_witness_against_it(seed: int, pixel_motion_wrong: bool, uwb_wrong: bool) -> None:
    assert not said(seed, pixel_motion_wrong, uwb_wrong, -EVENT_S, 20.0).any()
