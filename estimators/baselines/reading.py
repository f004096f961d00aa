"""What every published method returns, and the pictures none of them may answer."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from axialnav.estimators.options import MIN_SIDE_PX


@dataclass(frozen=True)
class BlurReading:
    """A blur length, or the reason why there is none.

    Parameters
    ----------
    length_px
        Blur length along the rows [px]; NaN unless ``found``.
    found
        Whether the method saw what it looks for.
    reason
        One sentence; empty when found.
    """

    length_px: float
    found: bool
    reason: str = ""

    def __post_init__(self) -> None:
        if self.found != (math.isfinite(self.length_px) and self.length_px > 0.0):
            raise ValueError(f"a found length must be positive and finite and a missing one NaN, got {self}")


def missing(reason: str) -> BlurReading:
    """No length, and why."""
    return BlurReading(math.nan, False, reason)


def unusable(image: ArrayLike) -> str:
    """Why a picture cannot be read at all; empty if it can."""
    picture = np.asarray(image)
    if picture.ndim != 2 or min(picture.shape) < MIN_SIDE_PX:
        return f"needs one grey picture of at least {MIN_SIDE_PX} x {MIN_SIDE_PX} px, got shape {picture.shape}"
    if picture.dtype.kind not in "uif":
        return f"needs grey values, got {picture.dtype}"
    if not np.isfinite(picture).all():
        return "the picture holds values that are not finite"
    if float(picture.max()) == float(picture.min()):
        return f"every pixel is {float(picture.flat[0]):g}: no texture"
    return ""


def grey(image: ArrayLike) -> NDArray[np.float32]:
    """Picture (h, w) as float32 without its mean [DN]."""
    picture = np.asarray(image, dtype=np.float32)
    return np.asarray(picture - picture.mean(), dtype=np.float32)
