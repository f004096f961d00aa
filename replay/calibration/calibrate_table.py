"""What calibration prints, and the file it writes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from axialnav.fusion.config import Config
from axialnav.fusion.strict_toml import dump
from axialnav.replay.calibration.calibrate import Calibration, ImageScale, calibrated_config, merge_flights
from axialnav.replay.calibration.delays import Delay
from axialnav.replay.flight import Flight


def summary(found: Sequence[Calibration]) -> str:
    """One line a quantity, with its standard error; the mean over the flights last."""
    lines = [line for one in found for line in _flight(one)]
    if len(found) > 1:
        lines += [
            f"mean       {name}: {value:.4g} +- {sigma:.2g}" for name, (value, sigma) in merge_flights(found).items()
        ]
    return "\n".join(lines)


def _flight(one: Calibration) -> Iterator[str]:
    yield f"flight     {one.flight}"
    for image in one.images:
        yield from _image(image)
    for offset in one.ranges:
        line = offset.line
        yield (
            f"range      {offset.sensor}: reads {offset.offset_m:+.4f} +- {offset.sigma_m:.4f} m too long; "
            f"scale {line.slope:.4f} +- {line.sigma_slope:.4f}, residual {line.residual:.4f} m, "
            f"used {line.used}/{line.points}, against {offset.against}"
        )
    for delay in one.delays:
        yield f"delay      {delay.sensor}: {_delay(delay)}"
    for words in one.skipped:
        yield f"NOT_EVALUATED   {words}"


def _image(image: ImageScale) -> Iterator[str]:
    s, p = image.scale, image.paper
    yield (
        f"image      {image.sensor}: blur scale {s.slope - 1.0:+.4f} +- {s.sigma_slope:.4f}, focal length "
        f"{image.focal_px:.1f} +- {image.sigma_focal_px:.1f} px, "
        f"intercept {s.intercept:+.2f} +- {s.sigma_intercept:.2f} px, "
        f"residual {s.residual:.2f} px, used {s.used}/{s.points}, against {image.against}"
    )
    if p is not None:
        yield (
            f"line       {image.sensor}: speed = {p.slope:.5f} (+- {p.sigma_slope:.5f}) m/s per px * length "
            f"{p.intercept:+.4f} (+- {p.sigma_intercept:.4f}) m/s, residual {p.residual:.4f} m/s; "
            f"distance / (focal length * window) is {image.expected_slope:.5f}"
        )


def _delay(delay: Delay) -> str:
    if delay.sigma_s is None:
        return "not determined by this flight"
    edge = ", at the edge of the search: it may be more" if delay.at_edge else ""
    gain = f"log-likelihood {delay.gain_nats:+.1f}" if delay.gain_nats else "not clear: left as it was"
    return f"stamps {1e3 * delay.late_s:+.1f} +- {1e3 * delay.sigma_s:.1f} ms late ({gain}){edge}"


def config_text(found: Calibration, config: Config | None, flight: Flight) -> str:
    """The TOML file: what stands out of its error, for ``axialnav replay --config``."""
    comments = [f"# {line}" for line in _flight(found)]
    head = "# Found by axialnav calibrate; what does not stand out of its standard error by a factor of 2 is left out."
    return "\n".join([head, *comments, "", dump(calibrated_config(config, flight, found))])
