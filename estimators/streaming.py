"""The estimator that flies: one frame in, at most one estimate out."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError
from axialnav.estimators.frames import Image, luma, unusable
from axialnav.estimators.lens import CentralView
from axialnav.estimators.measure import JointOptions, measure_joint
from axialnav.estimators.methods import LEAST_FRAMES, estimate_stack, known_method
from axialnav.estimators.options import (
    Prior,
    Region,
    check_axis,
    check_count,
    check_exposure,
    check_prior,
    check_stamp,
    check_times,
)
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.window import FrameWindow
from axialnav.models.rig import Camera

GAP = 1.5  # usual steps between two stamps
RECENT_STEPS = 16
MIN_PERIOD_NS = 100_000


class MotionEstimator:
    """Image motion of a stream of frames.

    Parameters
    ----------
    camera
        The camera: its ``rate_hz`` says what a gap is until the stamps themselves do, its ``exposure_s`` stands in for
        frames that do not tell theirs, its distortion is removed.  None: nothing is known.
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
        If the number of frames is too small for the method or too large, or an option is not what it can be.

    Notes
    -----
    Estimates belong to the middle of their window (``t_ns``), not to the last frame.  A gap in the stamps empties the
    ring: the frames before it and after it are not evenly spaced.  The estimate that follows says so in ``note``.  A
    gap is a step half as long again as the usual one, the lower quartile of the last 16: one short step or some lost
    frames do not change it, but a camera that slows down in the dark is followed within as many frames.
    """

    def __init__(
        self,
        camera: Camera | None = None,
        frames: int = 5,
        method: str = "joint",
        *,
        axis: str = "x",
        roi: Region | None = None,
        undistort: bool = True,
    ) -> None:
        known_method(method)
        check_count(frames, LEAST_FRAMES[method], method)
        check_axis(axis)
        self._camera, self._frames, self._method, self._axis = camera, frames, method, axis
        self._view = CentralView(camera if undistort else None, roi)
        self._window: FrameWindow | None = None
        self._stack: deque[Image] = deque(maxlen=frames)
        self._stamps: deque[int] = deque(maxlen=frames)
        self._reasons: deque[str] = deque(maxlen=frames)
        nominal = [1e9 / camera.rate_hz] if camera is not None and camera.rate_hz else []
        self._steps_ns: deque[float] = deque(nominal, maxlen=RECENT_STEPS)
        self._note = ""
        self._windows = 0

    def push(
        self,
        t_ns: int,
        image: NDArray[np.generic],
        exposure_s: float | None = None,
        prior_px: Prior | None = None,
    ) -> MotionEstimate | None:
        """Take in a frame; return an estimate as soon as the ring is full and the frame period known.

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
            If the stamp does not come after the previous one, the frame cannot be used or has changed its size, or the
            exposure or the prior cannot be.
        """
        grey: Image = self._view(luma(image))
        if self._axis == "y":
            grey = np.ascontiguousarray(grey.T)
        self._check_stamp(t_ns)
        exposure_s = exposure_s if exposure_s is not None else self._camera.exposure_s if self._camera else None
        check_exposure(exposure_s, t_ns)
        check_prior(prior_px)
        self._take(t_ns, grey)
        if len(self._stamps) < self._frames or not self._steps_ns:
            return None
        estimate = self._estimate(exposure_s, prior_px)
        middle = (self._stamps[0] + self._stamps[-1]) // 2
        note, self._note = self._note, ""
        return estimate.stamped(middle, note)

    def _check_stamp(self, t_ns: int) -> None:
        check_stamp(t_ns)
        if not self._stamps:
            return
        step = int(t_ns) - self._stamps[-1]
        if step < MIN_PERIOD_NS:
            raise FrameError(
                f"frame at t_ns={t_ns} does not come after the one at {self._stamps[-1]}; "
                "push frames in the order of their stamps, or make a new estimator after a clock was set"
            )
        if self._steps_ns and step > GAP * self._usual_step_ns():
            self._note = f"gap of {step / 1e6:.1f} ms before t_ns={t_ns}: the ring was emptied"
            self._forget()
        self._steps_ns.append(float(step))

    def _usual_step_ns(self) -> float:
        return sorted(self._steps_ns)[len(self._steps_ns) // 4]

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
            self._check_size(grey, window)
            window.push(grey)  # before the look at its pixels, which are then near the processor
            self._reasons.append(unusable(grey) or (MotionReason.DUPLICATED if window.repeated else ""))
        else:
            if self._stack:
                self._check_size(grey, self._stack[-1])
            self._stack.append(grey.copy())
        self._stamps.append(int(t_ns))

    @staticmethod
    def _check_size(grey: Image, before: Image | FrameWindow) -> None:
        if grey.shape != before.shape or grey.dtype != before.dtype:
            raise FrameError(
                f"the frame is {grey.shape} {grey.dtype}, those before are {before.shape} {before.dtype}; "
                "make a new estimator for another picture size"
            )

    def _estimate(self, exposure_s: float | None, prior_px: Prior | None) -> MotionEstimate:
        span = self._stamps[-1] - self._stamps[0]
        period_s = span / (len(self._stamps) - 1) / 1e9 if span else self._usual_step_ns() / 1e9
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
