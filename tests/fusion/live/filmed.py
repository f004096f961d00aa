"""A simulated corridor flight with its pictures, ready to be streamed: the wall that the camera sees is rendered."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from axialnav.fusion.config import Config
from axialnav.fusion.live.camera_source import FolderSource, Picture
from axialnav.fusion.live.vehicle import CameraInput, Vehicle
from axialnav.models.rig import Camera
from axialnav.replay.flight import Flight, Truth, load_flight
from axialnav.replay.flight_cut import cut_flight
from axialnav.replay.run import replay
from axialnav.replay.simulate.flight import simulate
from axialnav.replay.simulate.scenarios import mission_of
from tests.fusion.live.streamed import Course, with_numbers
from tests.fusion.made_flights import Motion, Table

UNSENT = ("att0", "baro0")  # MAVLink brings neither of them to us in this set-up


def render(folder: Path, *, seed: int, duration_s: float, width_px: int = 640, height_px: int = 480) -> Path:
    """Simulate a straight corridor with pictures, unless the folder holds it already."""
    if not folder.exists():
        mission = mission_of("straight", duration_s=duration_s, uwb="clean")
        camera = msgspec.structs.replace(mission.camera, width_px=width_px, height_px=height_px)
        simulate(msgspec.structs.replace(mission, camera=camera), folder, seed=seed, frames=True)
    return folder


def filmed_course(folder: Path) -> Course:
    """What of a simulated flight travels on wires; its pictures are for :class:`Shutter`."""
    flight = load_flight(folder)
    tables = {name: Table(t.t_ns, t.columns) for name, t in flight.tables.items() if name not in (*UNSENT, "cam0")}
    assert flight.truth is not None
    seconds = float(tables["imu0"].t_ns[-1] - tables["imu0"].t_ns[0]) * 1e-9
    return Course(tables, heard(flight.config), seconds, Track(flight.truth, int(tables["imu0"].t_ns[0])))


def heard(config: Config) -> Config:
    """The flight's configuration without the sensors that nobody sends, anchors numbered."""
    data = with_numbers(config).to_dict()
    for name in UNSENT:
        data["sensor"].pop(name, None)
    return Config.from_dict(data)


class Track:
    """Truth of a recorded flight between its samples."""

    def __init__(self, truth: Truth, first_ns: int) -> None:
        self._t = (truth.t_ns - first_ns) * 1e-9
        self._truth = truth
        self._attitude = Slerp(self._t, Rotation.from_quat(np.roll(truth.quaternion_WB, -1, axis=1)))

    def __call__(self, t: np.ndarray) -> Motion:
        """Truth at instants within the flight [s]; accelerations and rates are not asked for."""
        t = np.clip(t, self._t[0], self._t[-1])

        def between(columns: np.ndarray) -> np.ndarray:
            return np.stack([np.interp(t, self._t, column) for column in columns.T], axis=1)

        unknown = np.full((len(t), 3), np.nan)
        position, velocity = between(self._truth.position_m), between(self._truth.velocity_m_s)
        return Motion(t, position, velocity, unknown, self._attitude(t), unknown)


class Shutter(FolderSource):
    """The folder of pictures of a flight, played from the instant ``t0_ns`` at which that flight is streamed.

    Between the flight times ``frozen_s`` the driver hands out the same pixels again and again, with fresh stamps.
    """

    def __init__(
        self,
        folder: Path,
        config: Config,
        frozen_s: tuple[float, float] = (0.0, 0.0),
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        spec = config.sensor["cam0"]
        assert isinstance(spec, Camera)
        flight = load_flight(folder)
        super().__init__(folder / "mav0/cam0/data", CameraInput(source=str(folder)), spec, clock, sleep)
        self.t0_ns: int | None = None
        self.released = threading.Event()
        self._files = [flight.image_path("cam0", name) for name in flight.tables["cam0"].columns["filename"].tolist()]
        self._frozen_s = frozen_s
        self._after_ns = int(flight.tables["cam0"].t_ns[0] - flight.tables["imu0"].t_ns[0])

    def release(self, t0_ns: int) -> None:
        """The flight has begun."""
        self.t0_ns = t0_ns
        self.released.set()

    def pictures(self) -> Iterator[Picture | None]:
        """Pictures from the first one on, as soon as the flight has begun."""
        while not self.released.wait(0.1):
            yield None
        assert self.t0_ns is not None
        self._sleep(max(self.t0_ns + self._after_ns - self._clock(), 0) * 1e-9)
        held = None
        for picture in super().pictures():
            if picture is not None and self._frozen_s[0] <= (picture.t_ns - self.t0_ns) * 1e-9 < self._frozen_s[1]:
                held = picture.image if held is None else held
                yield replace(picture, image=held)
            else:
                yield picture


def with_camera(vehicle: Vehicle) -> Vehicle:
    """The vehicle with a camera whose pictures somebody else provides."""
    return msgspec.structs.replace(vehicle, camera=CameraInput(source="folder", sensor="cam0"))


def clean_errors(folder: Path, from_s: float, start_s: float, end_s: float) -> np.ndarray:
    """Axial velocity of a replay of the whole flight from ``from_s`` on, minus the truth [m/s]."""
    flight: Flight = load_flight(folder)
    first = int(flight.tables["imu0"].t_ns[0])
    track = replay(cut_flight(flight, from_s, 1e3), without=UNSENT).track
    t = (track.t_ns - first) * 1e-9
    wanted = (t >= start_s) & (t < end_s)
    assert flight.truth is not None
    truth = Track(flight.truth, first)(t[wanted])
    return np.asarray(track.velocity_m_s[wanted, 0] - truth.velocity_m_s[:, 0])


def fused_errors(recording: Path, course: Course, t0_ns: int, start_s: float, end_s: float) -> np.ndarray:
    """Axial velocity that the filter had at its samples when every reading was in, minus the truth [m/s].

    A message cannot know the pictures of the last tenth of a second, which are still being taken and measured: what
    the link costs shows here, what the delay costs in the messages.
    """
    track = replay(load_flight(recording)).track
    t = (track.t_ns - t0_ns) * 1e-9
    wanted = (t >= start_s) & (t < end_s)
    return np.asarray(track.velocity_m_s[wanted, 0] - course.motion(t[wanted]).velocity_m_s[:, 0])
