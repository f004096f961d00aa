"""A vehicle on loopback: a flight streamed as MAVLink over UDP and as NLink over pseudo-terminals.

It sends from a thread of its own, in real time, or whatever is due whenever it is told to (:meth:`advance`).
The autopilot's boot clock runs on its own; datagrams and serial bytes are late, lost, out of order, damaged as asked.
"""

from __future__ import annotations

import heapq
import math
import os
import socket
import struct
import threading
import time
import tty
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from axialnav.fusion.batch import run_batch
from axialnav.fusion.config import Config
from axialnav.fusion.live.vehicle import Inputs, Mavlink, Nooploop, Output, Status, Vehicle
from axialnav.models.rig import RangeFinder, Uwb
from tests.fusion.live.contract import Contract, ContractArduPilot
from tests.fusion.made_flights import FOCAL_PX, Motion, Scene, Table, fly, motion

FLIP = np.array([1.0, -1.0, -1.0])
FLAGS_NAVIGATING = mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_HORIZ | mavlink.EKF_POS_HORIZ_REL
SCENE = Scene(seed=3, duration_s=8.0, still_s=1.5, sensors=("range0", "flow0", "uwb0"), uwb_rate_hz=50.0)


@dataclass(frozen=True)
class Air:
    """What happens between the two ends: shares of packets, and delays [s]."""

    jitter_s: float = 0.0
    lost: float = 0.0
    reordered: float = 0.0
    damaged: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Course:
    """What is streamed: readings, the configuration for them, and the truth at any instant [s]."""

    tables: Mapping[str, Table]
    config: Config
    duration_s: float
    motion: Callable[[np.ndarray], Motion]

    @property
    def first_ns(self) -> int:
        """Stamp of the first inertial sample, from which flight time counts."""
        return int(self.tables["imu0"].t_ns[0])


def streamed_flight(scene: Scene = SCENE) -> Course:
    """A made flight whose anchors have the numbers that LinkTrack gives them, level and heading along the corridor."""
    flight = fly(scene)
    return Course(flight.tables, with_numbers(flight.config), scene.duration_s, partial(motion, scene))


def with_numbers(config: Config) -> Config:
    """The configuration with its anchors numbered in their order."""
    data = config.to_dict()
    for sensor in data["sensor"].values():
        if sensor["kind"] == "uwb":
            sensor["anchors"] = {str(i): place for i, place in enumerate(sensor["anchors"].values())}
    return Config.from_dict(data)


def serial_sensors(config: Config) -> dict[str, str]:
    """Sensors that speak on a serial line, and what the vehicle file calls their readings."""
    kinds = {name: "ranges" if isinstance(s, Uwb) else "wall" for name, s in config.sensor.items()}
    return {name: kinds[name] for name, s in config.sensor.items() if isinstance(s, Uwb | RangeFinder)}


def vehicle_of(config: Config, port: int, ttys: Mapping[str, str], **output: Any) -> Vehicle:
    """What a careful user would write for a streamed flight."""
    kinds = serial_sensors(config)
    lines = [Nooploop(device=device, **{kinds[sensor]: sensor}) for sensor, device in ttys.items()]
    return Vehicle(
        filter=config,
        mavlink=Mavlink(link=f"udpout:127.0.0.1:{port}", profile=output.pop("profile", "ardupilot")),
        input=Inputs(flow="flow0" if "flow0" in config.sensor else None),
        output=Output(**output),
        nooploop=tuple(lines),
        status=Status(port=0, line_s=0.0),
    )


@dataclass
class StreamedVehicle:
    """Sends a flight and hears what comes back; times are seconds since the start.

    ``carry`` takes everything to the other end in the place of :meth:`send`.
    """

    course: Course
    air: Air = Air()
    contract: Contract = field(default_factory=ContractArduPilot)
    boot_ns: int = 90_000_000_000
    drift: float = 30e-6
    silent: Callable[[str, float], bool] = lambda _name, _t: False  # messages that are not sent, by name and time
    boot_at: Callable[[float, int], int] = lambda _t, boot: boot  # tampering with the boot clock
    flags: int = FLAGS_NAVIGATING
    udp_port: int = 0
    clock: Callable[[], int] = time.monotonic_ns
    carry: Callable[[str, bytes], None] | None = None

    def __post_init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", self.udp_port))
        self.socket.settimeout(0.02)
        self.port = self.socket.getsockname()[1]
        self.rng = np.random.default_rng(self.air.seed)
        self.packer = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self.lock = threading.Lock()
        self.sent: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self.serial_bytes: Counter[str] = Counter()
        self.ttys: dict[str, str] = {}
        self.masters: dict[str, int] = {}
        self.slaves: dict[str, int] = {}
        self._pulled: list[int] = []
        self.serial = [name for name in serial_sensors(self.course.config) if name in self.course.tables]
        for name in self.serial:
            self._plug(name)
        self.peer: tuple[str, int] | None = None
        self.stop = threading.Event()
        self.t0_ns = 0
        self.events = self._events()
        self._sent_events = 0
        self._due: list[tuple[float, int, str, bytes]] = []  # on their way: arrival, number, name, bytes
        self._beat_s = 0.0
        self.threads: list[threading.Thread] = []

    def _plug(self, name: str) -> None:
        master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        self.masters[name], self.ttys[name] = master, os.ttyname(slave)
        self.slaves[name] = slave

    def pull(self, name: str) -> None:
        """Pull the plug of a serial sensor and plug it in again under another number."""
        os.close(self.masters[name])
        self._pulled.append(self.slaves[name])
        self._plug(name)

    def start(self) -> None:
        """Begin as soon as the node is heard, in real time."""
        self.begin()
        self.socket.settimeout(0.02)
        self.threads = [threading.Thread(target=body, daemon=True) for body in (self._fly, self._listen)]
        for thread in self.threads:
            thread.start()

    def begin(self) -> None:
        """Wait for the first packet of the node: the flight's first instant is then."""
        self.socket.settimeout(300.0)  # the node may have to compile first
        _, self.peer = self.socket.recvfrom(4096)
        self.t0_ns = self.clock()

    def quiet(self) -> None:
        """Send nothing more; what has been sent stays where it is."""
        self.stop.set()
        for thread in self.threads:
            thread.join()

    def close(self) -> None:
        self.quiet()
        self.socket.close()
        for handle in (*self.masters.values(), *self.slaves.values(), *self._pulled):
            os.close(handle)

    def now_s(self) -> float:
        return (self.clock() - self.t0_ns) * 1e-9

    def boot(self, t_s: float) -> int:
        """Boot clock [ns] at flight time ``t_s``."""
        return self.boot_at(t_s, self.boot_ns + round(t_s * 1e9 * (1.0 + self.drift)))

    # what is sent ---------------------------------------------------------------------------------------------------

    def _events(self) -> list[tuple[float, int, str, Any]]:
        makers = {"imu0": self._imu, "flow0": self._flow}
        for name, kind in serial_sensors(self.course.config).items():
            makers[name] = self._uwb if kind == "ranges" else self._tof
        events: list[tuple[float, str, Any]] = []
        for name in makers.keys() & self.course.tables.keys():
            events += [(t, name, data) for t, data in makers[name](self.course.tables[name])]
        events += [(t, "attitude", self._attitude(t)) for t in np.arange(0.0, self.course.duration_s, 0.05)]
        events += [(t, "report", self._report) for t in np.arange(0.0, self.course.duration_s, 0.5)]
        events.sort(key=lambda e: e[:2])
        return [(t, k, name, data) for k, (t, name, data) in enumerate(events)]

    def _seconds(self, table: Any) -> list[float]:
        return [float(t) for t in (table.t_ns - self.course.first_ns) * 1e-9]

    def _imu(self, table: Any) -> Iterator[tuple[float, Any]]:
        gyro, accel = table.columns["gyro_rad_s"] * FLIP, table.columns["accel_m_s2"] * FLIP
        for k, t in enumerate(self._seconds(table)):
            values = [*accel[k].tolist(), *gyro[k].tolist()]
            yield (
                t,
                lambda boot, v=values: mavlink.MAVLink_highres_imu_message(boot // 1000, *v, *[0.0] * 7, 0x3F),
            )

    def _flow(self, table: Any) -> Iterator[tuple[float, Any]]:
        """Sensor axes looking down in the made flights are x to the right, y backwards: turned to x ahead, y right."""
        for k, t in enumerate(self._seconds(table)):
            window = float(table.columns["window_s"][k])
            right, back = (float(table.columns[c][k]) / FOCAL_PX for c in ("dx_px", "dy_px"))
            about_x, about_y = right, back  # dx_ahead = -back = -about_y; dy_right = right = about_x
            yield (
                t + 0.5 * window,
                lambda boot, w=window, x=about_x, y=about_y: mavlink.MAVLink_optical_flow_rad_message(
                    boot // 1000, 0, round(w * 1e6), x, y, 0.0, 0.0, 0.0, 0, 200, 0, -1.0
                ),
            )

    def _uwb(self, table: Any) -> Iterator[tuple[float, bytes]]:
        for k, t in enumerate(self._seconds(table)):
            head = struct.pack("<2sHBBIIIHB", b"\x55\x05", 29, 2, 0, round(t * 1e3), round(t * 1e3), 0, 3700, 1)
            distance = round(float(table.columns["range_m"][k]) * 1000.0)
            body = head + struct.pack("<BB", 1, int(table.columns["anchor"][k])) + distance.to_bytes(3, "little")
            body += bytes([160, 156])
            yield t, body + bytes([sum(body) & 0xFF])

    def _tof(self, table: Any) -> Iterator[tuple[float, bytes]]:
        for k, t in enumerate(self._seconds(table)):
            distance = round(float(table.columns["range_m"][k]) * 1000.0).to_bytes(3, "little")
            body = (
                struct.pack("<2sBBI", b"\x57\x00", 0xFF, 0, round(t * 1e3))
                + distance
                + struct.pack("<BHB", 0, 900, 0xFF)
            )
            yield t, body + bytes([sum(body) & 0xFF])

    def _attitude(self, t: float) -> Any:
        at = self.course.motion(np.array([t]))
        matrix = np.diag(FLIP) @ at.attitude.as_matrix()[0] @ np.diag(FLIP)
        x, y, z, w = Rotation.from_matrix(matrix).as_quat().tolist()
        return lambda boot: mavlink.MAVLink_attitude_quaternion_message(boot // 1_000_000, w, x, y, z, 0.0, 0.0, 0.0)

    def _report(self, _boot: int) -> Any:
        return mavlink.MAVLink_ekf_status_report_message(self.flags, 0.1, 0.1, 0.1, 0.1, 0.0)

    # how it travels -------------------------------------------------------------------------------------------------

    def _fly(self) -> None:
        while math.isfinite(at_s := self.next_s()):
            time.sleep(max(at_s - self.now_s(), 0.0) + 1e-4)
            self.advance()

    def next_s(self) -> float:
        """When something is to be sent next; infinite after the flight and when nothing more may be."""
        if self.stop.is_set():
            return math.inf
        arrival = self._due[0][0] if self._due else math.inf
        if self._sent_events == len(self.events):
            return arrival
        return min(self.events[self._sent_events][0], arrival, self._beat_s)

    def advance(self) -> None:
        """Send everything that is due by now, in its order."""
        now = self.now_s()
        while (at_s := self.next_s()) <= now:
            if self._due and self._due[0][0] <= at_s:
                (self.carry or self.send)(*heapq.heappop(self._due)[2:])
            elif self._beat_s <= at_s:
                self._beat_s += 1.0
                self._emit(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3), "HEARTBEAT")
            else:
                t, k, name, data = self.events[self._sent_events]
                self._sent_events += 1
                self._plan(t, k, name, data)

    def _plan(self, t: float, k: int, name: str, data: Any) -> None:
        if self.silent(name, t):
            return
        if not isinstance(data, bytes):
            with self.lock:
                data = data(self.boot(t)).pack(self.packer)
                self.packer.seq = (self.packer.seq + 1) % 256
        self.sent[name] += 1
        if self.rng.random() < self.air.lost:
            self.dropped[name] += 1
            return
        late = self.rng.exponential(self.air.jitter_s) if self.air.jitter_s else 0.0
        if self.rng.random() < self.air.reordered:
            late += 0.012
        heapq.heappush(self._due, (t + min(late, 0.05), k, name, self._damage(name, data)))

    def _damage(self, name: str, data: bytes) -> bytes:
        if self.rng.random() >= self.air.damaged:
            return data
        self.dropped[f"{name} damaged"] += 1
        kind = self.rng.integers(3)
        spoilt = bytearray(data)
        if kind == 0:
            spoilt[int(self.rng.integers(len(data)))] ^= 1 << int(self.rng.integers(8))
        elif kind == 1:
            del spoilt[int(self.rng.integers(1, len(data))) :]
        else:
            spoilt[:] = self.rng.bytes(len(data))
        return bytes(spoilt)

    def send(self, name: str, data: bytes) -> None:
        """Put bytes on the wire of a sensor, or on the link."""
        if name in self.masters:
            try:
                self.serial_bytes[name] += os.write(self.masters[name], data)
            except OSError:
                self.dropped[f"{name} unread"] += 1
        else:
            assert self.peer is not None
            self.socket.sendto(data, self.peer)

    def _emit(self, message: Any, name: str) -> None:
        with self.lock:
            data = message.pack(self.packer)
            self.packer.seq = (self.packer.seq + 1) % 256
        self.sent[name] += 1
        (self.carry or self.send)(name, data)

    def _listen(self) -> None:
        while not self.stop.is_set():
            try:
                self.hear()
            except TimeoutError:
                continue

    def hear(self) -> None:
        """Take one packet of the node and answer what it asks."""
        data, self.peer = self.socket.recvfrom(4096)
        t = self.now_s()
        for message in self.contract.take(data, self.boot(t)):
            if message.get_type() == "TIMESYNC" and message.tc1 == 0 and not self.silent("TIMESYNC", t):
                self._emit(mavlink.MAVLink_timesync_message(self.boot(t), message.ts1), "TIMESYNC")

    # what came back -------------------------------------------------------------------------------------------------

    def odometry(self) -> np.ndarray:
        """Stamp in flight time [s], axial velocity [m/s] and reset counter of every ODOMETRY, shape (n, 3)."""
        rows = []
        for _, m in self.contract.messages:
            if m.get_type() == "ODOMETRY":
                w, x, y, z = m.q
                axial = Rotation.from_quat([x, y, z, w]).apply([m.vx, m.vy, m.vz])[0]
                rows.append(((m.time_usec * 1000 - self.t0_ns) * 1e-9, axial, m.reset_counter))
        return np.array(rows).reshape(-1, 3)

    def axial_errors(self, start_s: float, end_s: float) -> np.ndarray:
        """Axial velocity of every ODOMETRY minus the truth at its stamp [m/s], between two flight times."""
        return axial_errors(self.course, self.odometry(), start_s, end_s)


def ahead(config: Config) -> Config:
    """The configuration with the flow sensor's axes as MAVLink has them: x ahead, y to the right, z down."""
    data = config.to_dict()
    T = np.array(data["sensor"]["flow0"]["T_BS"]).reshape(4, 4)
    T[:3, :3] = np.diag(FLIP)
    data["sensor"]["flow0"]["T_BS"] = T.ravel().tolist()
    return Config.from_dict(data)


def axial_errors(course: Course, odometry: np.ndarray, start_s: float, end_s: float) -> np.ndarray:
    """Axial velocity of messages minus the truth at their stamps [m/s], between two flight times."""
    table = odometry[(odometry[:, 0] >= start_s) & (odometry[:, 0] < end_s)]
    return np.asarray(table[:, 1] - course.motion(table[:, 0]).velocity_m_s[:, 0])


def clean_axial_errors(course: Course, from_s: float, start_s: float, end_s: float) -> np.ndarray:
    """Axial velocity of a replay that starts at ``from_s``, of all readings as they were made, minus the truth."""
    first = course.first_ns + round(from_s * 1e9)
    tables = {}
    for name, table in course.tables.items():
        keep = table.t_ns >= first
        tables[name] = Table(table.t_ns[keep], {key: column[keep] for key, column in table.columns.items()})
    track = run_batch(course.config, tables).track
    t = (track.t_ns - course.first_ns) * 1e-9
    wanted = (t >= start_s) & (t < end_s)
    truth = course.motion(t[wanted]).velocity_m_s[:, 0]
    return np.asarray(track.velocity_m_s[wanted, 0] - truth)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
