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
from axialnav.estimators.positions import coherent_power, motion_basis, turns
from axialnav.estimators.products import Products
from axialnav.estimators.spectrum import pair_count, pair_frames

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
    frames, sums, omega = products.frames, products.total, products.band.omega()
    wall = motion_basis(frames, len(fit.motion) == 2) @ fit.motion
    many = pair_count(frames)
    at_camera, at_wall = np.empty((2, *sums.power.shape), dtype=np.float32)
    coherent_power(sums.re, sums.im, omega, -products.offset_px, at_camera)
    coherent_power(sums.re, sums.im, omega, wall - products.offset_px, at_wall)
    cosine, sine = np.empty((2, frames, len(omega)), dtype=np.float32)
    turns(omega, wall, cosine, sine)
    alike = 0.5 * (cosine.sum(axis=0) ** 2 + sine.sum(axis=0) ** 2 - frames)
    apart = np.maximum(many - alike**2 / many, 1e-6)
    high = omega > 2.0 * np.pi * LOWEST_FREQUENCY
    weight = (high * apart) / (fit.texture + fit.noise) ** 2
    total = float(sums.rows @ weight.sum(axis=1))
    match = float(np.sum(weight / apart * (at_camera - at_wall * (alike / many))))
    return match / total, float(np.sqrt(WINDOW_VARIANCE / (2.0 * total)))


def without_pattern(products: Products, power: float) -> Products:
    """The products less a white pattern of this power per row and frame."""
    pairs, frequency = pair_frames(products.frames), products.band.frequency()
    shift = products.offset_px[pairs[:, 0]] - products.offset_px[pairs[:, 1]]
    overlap = np.maximum(0.0, 1.0 - np.abs(shift) / products.window_px)
    pattern = power * overlap[:, None] * np.exp(2j * np.pi * frequency[None] * shift[:, None])
    rows = products.rows[:, :, None, None]
    return replace(
        products,
        re=(products.re - rows * pattern.real).astype(np.float32),
        im=(products.im - rows * pattern.imag).astype(np.float32),
    )
