"""The verbs ``live`` and ``camera``: what a companion computer needs, with nothing but the core installed."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from axialnav.fusion.complaints import FAILED, PASSED, UNUSABLE, USAGE, complain, explain, shows_tracebacks

VERBS = {
    "live": "Run the on-board estimator: sensors and autopilot in, fused odometry out.",
    "camera": "Open the camera of a vehicle.toml and print what was set and what comes out of it.",
}
LONGEST_S = 3600.0
SWITCH_S = 0.001  # threads change places every millisecond: a picture being measured must not delay a message


def main(arguments: Sequence[str]) -> int:
    """Run ``live`` or ``camera`` with the words that follow ``axialnav``; return the exit code."""
    try:
        options = _parser(arguments[0]).parse_args(list(arguments[1:]))
        return _live(options.config) if arguments[0] == "live" else _camera(options.config, options.seconds)
    except SystemExit as ended:  # argparse has printed the help, or one line on what is wrong
        return int(ended.code or 0)
    except KeyboardInterrupt:
        return PASSED
    except Exception as error:  # the last line of defence: a person gets one line, not a traceback
        if shows_tracebacks():
            raise
        text, code = explain(error)
        complain(text)
        return code


class _OneLine(argparse.ArgumentParser):
    """A parser whose complaints are one line."""

    def error(self, message: str) -> None:  # type: ignore[override]
        """Complain and leave with exit code 2."""
        complain(f"{message}. See `{self.prog} --help`.")
        raise SystemExit(USAGE)


def _parser(verb: str) -> argparse.ArgumentParser:
    parser = _OneLine(prog=f"axialnav {verb}", description=VERBS[verb], allow_abbrev=False)
    parser.add_argument("--config", type=Path, required=True, metavar="TOML", help="the vehicle.toml")
    if verb == "camera":
        parser.add_argument("--seconds", type=_seconds, default=5.0, metavar="S", help="how long to measure (5)")
    return parser


def _seconds(word: str) -> float:
    """A time that can be waited for."""
    seconds = float(word)
    if not 0.0 < seconds <= LONGEST_S:
        raise ValueError(word)
    return seconds


_seconds.__name__ = f"number of seconds (more than 0, up to {LONGEST_S:g})"  # argparse names it in its complaint


def _live(path: Path) -> int:
    """Fly until SIGTERM or SIGINT; exit code 3 if a thread failed."""
    from axialnav.fusion.live.camera_source import open_source, require_source, settle_opencv
    from axialnav.fusion.live.node import Node
    from axialnav.fusion.live.recording import FlightRecording
    from axialnav.fusion.live.security import read_key
    from axialnav.fusion.live.transport import open_link
    from axialnav.fusion.live.vehicle import Vehicle
    from axialnav.fusion.live.warm_up import warm_up

    vehicle = Vehicle.from_toml(path)
    sys.setswitchinterval(SWITCH_S)
    source = None
    if vehicle.camera is not None:
        from axialnav.fusion.live.camera import require_surface

        require_surface(vehicle.filter, vehicle.camera.sensor)
        require_source(vehicle.camera)
        settle_opencv()
    open_link(vehicle.mavlink.link).close()  # what is wrong with it is said before anything that takes long
    if vehicle.mavlink.key_file:
        read_key(vehicle.mavlink.key_file)
    _say("compiling and loading the filter")
    warm_up(vehicle.filter, vehicle.estimator)
    if vehicle.camera is not None:
        spec = vehicle.filter.sensor[vehicle.camera.sensor]
        source = open_source(vehicle.camera, spec, time.monotonic_ns)  # type: ignore[arg-type]
    recording = None
    if vehicle.record is not None:
        recording = FlightRecording(path.parent / vehicle.record.folder, vehicle.record.frames, time.monotonic_ns)
    node = Node(vehicle, source=source, say=_say, recording=recording)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: node.stop.set())
    _say(f"listening on {vehicle.mavlink.link}, profile {vehicle.mavlink.profile}, sending: {vehicle.content}")
    failure = node.run()
    if failure:
        complain(f"stopped: {failure}")
        return UNUSABLE
    _say("stopped")
    return PASSED


def _camera(path: Path, seconds: float) -> int:
    """Measure the camera for a while; exit code 1 if something is not as it should be, 3 without a picture."""
    from axialnav.fusion.live.camera_check import check_camera
    from axialnav.fusion.live.camera_source import settle_opencv
    from axialnav.fusion.live.vehicle import Vehicle

    settle_opencv()
    lines, good, pictures = check_camera(Vehicle.from_toml(path), seconds, time.monotonic_ns, threading.Event())
    for line in lines:
        _say(line)
    if not pictures:
        complain(f"no picture came within {seconds:g} s; is the camera plugged in, and is it the right device?")
        return UNUSABLE
    return PASSED if good else FAILED


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()
