"""The rival filter on flights whose accelerometer is healthy: it must not take over."""

from __future__ import annotations

import pytest

from axialnav.fusion.batch import run_batch
from axialnav.fusion.outcome import Health
from tests.fusion.made_flights import Scene, fly

FAULT = {"start_s": 10.0, "end_s": 99.0, "ramp_s": 3.0, "size_m_s2": -3.0, "wander_m_s2": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize("rig", [("range0", "flow0", "tdoa0"), ("range0", "flow0"), ("uwb0", "range0")], ids=" ".join)
def test_no_false_alarm_in_thirty_healthy_flights(rig: tuple[str, ...]) -> None:
    for seed in range(30):
        flight = fly(Scene(seed=seed, sensors=rig))
        flags = run_batch(flight.config, flight.tables).track.flags
        assert not (flags & Health.ACCELEROMETER_FAULT).any(), seed


def test_switched_off_a_fault_is_never_flagged() -> None:
    flight = fly(Scene(seed=1, sensors=("range0", "tdoa0"), uwb_rate_hz=200.0, accel_fault=FAULT))
    flagged = {}
    for enabled in ("true", "false"):
        config = flight.config.with_params({"imu_fault.enabled": enabled})
        flags = run_batch(config, flight.tables).track.flags
        flagged[enabled] = bool((flags & Health.ACCELEROMETER_FAULT).any())
    assert flagged == {"true": True, "false": False}
