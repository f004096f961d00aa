r"""A pattern of the pixels themselves, fixed to the camera and white: measured beside the wall and taken out.

At the positions of the wall a product of frames i, j is :math:`q + p \, \cos` of the phase between wall and camera; at
those of the camera it is the other way round.  Two equations for every frequency give the pattern's power p, whatever
the texture's spectrum q is; its mean over the high frequencies is subtracted from the products.  Left in, it would pull
every displacement towards zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.joint import Fit
from axialnav.estimators.positions import motion_basis
from axialnav.estimators.products import Products
from axialnav.estimators.spectrum import pair_frames

Array = NDArray[np.float64]
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
    pairs, frequency = pair_frames(products.frames), products.band.frequency()
    high = frequency > LOWEST_FREQUENCY
    omega = 2.0 * np.pi * frequency[high]
    wall = motion_basis(products.frames, len(fit.motion) == 2) @ fit.motion
    rows = products.rows.sum(axis=0)
    summed = products.re.sum(axis=0)[..., high] + 1j * products.im.sum(axis=0)[..., high]
    step = (wall[pairs[:, 0]] - wall[pairs[:, 1]])[:, None] * omega
    start = (products.offset_px[pairs[:, 0]] - products.offset_px[pairs[:, 1]])[:, None] * omega
    at_camera = np.sum((summed * np.exp(-1j * start)).real, axis=1)
    at_wall = np.sum((summed * np.exp(1j * (step - start))).real, axis=1)
    many, alike = len(pairs), np.cos(step).sum(axis=0)
    apart = many - alike**2 / many
    weight = rows[:, None] * apart / (fit.texture + fit.noise)[:, high] ** 2
    value = (at_camera - at_wall * alike / many) / (rows[:, None] * np.maximum(apart, 1e-6))
    total = float(weight.sum())
    return float(np.sum(weight * value)) / total, float(np.sqrt(WINDOW_VARIANCE / (2.0 * total)))


def without_pattern(products: Products, power: float) -> Products:
    """The products less a white pattern of this power per row and frame."""
    pairs, frequency = pair_frames(products.frames), products.band.frequency()
    shift = products.offset_px[pairs[:, 0]] - products.offset_px[pairs[:, 1]]
    overlap = np.maximum(0.0, 1.0 - np.abs(shift) / products.band.length)
    pattern = power * overlap[:, None] * np.exp(2j * np.pi * frequency[None] * shift[:, None])
    rows = products.rows[:, :, None, None]
    return replace(
        products,
        re=(products.re - rows * pattern.real).astype(np.float32),
        im=(products.im - rows * pattern.imag).astype(np.float32),
    )
