r"""A camera that looks at a wall: pinhole, lens, and the two laws that link blur to speed.

The paper's equations, for a wall at the distance H and a focal length h, pixel pitch p, exposure :math:`t_e` and time
between exposures :math:`t_{ne}`, hence the frame period :math:`T = t_e + t_{ne}`:

1. similar triangles: a blur of l pixels is a displacement :math:`L = l \, p \, H / h` of the wall;
2. exposure ratio :math:`r = t_e / (t_e + t_{ne})`;
3. displacement per frame period :math:`S = L / r`;
4. speed :math:`v = S / T = L / t_e`: r cancels.  This is the **exposure law**.

Equation 21 composes N frames, :math:`B(x, y) = \frac{1}{N} \sum_i I(x - u i T, y - v i T)`: a picture that looks
blurred over N periods, :math:`l_c = N d` for a displacement of d pixels per period.  Its **composite law** is
:math:`v = l_c \, p \, H / (h \, N T)`, without r.

Reading one length with the other law is wrong by :math:`N T / t_e` (16.7 for five frames at 30 Hz and 10 ms), so the
two lengths are two types here, and each law takes only its own.

Source: Drones 2024, 8(7), 306, equations 1-4 and 21; radial and tangential distortion: Brown, Photogrammetric
Engineering 37(8), 1971.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Intrinsics = tuple[float, float, float, float]
RADTAN = "radial-tangential"


@dataclass(frozen=True, slots=True)
class ExposureBlur:
    """Length of the blur that one exposure leaves.

    Parameters
    ----------
    length_px
        Along the motion [px], never negative.
    exposure_s
        How long the shutter was open [s].

    Raises
    ------
    ValueError
        If the length is negative or not finite, or the exposure not positive.
    """

    length_px: float
    exposure_s: float

    def __post_init__(self) -> None:
        _require(self.length_px, self.exposure_s, "exposure_s")

    def displacement_px(self, frame_period_s: float) -> float:
        """Displacement per frame period [px], ``l T / t_e`` (equations 2 and 3)."""
        return self.length_px * frame_period_s / self.exposure_s


@dataclass(frozen=True, slots=True)
class CompositeBlur:
    """Apparent blur of the mean of N frames, ``N`` times the displacement per frame.

    Parameters
    ----------
    length_px
        Along the motion [px], never negative.
    frames
        Number of frames N, at least 2.
    frame_period_s
        Time from frame to frame [s].

    Raises
    ------
    ValueError
        If the length is negative or not finite, the period not positive, or N below 2.
    """

    length_px: float
    frames: int
    frame_period_s: float

    def __post_init__(self) -> None:
        _require(self.length_px, self.frame_period_s, "frame_period_s")
        if self.frames < 2:
            raise ValueError(f"a composite has at least 2 frames, got {self.frames}; one frame is an ExposureBlur")

    @property
    def displacement_px(self) -> float:
        """Displacement per frame period [px]."""
        return self.length_px / self.frames


def _require(length_px: float, time_s: float, name: str) -> None:
    if not 0.0 <= length_px < math.inf:
        raise ValueError(f"a blur length must be finite and not negative, got {length_px!r} px")
    if not 0.0 < time_s < math.inf:
        raise ValueError(f"{name} must be positive and finite, got {time_s!r} s")


def exposure_law(blur: ExposureBlur, focal_px: float, distance_m: float) -> float:
    """Speed [m/s] from the blur of one exposure, ``v = l H / (f t_e)`` (equations 1-4).

    Parameters
    ----------
    blur
        Blur of one exposure; a composite is refused.
    focal_px
        Focal length over pixel pitch, h / p [px].
    distance_m
        Distance of the wall along the optical axis [m].

    Raises
    ------
    TypeError
        If ``blur`` is not an :class:`ExposureBlur`.
    ValueError
        If focal length or distance is not positive.
    """
    if not isinstance(blur, ExposureBlur):
        raise TypeError(f"the exposure law takes an ExposureBlur, got {type(blur).__name__}; see composite_law")
    return blur.length_px * metres_per_pixel(focal_px, distance_m) / blur.exposure_s


def composite_law(blur: CompositeBlur, focal_px: float, distance_m: float) -> float:
    """Speed [m/s] from the apparent blur of N frames, ``v = l_c H / (f N T)`` (equation 21).

    Parameters
    ----------
    blur
        Blur of a composite; that of one exposure is refused.
    focal_px
        Focal length over pixel pitch, h / p [px].
    distance_m
        Distance of the wall along the optical axis [m].

    Raises
    ------
    TypeError
        If ``blur`` is not a :class:`CompositeBlur`.
    ValueError
        If focal length or distance is not positive.
    """
    if not isinstance(blur, CompositeBlur):
        raise TypeError(f"the composite law takes a CompositeBlur, got {type(blur).__name__}; see exposure_law")
    return blur.length_px * metres_per_pixel(focal_px, distance_m) / (blur.frames * blur.frame_period_s)


def exposure_ratio(exposure_s: float, frame_period_s: float) -> float:
    """``r = t_e / T`` (equation 2) [-].

    Raises
    ------
    ValueError
        If the exposure is not within 0 and the period.
    """
    if not (0.0 < exposure_s <= frame_period_s < math.inf):
        raise ValueError(f"exposure must lie within 0 and the period of {frame_period_s} s, got {exposure_s} s")
    return exposure_s / frame_period_s


def metres_per_pixel(focal_px: float, distance_m: float) -> float:
    """Size of one pixel on the wall, ``p H / h`` (equation 1) [m].

    Raises
    ------
    ValueError
        If focal length or distance is not positive.
    """
    if not (0.0 < focal_px < math.inf and 0.0 < distance_m < math.inf):
        raise ValueError(f"focal length and distance must be positive, got {focal_px} px and {distance_m} m")
    return distance_m / focal_px


def undistorted_grid(u: Array, v: Array, intrinsics: Intrinsics) -> tuple[Array, Array]:
    """Viewing directions x/z and y/z of the pixels (u, v) of a camera without distortion."""
    fu, fv, cu, cv = intrinsics
    return (u - cu) / fu, (v - cv) / fv


def pinhole_pixels(
    x: Array, y: Array, intrinsics: Intrinsics, coefficients: tuple[float, ...] = ()
) -> tuple[Array, Array]:
    r"""Pixels where the directions (x/z, y/z) are seen through Brown's distortion (k1, k2, p1, p2[, k3]).

    .. math:: x_d = x (1 + k_1 r^2 + k_2 r^4 + k_3 r^6) + 2 p_1 x y + p_2 (r^2 + 2 x^2)

    and likewise for y with p1 and p2 exchanged.

    Raises
    ------
    ValueError
        If there are coefficients, but neither 4 nor 5.
    """
    fu, fv, cu, cv = intrinsics
    if not coefficients:
        return fu * x + cu, fv * y + cv
    if len(coefficients) not in (4, 5):
        raise ValueError(f"distortion takes k1, k2, p1, p2 and optionally k3, got {len(coefficients)} numbers")
    k1, k2, p1, p2, k3 = (*coefficients, 0.0)[:5]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    x_seen = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    y_seen = y * radial + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y)
    return fu * x_seen + cu, fv * y_seen + cv
