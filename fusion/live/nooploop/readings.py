"""Frames to readings: which number of a frame is a measurement, and whether the sensor itself believes it."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable
from typing import Literal

from axialnav.fusion.errors import ReadingError
from axialnav.fusion.live.nooploop import frames as f
from axialnav.fusion.readings import Reading, UwbFix, UwbRange, WallRange

TofModel = Literal["tofsense", "tofsense-p", "tofsense-f", "tofsense-m"]
# What ArduPilot's drivers take: serial anything but 255, CAN (P) 0 alone, I2C (F) 1 alone; 5 is the M's usual "valid".
REFUSED_STATUS: dict[str, frozenset[int]] = {
    "tofsense": frozenset({255}),
    "tofsense-p": frozenset(range(1, 256)),
    "tofsense-f": frozenset({255}),
    "tofsense-m": frozenset(set(range(256)) - {5}),
}
FIX_SIGMA_FLOOR_M = 0.1
UNKNOWN_ERROR_M = 2.55


class NLinkReadings:
    """Turns frames into readings of named sensors.

    Parameters
    ----------
    ranges, fixes, wall
        Sensor names of UWB ranges, of the receiver's own positions and of TOFSense distances; None: not wanted.
        Positions come out of the module's own filter over the same ranges, so fuse one or the other.
    tag
        Number of our own tag, needed where a console or anchor reports several.
    tof_model
        Which TOFSense it is: what its status codes mean.
    refused_status
        Status codes to refuse instead of the model's.

    Attributes
    ----------
    refused
        Reason -> how many numbers were not made into readings.
    """

    def __init__(
        self,
        *,
        ranges: str | None = "uwb0",
        fixes: str | None = None,
        wall: str | None = "tof0",
        tag: int | None = None,
        tof_model: TofModel = "tofsense",
        refused_status: Iterable[int] | None = None,
    ) -> None:
        self._ranges, self._fixes, self._wall, self._tag = ranges, fixes, wall, tag
        self._bad = REFUSED_STATUS[tof_model] if refused_status is None else frozenset(refused_status)
        self._bad_pixel = REFUSED_STATUS["tofsense-m"] if refused_status is None else self._bad
        self.refused: Counter[str] = Counter()

    def of(self, frame: f.Frame, t_ns: int) -> list[Reading]:
        """Readings of one frame, all stamped ``t_ns``."""
        readings: list[Reading] = []
        if isinstance(frame, f.TofSenseFrame0 | f.TofSenseMFrame0):
            self._add_wall(readings, frame, t_ns)
        elif isinstance(frame, f.TagFrame0):
            self._add_row(readings, frame.distances_m, t_ns)
            self._add_fix(readings, frame.position_m, frame.position_error_m, t_ns)
        elif isinstance(frame, f.NodeFrame2):
            self._add_ranges(readings, frame.ranges, t_ns)
            self._add_fix(readings, frame.position_m, frame.position_error_m, t_ns)
        elif isinstance(frame, f.NodeFrame3):
            self._add_ranges(readings, frame.ranges, t_ns)
        elif isinstance(frame, f.NodeFrame4):
            for tag in frame.tags:
                if self._is_ours(tag.id):
                    self._add_ranges(readings, tag.ranges, t_ns)
        elif isinstance(frame, f.NodeFrame1 | f.AnchorFrame0):
            for node in frame.nodes:
                if self._is_ours(node.id):
                    self._add_row(readings, node.distances_m, t_ns)
                    self._add_fix(readings, node.position_m, None, t_ns)
        return readings

    def _is_ours(self, tag: int) -> bool:
        ours = self._tag is None or tag == self._tag
        self.refused["another tag"] += not ours
        return ours

    def _add_row(self, readings: list[Reading], distances_m: tuple[float, ...], t_ns: int) -> None:
        nodes = (f.NodeRange(role=1, id=anchor, distance_m=d) for anchor, d in enumerate(distances_m) if d != 0.0)
        self._add_ranges(readings, nodes, t_ns)

    def _add_ranges(self, readings: list[Reading], nodes: Iterable[f.NodeRange], t_ns: int) -> None:
        if self._ranges is None:
            return
        for node in nodes:
            if node.distance_m <= 0.0:
                self.refused["range not positive"] += 1
                continue
            readings.append(
                UwbRange(
                    t_ns=t_ns,
                    sensor=self._ranges,
                    anchor=str(node.id),
                    range_m=node.distance_m,
                    rssi_dbm=node.total_dbm,
                    first_path_dbm=node.first_path_dbm,
                )
            )

    def _add_fix(self, readings: list[Reading], position_m: f.Vector3, error_m: f.Vector3 | None, t_ns: int) -> None:
        if self._fixes is None:
            return
        sigma = None
        if error_m is not None and all(0.0 < e < UNKNOWN_ERROR_M for e in error_m):
            x, y, z = (max(e, FIX_SIGMA_FLOOR_M) for e in error_m)
            sigma = (x, y, z)
        try:
            readings.append(UwbFix(t_ns=t_ns, sensor=self._fixes, position_m=position_m, sigma_m=sigma))
        except ReadingError:
            self.refused["position not usable"] += 1

    def _add_wall(self, readings: list[Reading], frame: f.TofSenseFrame0 | f.TofSenseMFrame0, t_ns: int) -> None:
        if self._wall is None:
            return
        sigma = None
        if isinstance(frame, f.TofSenseMFrame0):
            distance = self._middle(frame.pixels)
        else:
            sigma = frame.precision_m or None
            distance = None if frame.status in self._bad else frame.distance_m
            self.refused[f"status {frame.status}"] += distance is None
        if distance is not None and distance <= 0.0:
            self.refused["range not positive"] += 1
        elif distance is not None:
            readings.append(WallRange(t_ns=t_ns, sensor=self._wall, range_m=distance, sigma_m=sigma))

    def _middle(self, pixels: tuple[f.TofPixel, ...]) -> float | None:
        """Median of the four pixels around the optical axis as far as the sensor believes them."""
        width = 4 if len(pixels) == 16 else 8
        low = width // 2 - 1
        middle = [pixels[width * row + column] for row in (low, low + 1) for column in (low, low + 1)]
        good = [pixel.distance_m for pixel in middle if pixel.status not in self._bad_pixel]
        if not good:
            self.refused[f"status {middle[0].status}"] += 1
            return None
        return statistics.median(good)


def module_time_ms(frame: f.Frame) -> int | None:
    """The module's own clock in a frame [ms], None where it sends none; wraps at 2**32."""
    for name in ("local_time_ms", "system_time_ms"):
        time_ms = getattr(frame, name, None)
        if isinstance(time_ms, int):
            return time_ms
    return None
