"""The composite of the paper, fitted by maximum likelihood instead of read with a Hough transform."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.blurfit import BlurFit, BlurModel, fit_blur
from axialnav.estimators.frames import Image
from axialnav.estimators.layout import STRIPS
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.rows import apply_window, bin_height, bin_rows, fast_length, hann
from axialnav.estimators.spectrum import Band, row_spectra, strip_edges

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
LOWEST_PX, HIGHEST_PX = 0.3, 64.0
MIN_COMPOSITE_PX = 2.5
MIN_BLUR_PX, MAX_BLUR_PX = 3.0, 96.0
COMPOSITE_GAIN, SINGLE_GAIN, MIN_LEAD = 12.0, 60.0, 6.0
SINGLE_BINS = 8  # blur that also goes a little across the rows smears the dark lines of single rows
MAX_RELATIVE_SIGMA = 0.15
SIGMA_SCALE = 3.0  # measured: no lens is a Gaussian, no texture a power law


def row_power(planes: list[Plane]) -> tuple[Array, Band]:
    """Mean power of the rows of every strip (s, f) of a binned picture; several pictures are averaged first."""
    mean = planes[0] if len(planes) == 1 else np.asarray(np.mean(planes, axis=0, dtype=np.float32))
    rows, width = mean.shape
    band = Band(fast_length(width))
    windowed, packed = np.empty((rows, band.length), np.float32), np.empty((rows, band.length), np.float32)
    re, im = np.empty((rows, band.count), np.float32), np.empty((rows, band.count), np.float32)
    apply_window(mean, (width - band.length) // 2, hann(band.length), windowed)
    row_spectra(windowed, band, packed, re, im)
    squares, edges = re * re + im * im, strip_edges(rows, STRIPS)
    sums = np.add.reduceat(squares, edges[:-1], axis=0).astype(np.float64)
    return sums / np.diff(edges)[:, None], band


def binned(image: Image, bins: int = 1) -> Plane:
    """Rows of a frame (r, w) summed over ``bins`` usual bins, the columns' level taken off."""
    height = bins * bin_height(*image.shape)
    out = np.empty((image.shape[0] // height, image.shape[1]), dtype=np.float32)
    bin_rows(image, 0, height, out)
    return out


def measure_composite(stack: list[Image], frame_period_s: float, exposure_s: float | None) -> MotionEstimate:
    """Unsigned displacement from the mean of the frames (its law: ``l_c = N d``).

    Parameters
    ----------
    stack
        N >= 2 grey frames.
    frame_period_s, exposure_s
        Period and exposure [s]; an unknown exposure counts as none, which costs accuracy at high speed only.
    """
    power, band = row_power([binned(image) for image in stack])
    high = min(HIGHEST_PX, band.length / (2.0 * len(stack)))
    model = BlurModel(len(stack), round((exposure_s or 0.0) / frame_period_s, 3), LOWEST_PX, high)
    fit = fit_blur(power, band, stack[0].shape[0] // bin_height(*stack[0].shape), model)
    span_s = (len(stack) - 1) * frame_period_s
    if fit.value_px * len(stack) < MIN_COMPOSITE_PX:
        return refused(MotionReason.SHORT, signed=False, window_s=span_s, method="composite")
    return _told(fit, 1.0, "composite", span_s, COMPOSITE_GAIN)


def measure_single(image: Image, frame_period_s: float, exposure_s: float | None) -> MotionEstimate:
    """Unsigned displacement per period from the blur of one exposure (its law: ``l = d t_e / T``), for l >= 3 px.

    Shorter blur cannot be told from a soft lens.

    Parameters
    ----------
    image
        Grey frame.
    frame_period_s, exposure_s
        Period and exposure [s]; without an exposure the blur says nothing about speed.
    """
    if not exposure_s:
        return refused(MotionReason.NO_EXPOSURE, signed=False, window_s=0.0, method="single")
    plane = binned(image, SINGLE_BINS)
    power, band = row_power([plane])
    model = BlurModel(1, 1.0, MIN_BLUR_PX / 2.0, min(MAX_BLUR_PX, band.length / 6.0))
    fit = fit_blur(power, band, plane.shape[0], model)
    if math.isfinite(fit.value_px) and fit.value_px < MIN_BLUR_PX:
        return refused(MotionReason.SHORT, signed=False, window_s=exposure_s, method="single")
    return _told(fit, frame_period_s / exposure_s, "single", exposure_s, SINGLE_GAIN)


def _told(fit: BlurFit, scale: float, method: str, window_s: float, least_gain: float) -> MotionEstimate:
    if not (fit.gain > least_gain and fit.lead > MIN_LEAD and math.isfinite(fit.sigma_px)):
        return refused(MotionReason.MODEL, signed=False, window_s=window_s, method=method)
    if fit.sigma_px * SIGMA_SCALE > max(MAX_RELATIVE_SIGMA * fit.value_px, 0.1):
        return refused(MotionReason.SIGMA, signed=False, window_s=window_s, method=method)
    return MotionEstimate(
        fit.value_px * scale,
        fit.sigma_px * SIGMA_SCALE * scale,
        math.nan,
        True,
        MotionReason.GOOD,
        False,
        window_s,
        method=method,
    )
