"""What the camera saw: single frames, the mean of a window with its stripes, and the spectrum they are read from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from axialnav.estimators.errors import FrameError
from axialnav.models.rig import Camera
from axialnav.replay.report.figure import BLUE, GREY, Figure, Trace, numbers
from axialnav.replay.report.png import data_address
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

if TYPE_CHECKING:
    from axialnav.replay.report.moments import Moment, Picture

MAX_WIDTH = 480
MAX_NOTCHES = 12
SHORTEST_PX = 0.45
NOTE = (
    "The mean of neighbouring frames shows every mark of the wall once per frame: stripes in its spectrum, dark every "
    "1 / (N d) cycles per pixel for N frames that are d pixels apart. Dotted lines: where the dark stripes must lie if "
    "the fused velocity and the distance of the wall are right."
)


def build(run: Run) -> Section | None:
    """Nothing for flights without frames of a wall; a sentence where the pictures cannot be read.

    What works on pictures is loaded where there are some: OpenCV takes longer to load than a report to write.
    """
    camera = _camera(run)
    if camera is None:
        return None
    from axialnav.replay.report.moments import moments

    name, spec = camera
    try:
        found = moments(run, name, spec)
        figures = [_spectrum(moment) for moment in found]
    except FrameError as error:
        return Section(f"Frames of {name}", note=f"Not shown: {error}")
    shown = [_shown(moment) for moment in found]
    return Section(f"Frames of {name}", figures, "frames.html.j2", NOTE, {"moments": shown}) if found else None


def _camera(run: Run) -> tuple[str, Camera] | None:
    """First camera that looks at a surface and took a window of frames."""
    for name, spec in run.config.sensor.items():
        usable = isinstance(spec, Camera) and spec.surface is not None and name not in run.config.disabled
        table = run.flight.tables.get(name)
        if usable and table is not None and not table.is_motion and len(table) >= run.config.camera.frames:
            assert isinstance(spec, Camera)
            return name, spec
    return None


def _shown(moment: Moment) -> dict[str, Any]:
    middle = moment.frames[len(moment.frames) // 2]
    mean = np.mean(np.stack(moment.frames).astype(np.float32), axis=0)
    return {
        "title": f"{moment.title}: {moment.speed_m_s:+.2f} m/s at {moment.seconds:.1f} s",
        "pixels": "-" if np.isnan(moment.displacement_px) else f"{moment.displacement_px:.1f}",
        "count": len(moment.frames),
        "frame": data_address(_small(middle)),
        "mean": data_address(_small(np.asarray(mean, dtype=np.uint8))),
    }


def _small(picture: Picture) -> Picture:
    """At most ``MAX_WIDTH`` columns, by means over squares."""
    step = -(-picture.shape[1] // MAX_WIDTH)
    height, width = (n // step * step for n in picture.shape)
    squares = picture[:height, :width].reshape(height // step, step, width // step, step)
    return np.asarray(squares.mean(axis=(1, 3)), dtype=np.uint8)


def _spectrum(moment: Moment) -> Figure:
    """Mean power of the rows of the composite in decibels of its largest value."""
    from axialnav.estimators.frames import frame_stack
    from axialnav.estimators.spectral.picture import composite_rows, spectra_of

    spectra = spectra_of(composite_rows(frame_stack(moment.frames, "x", 2, "composite")), 1.0)
    power = 10.0 * np.log10(np.maximum(spectra.mean, 1e-12))
    power -= power.max()
    trace: Trace = {
        "type": "scatter",
        "mode": "lines",
        "name": moment.title,
        "x": numbers(spectra.frequency),
        "y": numbers(power),
        "line": {"color": BLUE, "width": 1.5},
    }
    layout = {"shapes": _notches(moment, float(spectra.frequency[-1])), "showlegend": False}
    caption = f"Composite at {moment.seconds:.1f} s ({moment.title})."
    return Figure([trace], "power [dB]", caption, x_title="spatial frequency [cycles/px]", height_px=240, layout=layout)


def _notches(moment: Moment, highest: float) -> list[dict[str, Any]]:
    """Lines at the zeros of the comb: k / (N d) for k that is no multiple of N."""
    if not moment.displacement_px > SHORTEST_PX:
        return []
    count = len(moment.frames)
    first = 1.0 / (count * moment.displacement_px)
    at = [k * first for k in range(1, 2 * MAX_NOTCHES) if k % count and k * first < highest][:MAX_NOTCHES]
    style = {"color": GREY, "width": 1, "dash": "dot"}
    return [{"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": f, "x1": f, "line": style} for f in at]
