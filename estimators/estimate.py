"""The public functions: frames in, displacement with sigma and verdict out."""

from __future__ import annotations

from axialnav.estimators.errors import FrameError
from axialnav.estimators.frames import Frames, frame_stack
from axialnav.estimators.lens import CentralView
from axialnav.estimators.methods import LEAST_FRAMES, estimate_stack, known_method
from axialnav.estimators.options import check_prior, check_times
from axialnav.estimators.result import MotionEstimate, MotionReason
from axialnav.estimators.streaming import MotionEstimator
from axialnav.models.rig import Camera

__all__ = ["FrameError", "MotionEstimate", "MotionEstimator", "MotionReason", "estimate_motion"]


def estimate_motion(
    frames: Frames,
    *,
    method: str = "joint",
    frame_period_s: float,
    exposure_s: float | None = None,
    axis: str = "x",
    prior_px: tuple[float, float] | None = None,
    camera: Camera | None = None,
) -> MotionEstimate:
    """Displacement of the pictured wall per frame period, from evenly spaced frames.

    Parameters
    ----------
    frames
        (N, h, w) uint8 or uint16, or a sequence of frames: grey (h, w), BGR (h, w, 3) or YUYV (h, w, 2).
    method
        ``"joint"`` (default, signed, N >= 2), ``"composite"`` (unsigned, N >= 2), ``"single"`` (unsigned, one frame;
        needs the exposure), or one of the published methods ``"stripes"``, ``"darkline"``, ``"dct"``, ``"cepstrum"``
        (baselines: unsigned, applied to the composite, or to the frame if there is one).
    frame_period_s
        Time from frame to frame [s].
    exposure_s
        Exposure [s]; None if unknown.
    axis
        ``"x"`` for motion along the rows, ``"y"`` for motion down the columns.
    prior_px
        Expected displacement per frame and its standard deviation [px].  It narrows the search and is not mixed into
        the result.
    camera
        Camera whose distortion is removed first; None: the pixels are used as they are.

    Returns
    -------
    MotionEstimate
        Refused with a reason where the frames do not tell.

    Raises
    ------
    FrameError
        If the input is not what this function takes: one line with value, limit and way out.
    """
    known_method(method)
    check_times(frame_period_s, exposure_s)
    check_prior(prior_px)
    stack = frame_stack(frames, axis, LEAST_FRAMES[method], method, CentralView(camera, None))
    return estimate_stack(stack, method, frame_period_s, exposure_s, prior_px)
