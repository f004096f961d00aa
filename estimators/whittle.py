r"""Blur of one picture from its power spectrum: Whittle's likelihood of texture times transfer plus noise.

.. math:: P(f) \approx c \, q(f) \, \mathrm{sinc}^2(f l) + s

Everything but l is nuisance: the texture q comes from a small family, amplitude and noise by iterated weighted least
squares.

Source: P. Whittle, Arkiv foer Matematik 2, 1953; nearest published relative: Oliveira, Figueiredo and Bioucas-Dias,
IEEE Trans. Image Process. 23(1), 2014 (power law times sinc, fitted in the logarithm).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Array = NDArray[np.float64]
PASSES = 4
FLOOR = 1e-4


@kernel
def amplitudes(power: Array, shape: Array, model: Array) -> tuple[float, float]:
    """Texture and noise power (c, s) of ``c shape + s``, none negative; all (f,), the fit into ``model``."""
    count = power.shape[0]
    c, s = 0.0, 0.0
    for f in range(count):
        model[f] = power[f]
    for _ in range(PASSES):
        gg, g1, g0, gp, p0 = 0.0, 0.0, 0.0, 0.0, 0.0
        for f in range(count):
            w = 1.0 / (model[f] * model[f])
            g = shape[f]
            gg += w * g * g
            g1 += w * g
            g0 += w
            gp += w * g * power[f]
            p0 += w * power[f]
        determinant = gg * g0 - g1 * g1
        c = (gp * g0 - p0 * g1) / determinant if determinant > 0.0 else 0.0
        s = (p0 * gg - gp * g1) / determinant if determinant > 0.0 else p0 / g0
        if c <= 0.0:
            c, s = 0.0, p0 / g0
        if s <= 0.0:
            c, s = gp / gg, 0.0
        for f in range(count):
            model[f] = c * shape[f] + s
    return c, s


@kernel
def whittle_costs(power: Array, transfers: Array, shapes: Array, cost: Array, best: NDArray[np.int64]) -> None:
    """Cost ``sum log S + P / S`` of every transfer (d, f) with its best shape (m, f); lower is better.

    ``power`` (f,); fills ``cost`` (d,) and ``best`` (d,), the number of the shape.
    """
    count = power.shape[0]
    model, shape = np.empty(count), np.empty(count)
    for d in range(transfers.shape[0]):
        cost[d] = np.inf
        for m in range(shapes.shape[0]):
            for f in range(count):
                shape[f] = shapes[m, f] * (transfers[d, f] + FLOOR)
            amplitudes(power, shape, model)
            value = 0.0
            for f in range(count):
                value += np.log(model[f]) + power[f] / model[f]
            if value < cost[d]:
                cost[d] = value
                best[d] = m


def parabola(x: Array, y: Array) -> tuple[float, float]:
    """Place and second derivative of the minimum through three points (x equally spaced)."""
    step = float(x[1] - x[0])
    bend = float(y[0] - 2.0 * y[1] + y[2]) / step**2
    if not bend > 0.0:
        return float(x[1]), 0.0
    return float(x[1]) - 0.5 * float(y[2] - y[0]) / step / bend, bend
