"""OpenCV's own ways to a displacement, on the same frames: mean over the neighbouring pairs, along the rows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

Frames = NDArray[np.uint8]


def phase_correlate(frames: Frames) -> float:
    """Mean of ``cv2.phaseCorrelate`` under a Hanning window [px per frame]."""
    window = cv2.createHanningWindow(frames.shape[:0:-1], cv2.CV_32F)
    deep = [frame.astype(np.float32) for frame in frames]
    return float(np.mean([cv2.phaseCorrelate(a, b, window)[0][0] for a, b in pairwise(deep)]))


def dense_flow(frames: Frames) -> float:
    """Mean over the pairs of the median of DIS flow, preset fast [px per frame]."""
    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    pairs = pairwise(frames)
    return float(np.mean([np.median(dis.calc(a, b, None)[..., 0]) for a, b in pairs]))


def lucas_kanade(frames: Frames) -> float:
    """Mean over the pairs of the median of pyramidal Lucas-Kanade at 400 corners [px per frame]."""
    shifts = []
    for a, b in pairwise(frames):
        corners = cv2.goodFeaturesToTrack(a, 400, 0.01, 8)
        if corners is None:
            return float("nan")
        moved, found, _ = cv2.calcOpticalFlowPyrLK(a, b, corners, None, winSize=(31, 31), maxLevel=4)
        good = found.ravel() == 1
        shifts.append(float(np.median((moved - corners)[good, 0, 0])) if good.any() else float("nan"))
    return float(np.mean(shifts))


PEERS: dict[str, Callable[[Frames], float]] = {
    "cv2.phaseCorrelate": phase_correlate,
    "cv2 DIS fast": dense_flow,
    "cv2 Lucas-Kanade": lucas_kanade,
}
