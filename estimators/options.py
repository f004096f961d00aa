"""What may be asked for beside the frames: times, a prior, a number of frames, a camera, a region of interest."""

from __future__ import annotations

import math

import numpy as np

from axialnav.estimators.errors import FrameError
from axialnav.models.rig import Camera

MIN_SIDE_PX = 32
MOST_FRAMES = 64  # the pairs of more would fill the memory
FARTHEST_PX = 1e5
LAST_NS = 1 << 63
SLACK = 1.001  # of the frame period: an open shutter and a rounded stamp

Prior = tuple[float, float]
Region = tuple[int, int, int, int]


def check_times(frame_period_s: float, exposure_s: float | None) -> None:
    """Refuse a frame period or an exposure that cannot be.

    Raises
    ------
    FrameError
        If the period is not positive and finite, or the exposure not within 0 and the period.
    """
    if not (_is_number(frame_period_s) and 0.0 < frame_period_s < math.inf):
        raise FrameError(f"frame_period_s must be positive and finite, got {frame_period_s!r}; give it in seconds")
    if exposure_s is not None and not (_is_number(exposure_s) and 0.0 <= exposure_s <= frame_period_s * SLACK):
        raise FrameError(
            f"exposure_s must lie within 0 and the frame period of {frame_period_s:.6g} s, got {exposure_s!r}; "
            "pass None if it is unknown"
        )


def check_stamp(t_ns: int) -> None:
    """Refuse what is no time stamp.

    Raises
    ------
    FrameError
        If it is not a whole number of nanoseconds that fits into 64 bits.
    """
    if not isinstance(t_ns, int | np.integer) or not abs(int(t_ns)) < LAST_NS:
        raise FrameError(f"t_ns must be an integer number of nanoseconds below 2^63, got {t_ns!r}; convert it first")


def check_exposure(exposure_s: float | None, t_ns: int) -> None:
    """Refuse an exposure that no frame can have, before its period is known.

    Raises
    ------
    FrameError
        If it is not a finite number of seconds, or negative.
    """
    if exposure_s is not None and not (_is_number(exposure_s) and 0.0 <= exposure_s < math.inf):
        raise FrameError(
            f"exposure_s must be finite and must not be negative, got {exposure_s!r} at t_ns={t_ns}; "
            "pass None if it is unknown"
        )


def check_prior(prior_px: Prior | None) -> None:
    """Refuse a prior that is no displacement with a standard deviation.

    Raises
    ------
    FrameError
        If it is not a pair of numbers below 1e5 px with a sigma above 0.
    """
    if prior_px is None:
        return
    try:
        mean, sigma = prior_px
        sound = abs(mean) < FARTHEST_PX and 0.0 < sigma < FARTHEST_PX
    except (TypeError, ValueError):
        sound = False
    if not sound:
        raise FrameError(
            f"prior_px must be (displacement, sigma > 0) in px per frame, both below {FARTHEST_PX:g}, "
            f"got {prior_px!r}; pass None if nothing is known"
        )


def check_count(frames: int, least: int, method: str) -> None:
    """Refuse a number of frames that a method cannot use.

    Raises
    ------
    FrameError
        If it is not a whole number from ``least`` to 64.
    """
    if isinstance(frames, bool) or not isinstance(frames, int):
        raise FrameError(f"frames must be a whole number, got {frames!r}; choose {least} to {MOST_FRAMES}")
    if not least <= frames <= MOST_FRAMES:
        raise FrameError(
            f"method {method!r} takes {least} to {MOST_FRAMES} frames, got {frames}; collect more or leave some out"
        )


def check_axis(axis: str) -> None:
    """Refuse an axis that a picture does not have.

    Raises
    ------
    FrameError
        If it is neither ``"x"`` nor ``"y"``.
    """
    if axis not in ("x", "y"):
        raise FrameError(f"axis must be 'x' (along the rows) or 'y' (down the columns), got {axis!r}")


def check_camera(camera: Camera | None) -> None:
    """Refuse what is no description of a camera.

    Raises
    ------
    FrameError
        If it is neither a :class:`~axialnav.models.rig.Camera` nor None.
    """
    if camera is not None and not isinstance(camera, Camera):
        raise FrameError(f"camera must be an axialnav.models.rig.Camera or None, got {type(camera).__name__}")


def check_region(roi: Region | None) -> None:
    """Refuse a region of interest that no picture can have.

    Raises
    ------
    FrameError
        If it is not four whole numbers, the first two not negative and the sides at least 32.
    """
    if roi is None:
        return
    whole = isinstance(roi, tuple | list) and len(roi) == 4 and all(type(n) is int for n in roi)
    if not (whole and min(roi[:2]) >= 0 and min(roi[2:]) >= MIN_SIDE_PX):
        raise FrameError(
            f"roi must be (row, column, rows, columns) in whole pixels with sides of at least {MIN_SIDE_PX} px, "
            f"got {roi!r}"
        )


def _is_number(value: object) -> bool:
    return isinstance(value, float | int | np.number)
