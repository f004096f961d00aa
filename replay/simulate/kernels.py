"""Compiled inner loops: row spectra times a transfer function, resampling of a wall, depth of a flat piece."""

# mypy: disable-error-code="no-untyped-def,untyped-decorator"

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, fastmath=True)
def filter_rows(packed, real, imag, out):  # pragma: no cover - compiled
    """Multiply packed row spectra by a transfer function and sum over neighbouring rows.

    Parameters
    ----------
    packed
        Real FFTs in OpenCV's packed form (Re 0, Re 1, Im 1 ... Re m), float32, shape (rows + taps - 1, 2 m).
    real, imag
        The transfer from row ``v + s`` to row ``v``, float32, shape (taps, m + 1).
    out
        Result in the same packed form, shape (rows, 2 m).
    """
    taps, half = real.shape[0], packed.shape[1] // 2
    for v in range(out.shape[0]):
        target = out[v]
        target[:] = 0.0
        for s in range(taps):
            row, re, im = packed[v + s], real[s], imag[s]
            target[0] += row[0] * re[0]
            for k in range(1, half):
                a, b = row[2 * k - 1], row[2 * k]
                target[2 * k - 1] += a * re[k] - b * im[k]
                target[2 * k] += a * im[k] + b * re[k]
            target[2 * half - 1] += row[2 * half - 1] * re[half]


@numba.njit(cache=True, fastmath=True)
def fold_rows(full, out):  # pragma: no cover - compiled
    """Spectra of every second sample: frequency ``f`` and its alias ``1 - f`` add, as they do on a sensor.

    ``full`` is packed, shape (rows, 4 h); ``out`` is packed, shape (rows, 2 h).
    """
    length = out.shape[1]
    half = length // 2
    for v in range(out.shape[0]):
        row, target = full[v], out[v]
        target[0] = 0.5 * (row[0] + row[2 * length - 1])
        for k in range(1, half):
            mirror = length - k
            target[2 * k - 1] = 0.5 * (row[2 * k - 1] + row[2 * mirror - 1])
            target[2 * k] = 0.5 * (row[2 * k] - row[2 * mirror])
        target[length - 1] = row[length - 1]


@numba.njit(cache=True, fastmath=True)
def cubic(x):  # pragma: no cover - compiled
    """Keys' cubic interpolation weights of the samples -1, 0, 1, 2 at ``x`` in [0, 1)."""
    a = np.float32(-0.5)
    one, two, three = np.float32(1), np.float32(2), np.float32(3)
    y = one - x
    return (
        a * x * y * y,
        ((a + two) * x - (a + three)) * x * x + one,
        ((a + two) * y - (a + three)) * y * y + one,
        a * x * x * y,
    )


@numba.njit(cache=True, fastmath=True)
def resample(wall, x_px, y_px, roll, yaw, focal_px, shift, left, top, density, out):  # pragma: no cover - compiled
    """See a wall through a rolled and yawed pinhole camera.

    Parameters
    ----------
    wall
        Wall samples, float32, shape (rows, cols); ``density`` columns per px, one row per px.
    x_px, y_px
        Undistorted picture coordinates relative to the principal point [px], shape of ``out``.
    roll, yaw
        Angles (cos, sin) about the optical axis and between it and the wall's normal.
    focal_px
        Focal length [px].
    shift
        What the wall's picture moved between the middle of the frame and each row [px], shape (rows of out, 2).
    left, top
        Wall coordinates of ``wall[0, 0]`` [px].
    density
        Wall columns per px.
    out
        Picture, float32, shape (h, w).
    """
    rows, cols = wall.shape
    for v in range(out.shape[0]):
        for u in range(out.shape[1]):
            x = roll[0] * x_px[v, u] - roll[1] * y_px[v, u]
            y = roll[1] * x_px[v, u] + roll[0] * y_px[v, u]
            depth = yaw[0] + x / focal_px * yaw[1]
            x = (x * yaw[0] - focal_px * yaw[1]) / depth - shift[v, 0]
            y = y / depth - shift[v, 1]
            col, row = (x - left) * density, y - top
            c, r = int(np.floor(col)), int(np.floor(row))
            c = min(max(c, 1), cols - 3)
            r = min(max(r, 1), rows - 3)
            wx = cubic(np.float32(col - c))
            wy = cubic(np.float32(row - r))
            total = np.float32(0.0)
            for j in range(4):
                line = wall[r - 1 + j]
                total += wy[j] * (wx[0] * line[c - 1] + wx[1] * line[c] + wx[2] * line[c + 1] + wx[3] * line[c + 2])
            out[v, u] = total


@numba.njit(cache=True)
def bring_nearer(lines, height, focal_px, depth):  # pragma: no cover - compiled
    """Lower ``depth`` to that of a flat convex piece where it is in view: in every row, one stretch of columns.

    Parameters
    ----------
    lines
        Linear forms ``a x + b y + c`` of a pixel's slopes (x, y), shape (n, 3): the cosine of the ray to the piece's
        plane, then one per edge that is not negative inside of it.
    height
        Distance of the camera from the plane [m].
    focal_px
        Focal length [px].
    depth
        Distance along the optical axis [m], float32, shape (h, w).
    """
    rows, cols = depth.shape
    for v in range(rows):
        y = (v - 0.5 * (rows - 1)) / focal_px
        low, high = 0.0, cols - 1.0
        for k in range(lines.shape[0]):
            rest = lines[k, 1] * y + lines[k, 2] - (1e-6 if k == 0 else 0.0)
            slope = lines[k, 0]
            if slope == 0.0:
                if rest < 0.0:
                    high = -1.0
                continue
            border = -rest / slope * focal_px + 0.5 * (cols - 1)
            if slope > 0.0:
                low = max(low, border)
            else:
                high = min(high, border)
        if low <= high:
            for u in range(int(np.ceil(low)), int(np.floor(high)) + 1):
                x = (u - 0.5 * (cols - 1)) / focal_px
                there = np.float32(height / (lines[0, 0] * x + lines[0, 1] * y + lines[0, 2]))
                depth[v, u] = min(depth[v, u], there)
