"""The mission of ``axialnav demo``: straight, stairs and a reflecting corner, small pictures."""

from __future__ import annotations

import multiprocessing
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.replay.flight import Flight
from axialnav.replay.simulate.flight import simulate
from axialnav.replay.simulate.mission import CameraPlan, Mission, Opening, SectionPlan, UwbPlan, VehiclePlan
from axialnav.replay.simulate.mission_checks import check_mission

REHEARSED_S = 5.0
SOURCE = 'source = "axialnav simulate"'
NO_MARGIN = {  # simulated inertial units state the noise that they have in flight, so that no margin is needed
    "imu.accel_noise_scale": "1.0",
    "imu.gyro_noise_scale": "1.0",
}


def demo_mission() -> Mission:
    """Under half a minute: a doorway, eight steps up, a corner behind which every UWB range is a reflection."""
    door = Opening(side="left", start_m=2.5, length_m=1.0)
    mission = Mission(
        name="demo",
        section=(
            SectionPlan(kind="straight", length_m=5.0, opening=(door,)),
            SectionPlan(kind="stairs", length_m=2.8, rise_m=1.4),
            SectionPlan(kind="straight", length_m=2.0),
            SectionPlan(kind="corner", length_m=3.0, turn_deg=-90.0),
            SectionPlan(kind="straight", length_m=5.0),
        ),
        vehicle=VehiclePlan(speed_m_s=1.2, still_s=2.0),
        camera=CameraPlan(width_px=320, height_px=240, focal_px=240.0),
        uwb=UwbPlan(condition="corner"),
    )
    check_mission(mission)
    return mission


def fly_demo(folder: Path, progress: Callable[[float], None] | None = None) -> Flight:
    """Fly the demo's mission into ``folder``, in place of an earlier demo there.

    Raises
    ------
    FlightError
        The folder holds a flight that is not a simulated one.
    """
    flight_toml = folder / "flight.toml"
    if flight_toml.is_file() and SOURCE in flight_toml.read_text(encoding="utf-8"):
        shutil.rmtree(folder)
    elif folder.exists() and any(folder.iterdir()):
        raise FlightError(f"{folder}: is in the way of the demo's flight; move it or choose another place with --out")
    return simulate(demo_mission(), folder, progress=progress)


@contextmanager
def rehearsed() -> Iterator[None]:
    """Compile what a replay needs on another core while the block runs; nothing is lost where that fails."""
    with tempfile.TemporaryDirectory() as folder:
        context = multiprocessing.get_context("spawn")
        other = context.Process(target=_rehearse, args=(Path(folder) / "flight",), daemon=True)
        other.start()
        try:
            yield
            other.join()
        finally:
            other.terminate()
            other.join()


def _rehearse(folder: Path) -> None:
    """Fly and replay the beginning of the mission, so that numba's cache holds everything that is compiled."""
    from axialnav.replay.run import replay

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever interrupts speaks to the demo, which ends this process
    beginning = msgspec.structs.replace(demo_mission(), duration_s=REHEARSED_S)
    with suppress(ConfigError, FlightError, OSError):
        replay(simulate(beginning, folder))
