"""What ``axialnav camera`` prints: what was set on the camera, and what was measured of its pictures."""

from __future__ import annotations

import threading
from collections.abc import Callable

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live.camera import Grabber, MotionStage
from axialnav.fusion.live.camera_source import Source, open_source, require_source
from axialnav.fusion.live.vehicle import Vehicle
from axialnav.fusion.live.warm_up import warm_camera
from axialnav.fusion.readings import PixelMotion
from axialnav.models.rig import Camera

RATE_TOLERANCE = 0.05


def check_camera(
    vehicle: Vehicle, seconds: float, clock: Callable[[], int], stop: threading.Event
) -> tuple[list[str], bool, int]:
    """Run the camera for ``seconds``: lines for a person, whether all is well, and how many pictures came.

    Raises
    ------
    ConfigError
        No camera is configured, or it cannot be used.
    """
    if vehicle.camera is None:
        raise ConfigError("the vehicle file has no [camera]; add one with source and sensor")
    spec = vehicle.filter.sensor[vehicle.camera.sensor]
    assert isinstance(spec, Camera)
    require_source(vehicle.camera)
    if spec.surface is not None:
        warm_camera(vehicle.filter, vehicle.camera.sensor, spec)  # a compiler at work would look like missing pictures
    source = open_source(vehicle.camera, spec, clock)
    grabber = Grabber(source, spec.rate_hz)
    motions: list[PixelMotion] = []
    measured = spec.surface is not None
    stage = MotionStage(
        vehicle.filter, vehicle.camera.sensor, grabber.mailbox, lambda motion, _: motions.append(motion), clock
    )
    thread = threading.Thread(target=grabber.run, args=(stop,), daemon=True)
    thread.start()
    until = clock() + round(seconds * 1e9)
    while clock() < until and not (grabber.ended and not len(grabber.mailbox)):
        picture = grabber.mailbox.take(0.05)
        if picture is not None and measured:
            stage.measure(picture)
    stop.set()
    thread.join(1.0)
    report = Report(source, grabber, stage if measured else None, spec, motions)
    return report.lines(), report.good(), grabber.counts["pictures"]


class Report:
    """The findings of a camera, line by line."""

    def __init__(
        self,
        source: Source,
        grabber: Grabber,
        stage: MotionStage | None,
        spec: Camera,
        motions: list[PixelMotion],
    ) -> None:
        self._source, self._grabber, self._stage = source, grabber, stage
        self._spec, self._motions = spec, motions

    def good(self) -> bool:
        """Whether nothing needs attention."""
        counts = self._grabber.counts
        trouble = counts["gaps"] + counts["repeated"] + counts["backwards"] + counts["unread"]
        return all(s.good for s in self._source.settings) and self._rate_is_right() and not trouble and self._stamped()

    def lines(self) -> list[str]:
        """One line a setting, then what was measured."""
        lines = [
            f"{'ok ' if s.good else 'NOT'} set {s.name:<18} {s.wanted:>10}  is {s.got}" for s in self._source.settings
        ]
        counts, rate = self._grabber.counts, self._grabber.rate_hz
        told = f"{rate:.2f} Hz" if rate is not None else "not known"
        wanted = f" (described as {self._spec.rate_hz:g})" if self._spec.rate_hz else ""
        lines.append(f"{'ok ' if self._rate_is_right() else 'NOT'} rate {told}{wanted}, {counts['pictures']} pictures")
        if counts["pictures"] > 1:
            shortest, longest = self._grabber.shortest_ns * 1e-6, self._grabber.longest_ns * 1e-6
            lines.append(f"    from picture to picture {shortest:.2f} .. {longest:.2f} ms")
        lines.append(
            f"    gaps {counts['gaps']} ({counts['missing']} pictures missing), repeated stamps {counts['repeated']}, "
            f"stamps going back {counts['backwards']}, unreadable {counts['unread']}"
        )
        if self._source.reconnected:
            lines.append(f"NOT always there: gone and opened anew {self._source.reconnected} times")
        where = (
            "from the driver" if self._stamped() else f"{self._source.stamps_by_arrival} by arrival: late and jittery"
        )
        lines.append(f"{'ok ' if self._stamped() else 'NOT'} stamps {where}")
        return lines + self._motion_lines()

    def _motion_lines(self) -> list[str]:
        if self._stage is None:
            return ["    motion not measured: the camera names no surface"]
        measured, refused = self._stage.counts["measured"], self._stage.counts["refused"]
        summary = self._stage.latency.summary()
        line = f"    motion measured in {measured} windows, refused in {refused}"
        if self._motions:
            mean = sum(m.dx_px for m in self._motions) / len(self._motions)
            line += f", mean {mean:+.2f} px a frame"
        return [line, f"    from picture to motion {summary['p50_ms']} ms (median), {summary['p99_ms']} ms (99 %)"]

    def _rate_is_right(self) -> bool:
        rate, wanted = self._grabber.rate_hz, self._spec.rate_hz
        return rate is not None and (not wanted or abs(rate - wanted) <= RATE_TOLERANCE * wanted)

    def _stamped(self) -> bool:
        return self._source.stamps_by_arrival == 0
