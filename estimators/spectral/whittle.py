r"""Whittle's likelihood of a mean power spectrum, maximised over the blur and everything that is not known besides.

.. math:: -\ell(\theta) = R \sum_f \Big[ \log M(f; \theta) + \frac{P(f)}{M(f; \theta)} \Big]

for the mean power P of R rows.  The parameters are blur length, four of the texture's spectrum and the logarithm of the
noise floor.  Fisher scoring with Levenberg's damping, so that starts far from the answer do no harm.

Source: P. Whittle, Arkiv foer Matematik 2, 1953; K. Levenberg, Quart. Appl. Math. 2, 1944.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.shapes import exposure_power
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
BLUR, TEXTURE, NOISE, PARAMETERS = 0, 1, 5, 6
MAX_EXPONENT = 60.0
FAINT, FIRM, TINY = 0.05, 100.0, 1e-9  # FIRM: rows times looks that the prior is worth in a straight fit
SHARING, LEAST = 4, 1e-300
FIRST_DAMPING, MAX_REFUSALS, ENOUGH = 1e-2, 6, 1e-7


@kernel
def solve_spd(A: Array, b: Array) -> Array:
    """``A^-1 b`` for a symmetric positive definite A (n, n) by Cholesky's factors; NaN if it is not."""
    n = b.shape[0]
    L = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(total) if i == j else total / L[j, j]
    x = b.copy()
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
    return x


@kernel
def spectrum(theta: Array, basis: Array, shape: Array, model: Array, gradient: Array) -> None:
    """``M`` (f,) and the derivatives of ``log M`` (f, p) at ``theta`` from ``shape`` (f, 2), see ``exposure_power``."""
    noise = math.exp(min(theta[NOISE], MAX_EXPONENT))
    for j in range(model.shape[0]):
        exponent = 0.0
        for k in range(NOISE - TEXTURE):
            exponent += theta[TEXTURE + k] * basis[j, k]
        texture = math.exp(min(exponent, MAX_EXPONENT))
        model[j] = texture * shape[j, 0] + noise
        share = texture / model[j]
        gradient[j, BLUR] = share * shape[j, 1]
        share *= shape[j, 0]
        for k in range(NOISE - TEXTURE):
            gradient[j, TEXTURE + k] = basis[j, k] * share
        gradient[j, NOISE] = 1.0 - share


@kernel
def misfit(power: Array, model: Array) -> float:
    """``sum log M + P / M``; a few numbers share a logarithm, which is what takes the time."""
    total, product = 0.0, 1.0
    for j in range(power.shape[0]):
        total += power[j] / model[j]
        product *= model[j]
        if j % SHARING == SHARING - 1 or j + 1 == power.shape[0]:
            total += math.log(max(product, LEAST))
            product = 1.0
    return total


@kernel
def normal_equations(power: Array, model: Array, gradient: Array, score: Array, J: Array) -> None:
    """Score (p,) and information (p, p) per row."""
    score[:] = 0.0
    J[:, :] = 0.0
    for j in range(power.shape[0]):
        residual = power[j] / model[j] - 1.0
        for a in range(PARAMETERS):
            score[a] += residual * gradient[j, a]
            for b in range(a + 1):
                J[a, b] += gradient[j, a] * gradient[j, b]
    for a in range(PARAMETERS):
        for b in range(a):
            J[b, a] = J[a, b]


@kernel
def pull(theta: Array, prior: Array) -> float:
    """Half the sum of squared distances from ``prior[0]`` in units of ``prior[1]`` (inverse variances)."""
    total = 0.0
    for a in range(PARAMETERS):
        total += 0.5 * prior[1, a] * (theta[a] - prior[0, a]) ** 2
    return total


@kernel
def climb_step(theta: Array, free: NDArray[np.bool_], prior: Array, score: Array, J: Array, damping: float) -> Array:
    """Damped Fisher step (p,), zero for parameters that are not free."""
    A, g = J.copy(), score.copy()
    for a in range(PARAMETERS):
        A[a, a] += prior[1, a]
        A[a, a] *= 1.0 + damping
        g[a] -= prior[1, a] * (theta[a] - prior[0, a])
        if not free[a]:
            A[a, :] = 0.0
            A[:, a] = 0.0
            A[a, a] = 1.0
            g[a] = 0.0
    return solve_spd(A, g)


@kernel
def straight_start(theta: Array, shape: Array, power: Array, basis: Array, prior: Array) -> None:
    """Set the texture of ``theta`` by a straight fit of ``log (P - s) - log G``: near enough for Fisher's steps."""
    size = NOISE - TEXTURE
    A, b = np.zeros((size, size)), np.zeros(size)
    noise = math.exp(theta[NOISE])
    for j in range(power.shape[0]):
        texture = max(power[j] - noise, FAINT * power[j])
        share = texture / power[j] * shape[j, 0] / (shape[j, 0] + FAINT)
        heard = share * share
        value = math.log(texture / (shape[j, 0] + TINY))
        for a in range(size):
            b[a] += heard * basis[j, a] * value
            for c in range(size):
                A[a, c] += heard * basis[j, a] * basis[j, c]
    for a in range(size):
        firm = FIRM * prior[1, TEXTURE + a]
        A[a, a] += firm + TINY
        b[a] += firm * prior[0, TEXTURE + a]
    theta[TEXTURE:NOISE] = solve_spd(A, b)


@kernel
def maximise(
    start: Array,
    free: NDArray[np.bool_],
    frequency: Array,
    power: Array,
    basis: Array,
    prior: Array,
    steps: int,
) -> tuple[Array, float]:
    """Climb from ``start`` (p,) over the parameters that are ``free``; their ``prior`` (2, p) is mean and 1 / variance.

    The texture to start from is fitted anew.  Returns the parameters and the misfit there.
    """
    count = power.shape[0]
    shape, model, gradient = np.empty((count, 2)), np.empty(count), np.empty((count, PARAMETERS))
    score, J = np.empty(PARAMETERS), np.empty((PARAMETERS, PARAMETERS))
    best, cost, damping = start.copy(), math.inf, FIRST_DAMPING
    trial = start.copy()
    refusals = 0
    for _ in range(steps + 1):
        exposure_power(frequency, trial[BLUR], shape)
        if cost == math.inf:
            straight_start(trial, shape, power, basis, prior)
        spectrum(trial, basis, shape, model, gradient)
        value = misfit(power, model) + pull(trial, prior)
        if value < cost:
            gain = cost - value
            best, cost, damping, refusals = trial.copy(), value, 0.2 * damping, 0
            normal_equations(power, model, gradient, score, J)
            if gain < ENOUGH * abs(cost):
                break
        else:
            damping, refusals = 10.0 * damping, refusals + 1
            if refusals > MAX_REFUSALS:
                break
        step = climb_step(best, free, prior, score, J, damping)
        while not (np.all(np.isfinite(step)) and best[BLUR] + step[BLUR] >= 0.0):
            damping = 10.0 * damping
            if damping > 1e12:
                return best, cost
            step = climb_step(best, free, prior, score, J, damping)
        trial = best + step
    return best, cost
