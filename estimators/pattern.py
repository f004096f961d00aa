r"""A pattern of the pixels themselves, fixed to the camera and white: measured beside the wall and taken out.

At the positions of the wall a product of frames i, j is :math:`q + p \, \cos` of the phase between wall and camera; at
those of the camera it is the other way round.  Two equations for every frequency give the pattern's power p, whatever
the texture's spectrum q is; its mean over the high frequencies is subtracted from the products.  Left in, it would pull
every displacement towards zero.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.joint import Fit
from axialnav.estimators.positions import coherent_power, motion_basis, relative_turn, turns
from axialnav.estimators.products import Products
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Index = NDArray[np.int64]
LOWEST_FREQUENCY = 0.15
SURE = 4.0
WINDOW_VARIANCE = 1.6


def pattern_power(products: Products, fit: Fit) -> tuple[float, float]:
    """Power of the pattern per row and frame, and its standard deviation.

    Parameters
    ----------
    products
        Products of windows that follow the wall.
    fit
        Their fit.
    """
    sums, omega = products.total, products.band.omega()
    wall = motion_basis(products.frames, len(fit.motion) == 2) @ fit.motion
    first = int(np.searchsorted(omega, 2.0 * np.pi * LOWEST_FREQUENCY, side="right"))
    match, total = _repeated(
        sums.re, sums.im, sums.rows, omega, wall, products.offset_px, fit.texture, fit.noise, first
    )
    return match / total, math.sqrt(WINDOW_VARIANCE / (2.0 * total))


@kernel
def _repeated(
    re: Plane,
    im: Plane,
    rows: Array,
    omega: Array,
    wall: Array,
    offset: Array,
    texture: Array,
    noise: Array,
    first: int,
) -> tuple[float, float]:
    """What repeats at the camera's position beyond the wall's part in it, weighted, and the sum of the weights.

    Products (c, p, f) of ``rows`` (c,) rows, positions of the wall and of the windows (n,) [px], power (c, f) of
    texture and noise; the frequencies from number ``first`` on count.
    """
    classes, many, count = re.shape
    frames = wall.shape[0]
    at_camera, at_wall = np.empty((classes, count), dtype=np.float32), np.empty((classes, count), dtype=np.float32)
    coherent_power(re, im, omega, -offset, at_camera)
    coherent_power(re, im, omega, wall - offset, at_wall)
    cosine, sine = np.empty((frames, count), dtype=np.float32), np.empty((frames, count), dtype=np.float32)
    turns(omega, wall, cosine, sine)
    match, total = 0.0, 0.0
    for f in range(first, count):
        x, y = 0.0, 0.0
        for k in range(frames):
            x += cosine[k, f]
            y += sine[k, f]
        alike = 0.5 * (x * x + y * y - frames)
        apart = max(many - alike * alike / many, 1e-6)
        for c in range(classes):
            power = texture[c, f] + noise[c, f]
            match += (at_camera[c, f] - at_wall[c, f] * (alike / many)) / (power * power)
            total += rows[c] * apart / (power * power)
    return match, total


def without_pattern(products: Products, power: float) -> Products:
    """The products less a white pattern of this power per row and frame."""
    re, im = products.re.copy(), products.im.copy()
    share, omega = power * products.rows, products.band.omega()
    _take_out(re, im, products.place, share, omega, products.offset_px, float(products.window_px))
    return replace(products, re=re, im=im, known=None)


@kernel
def _take_out(re: Plane, im: Plane, place: Index, power: Array, omega: Array, offset: Array, window: float) -> None:
    """Subtract ``power`` (s, c) times the overlap of two windows, turned by their distance, from products (s, c, p, f).

    ``offset`` (n,) [px] says where the windows start, ``window`` [px] how long they are.
    """
    frames, count = offset.shape[0], omega.shape[0]
    cosine, sine = np.empty((frames, count), dtype=np.float32), np.empty((frames, count), dtype=np.float32)
    c, d = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    turns(omega, offset, cosine, sine)
    p = 0
    for i in range(frames):
        for j in range(i + 1, frames):
            relative_turn(cosine, sine, i, j, c, d)
            overlap = max(0.0, 1.0 - abs(offset[i] - offset[j]) / window)
            for s in range(re.shape[0]):
                for k in range(re.shape[1]):
                    _subtract(c, np.float32(power[s, k] * overlap), re[s, k, place[p]])
                    _subtract(d, np.float32(power[s, k] * overlap), im[s, k, place[p]])
            p += 1


@kernel
def _subtract(line: Plane, factor: np.float32, total: Plane) -> None:
    for f in range(total.shape[0]):
        total[f] -= line[f] * factor
