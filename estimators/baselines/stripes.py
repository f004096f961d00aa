"""The paper's Algorithm 1: blur length from the stripes of the two-dimensional spectrum."""

from __future__ import annotations

import math
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from axialnav.estimators.baselines.reading import BlurReading, grey, missing, unusable

STRETCH_PERCENTILES = (1.0, 99.9)  # of the spectrum: single bins near zero must not set the threshold
CROSS_PX = 2  # half width of the masked centre row and column
CANNY_LOW, CANNY_HIGH = 50.0, 150.0
MAX_TILT_RAD = math.radians(3.0)  # of a stripe against the vertical
VOTES_SHARE = 0.15  # of the height: what a line must collect in the Hough plane
CANNY_KERNEL = 5  # of the smoothing that Canny's detector starts with and OpenCV leaves to the caller
MIN_GAP_PX = 3  # between two lines
MIN_LINES = 4
RUNG_TOLERANCE = 0.25  # of a spacing
MIN_EVEN = 0.5


def stripes_length(image: ArrayLike) -> BlurReading:
    r"""Blur length from the stripe spacing of the spectrum.

    Spectrum by FFT, centred; centre row and column masked (cross-line mask); binarised (Otsu); edges by Canny; lines
    by Hough; pairs of edges around a dark gap are a dark line; from the spacing ``s`` of the dark lines [bins] in a
    picture of ``W`` columns

    .. math:: s \, l = W.

    On a single frame ``l`` is the blur of one exposure. On a composite of N frames the dark lines give ``N d`` and
    the bright ridges between them, N times as far apart, ``d``; which of both the lines show depends on contrast and
    threshold: the method is ambiguous by a factor N.

    Known failure: one global threshold and one edge per crossing need stripes that stand out of the noise over most
    of the height. Realistic noise and natural texture break it; it reads a long, noise-free blur well.

    Parameters
    ----------
    image
        One grey picture (h, w), a frame or a composite.

    References
    ----------
    .. [1] Drones 2024, 8(7), 306, algorithm 1 and equation 6.
    """
    reason = unusable(image)
    if reason:
        return missing(reason)
    binary = binarised_spectrum(grey(image))
    lines = dark_lines(binary)
    if len(lines) < MIN_LINES:
        return missing(f"found {len(lines)} dark lines in the spectrum, the spacing needs {MIN_LINES}")
    spacing, even = ladder(lines, binary.shape[1] // 2)
    if not even >= MIN_EVEN:
        return missing(f"only {even:.0%} of {len(lines)} dark lines are evenly spaced, limit {MIN_EVEN:.0%}")
    return BlurReading(binary.shape[1] / spacing, True)


def binarised_spectrum(picture: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Centred log spectrum (h, w) with its centre cross masked, split by Otsu's threshold into 0 and 255."""
    spectrum = np.fft.fftshift(np.log1p(np.abs(np.fft.fft2(picture)))).astype(np.float32)
    row, col = spectrum.shape[0] // 2, spectrum.shape[1] // 2
    inside = np.ones(spectrum.shape, dtype=np.uint8)
    inside[row - CROSS_PX : row + CROSS_PX + 1] = 0
    inside[:, col - CROSS_PX : col + CROSS_PX + 1] = 0
    low, high = (float(level) for level in np.percentile(spectrum[inside > 0], STRETCH_PERCENTILES))
    level = np.clip((spectrum - low) * (255.0 / max(high - low, 1e-9)), 0.0, 255.0).astype(np.uint8)
    level[inside == 0] = 0
    _, binary = cv2.threshold(level, 0.0, 255.0, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    return np.asarray(binary, dtype=np.uint8)


def dark_lines(binary: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Columns of the dark lines of a binarised spectrum, sorted.

    Vertical Hough lines through the Canny edges cut the columns into segments; a segment darker than both of its
    neighbours is a dark line.
    """
    smooth = cv2.GaussianBlur(binary, (CANNY_KERNEL, CANNY_KERNEL), 0.0)
    edges = cv2.Canny(smooth, CANNY_LOW, CANNY_HIGH)
    columns = _vertical_lines(edges, VOTES_SHARE * binary.shape[0])
    bounds = np.concatenate([[0], columns, [binary.shape[1]]])
    brightness = binary.mean(axis=0)
    segments = np.array([brightness[a:b].mean() for a, b in pairwise(bounds)])
    dark = np.flatnonzero((segments[1:-1] < segments[:-2]) & (segments[1:-1] < segments[2:])) + 1
    centre = binary.shape[1] // 2
    lines = 0.5 * (bounds[dark] + bounds[dark + 1] - 1)
    return np.asarray(lines[np.abs(lines - centre) > CROSS_PX + 1])


def _vertical_lines(edges: NDArray[np.uint8], votes: float) -> NDArray[np.int64]:
    """Columns where near-vertical Hough lines cross the middle row, strongest first kept, sorted."""
    found = cv2.HoughLines(edges, 1.0, math.radians(0.5), max(1, round(votes)), min_theta=0.0, max_theta=MAX_TILT_RAD)
    if found is None:
        return np.empty(0, dtype=np.int64)
    rho, theta = found.reshape(-1, found.shape[-1])[:, :2].T.astype(np.float64)
    columns = np.round((rho - 0.5 * edges.shape[0] * np.sin(theta)) / np.cos(theta)).astype(np.int64)
    kept: list[int] = []
    for column in columns:
        if 0 < column < edges.shape[1] and all(abs(column - other) >= MIN_GAP_PX for other in kept):
            kept.append(int(column))
    return np.array(sorted(kept), dtype=np.int64)


def ladder(lines: NDArray[np.float64], centre: int) -> tuple[float, float]:
    """Spacing [bins] of lines at ``k s`` from the centre, and the share of lines that stand on its rungs."""
    distance = np.abs(lines - centre)
    spacing = float(np.median(np.diff(lines)))
    on_rung = np.ones(len(lines), dtype=bool)
    for _ in range(3):
        rung = np.maximum(np.round(distance / spacing), 1.0)
        on_rung = np.abs(distance / spacing - rung) < RUNG_TOLERANCE
        if not on_rung.any():
            return spacing, 0.0
        spacing = float(distance[on_rung] @ rung[on_rung] / (rung[on_rung] @ rung[on_rung]))
    return spacing, float(on_rung.mean())
