"""The estimator that flies: one frame in, at most one estimate out."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError
from axialnav.estimators.frames import Image, check_times, luma, same_picture, unusable
from axialnav.estimators.lens import CentralView
from axialnav.estimators.measure import JointOptions, measure_joint
from axialnav.estimators.methods import LEAST_FRAMES, estimate_stack, known_method
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.window import FrameWindow
from axialnav.models.rig import Camera

GAP = 1.5  # frame periods
MIN_PERIOD_NS = 100_000


class MotionEstimator:
    """Image motion of a stream of frames.

    Parameters
    ----------
    camera
        The camera: its ``rate_hz`` says what a gap is (without it, the shortest distance between two frames so far
        does), its ``exposure_s`` stands in for frames that do not tell theirs, its distortion is removed.  None:
        nothing is known.
    frames
        Frames per estimate.
    method
        As in :func:`~axialnav.estimators.estimate.estimate_motion`.
    axis
        ``"x"`` or ``"y"``.
    roi
        Region of interest: first row, first column, rows, columns [px]; None for the whole picture.
    undistort
        Whether to remove the camera's distortion (of the central part only).

    Raises
    ------
    FrameError
        If the number of frames is too small for the method, or an option is unknown.

    Notes
    -----
    Estimates belong to the middle of their window (``t_ns``), not to the last frame.  A gap in the stamps empties the
    ring: the frames before it and after it are not evenly spaced.  The estimate that follows says so in ``note``.
    """

    def __init__(
        self,
        camera: Camera | None = None,
        frames: int = 5,
        method: str = "joint",
        *,
        axis: str = "x",
        roi: tuple[int, int, int, int] | None = None,
        undistort: bool = True,
    ) -> None:
        known_method(method)
        if frames < LEAST_FRAMES[method]:
            raise FrameError(f"method {method!r} needs at least {LEAST_FRAMES[method]} frames, got {frames}")
        if axis not in ("x", "y"):
            raise FrameError(f"axis must be 'x' (along the rows) or 'y' (down the columns), got {axis!r}")
        self._camera, self._frames, self._method, self._axis = camera, frames, method, axis
        self._view = CentralView(camera if undistort else None, roi)
        self._window: FrameWindow | None = None
        self._stack: deque[Image] = deque(maxlen=frames)
        self._stamps: deque[int] = deque(maxlen=frames)
        self._reasons: deque[str] = deque(maxlen=frames)
        self._period_ns = 1e9 / camera.rate_hz if camera is not None and camera.rate_hz else math.inf
        self._note = ""
        self._windows = 0

    def push(
        self,
        t_ns: int,
        image: NDArray[np.generic],
        exposure_s: float | None = None,
        prior_px: tuple[float, float] | None = None,
    ) -> MotionEstimate | None:
        """Take in a frame; return an estimate as soon as the ring is full.

        Parameters
        ----------
        t_ns
            Middle of the exposure [ns].
        image
            As in :func:`~axialnav.estimators.frames.luma`.
        exposure_s
            Exposure of this frame [s]; None: the camera's.
        prior_px
            Expected displacement per frame and its sigma [px]; narrows the search only.

        Raises
        ------
        FrameError
            If the stamp does not come after the previous one, or the frame cannot be used or has changed its size.
        """
        grey: Image = self._view(luma(image))
        if self._axis == "y":
            grey = np.ascontiguousarray(grey.T)
        self._check_stamp(t_ns)
        exposure_s = exposure_s if exposure_s is not None else self._camera.exposure_s if self._camera else None
        if exposure_s is not None and not exposure_s >= 0.0:
            raise FrameError(f"exposure_s must not be negative, got {exposure_s!r} at t_ns={t_ns}")
        self._take(t_ns, grey)
        if len(self._stamps) < self._frames:
            return None
        estimate = self._estimate(exposure_s, prior_px)
        middle = (self._stamps[0] + self._stamps[-1]) // 2
        note, self._note = self._note, ""
        return estimate.stamped(middle, note)

    def _check_stamp(self, t_ns: int) -> None:
        if not isinstance(t_ns, int | np.integer):
            raise FrameError(f"t_ns must be an integer number of nanoseconds, got {t_ns!r}")
        if not self._stamps:
            return
        step = int(t_ns) - self._stamps[-1]
        if step < MIN_PERIOD_NS:
            raise FrameError(
                f"frame at t_ns={t_ns} does not come after the one at {self._stamps[-1]}; "
                "push frames in the order of their stamps, or make a new estimator after a clock was set"
            )
        if step > GAP * self._period_ns:
            self._note = f"gap of {step / 1e6:.1f} ms before t_ns={t_ns}: the ring was emptied"
            self._forget()
        elif self._camera is None or not self._camera.rate_hz:
            self._period_ns = min(self._period_ns, float(step))

    def _forget(self) -> None:
        self._stamps.clear()
        self._stack.clear()
        self._reasons.clear()
        if self._window is not None:
            self._window.clear()

    def _take(self, t_ns: int, grey: Image) -> None:
        if self._method == "joint":
            if self._window is None:
                self._window = FrameWindow(grey.shape[0], grey.shape[1], self._frames, grey.dtype)
            window = self._window
            self._check_size(grey, window.images[0])
            repeated = bool(window.order) and same_picture(window.images[window.order[-1]], grey)
            window.push(grey)  # before the look at its pixels, which are then near the processor
            kept = window.images[window.order[-1]]
            self._reasons.append(unusable(kept) or (MotionReason.DUPLICATED if repeated else ""))
        else:
            if self._stack:
                self._check_size(grey, self._stack[-1])
            self._stack.append(grey.copy())
        self._stamps.append(int(t_ns))

    @staticmethod
    def _check_size(grey: Image, before: Image) -> None:
        if grey.shape != before.shape or grey.dtype != before.dtype:
            raise FrameError(
                f"the frame is {grey.shape} {grey.dtype}, those before are {before.shape} {before.dtype}; "
                "make a new estimator for another picture size"
            )

    def _estimate(self, exposure_s: float | None, prior_px: tuple[float, float] | None) -> MotionEstimate:
        span = self._stamps[-1] - self._stamps[0]
        period_s = span / (len(self._stamps) - 1) / 1e9 if span else self._period_ns / 1e9
        if exposure_s is not None and math.isfinite(period_s):
            check_times(period_s, exposure_s)
        if self._method != "joint":
            return estimate_stack(list(self._stack), self._method, period_s, exposure_s)
        reason = next((why for why in self._reasons if why), "")
        if reason:
            return refused(reason, signed=True, window_s=span / 1e9, method="joint")
        assert self._window is not None
        self._windows += 1
        kappa = self._windows % (self._frames - 1) == 0  # windows in between show the same blur once more
        return measure_joint(self._window, JointOptions(period_s, exposure_s, prior_px, kappa=kappa))
