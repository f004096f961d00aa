r"""Score and information of the frames' positions, from pair products.

With ``E_ij = C_ij exp(i w (x_i - x_j))`` the log-likelihood is :math:`2 \sum_{f} w_q \sum_{i<j} \Re E_ij`, so that

.. math::
    \partial_i L = -2 \sum_f w_q \, \omega \sum_j \Im E_{ij}, \qquad
    -\partial_i \partial_j L = -2 \sum_f w_q \, \omega^2 \, \Re E_{ij} \; (i \neq j),

and rows of the information sum to zero.  Every motion model that is linear in its parameters (constant displacement,
acceleration, free positions) follows by a small matrix product.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Index = NDArray[np.int64]


@kernel
def turns(omega: Array, position: Array, cosine: Plane, sine: Plane) -> None:
    """``exp(i w x_k)`` of all frames, shapes (n, f): ``omega`` (f,) is evenly spaced.

    What is known of the first frequencies, turned on, is what the next ones need: twice as many with every step.
    """
    count, step = omega.shape[0], omega[1] - omega[0]
    for k in range(position.shape[0]):
        x, y = cosine[k], sine[k]
        x[0], y[0] = np.cos(omega[0] * position[k]), np.sin(omega[0] * position[k])
        known = 1
        while known < count:
            angle, many = known * step * position[k], min(known, count - known)
            c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
            _turn_on(x[:many], y[:many], c, s, x[known : known + many], y[known : known + many])
            known += many


@kernel
def _turn_on(x: Plane, y: Plane, c: np.float32, s: np.float32, out_x: Plane, out_y: Plane) -> None:
    """``(x + i y) (c + i s)`` for every frequency."""
    for f in range(x.shape[0]):
        out_x[f] = x[f] * c - y[f] * s
        out_y[f] = x[f] * s + y[f] * c


@kernel
def relative_turn(cosine: Plane, sine: Plane, i: int, j: int, c: Plane, d: Plane) -> None:
    """``exp(i w (x_i - x_j))`` for every frequency."""
    a, b, x, y = cosine[i], sine[i], cosine[j], sine[j]
    for f in range(c.shape[0]):
        c[f] = a[f] * x[f] + b[f] * y[f]
        d[f] = b[f] * x[f] - a[f] * y[f]


@kernel
def _moments(re: Plane, im: Plane, c: Plane, d: Plane, omega: Plane, parts: Plane) -> None:
    """``sum Re E``, ``-sum w Im E`` and ``sum w^2 Re E`` of one pair into the first column of ``parts`` (3, f)."""
    total, slope, bend = parts[0], parts[1], parts[2]
    for f in range(omega.shape[0]):
        real = re[f] * c[f] - im[f] * d[f]
        total[f] = real
        slope[f] = -omega[f] * (re[f] * d[f] + im[f] * c[f])
        bend[f] = omega[f] * omega[f] * real
    for part in range(3):
        _fold(parts[part])


@kernel
def _fold(values: Plane) -> None:
    """Sum of ``values`` (f,) into the first of them, halves upon halves: fast, and exact to a few units in the last."""
    length = values.shape[0]
    while length > 1:
        kept = (length + 1) // 2
        _add(values[kept:length], values[: length - kept])
        length = kept


@kernel
def _add(values: Plane, total: Plane) -> None:
    for f in range(values.shape[0]):
        total[f] += values[f]


@kernel
def position_scores(
    re: Plane,
    im: Plane,
    place: Index,
    weight: Plane,
    omega: Array,
    position: Array,
    score: Array,
    information: Array,
    coherence: Array,
) -> None:
    """Fill score (s, n), information (s, n, n) and coherence (s, p) = ``sum_f w Re E`` of every strip.

    Pair products ``re``, ``im`` (s, c, p, f); ``place`` (p,) where each of ``pair_frames`` is among them; their weights
    (c, f); ``omega`` (f,) [rad/px], evenly spaced; ``position`` (n,) [px] at which to evaluate.
    """
    strips, classes, _, count = re.shape
    frames = position.shape[0]
    cosine, sine = np.empty((frames, count), dtype=np.float32), np.empty((frames, count), dtype=np.float32)
    turns(omega, position, cosine, sine)
    c, d = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    sum_re, sum_im = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    parts, narrow = np.empty((3, count), dtype=np.float32), omega.astype(np.float32)
    score[:] = 0.0
    information[:] = 0.0
    p = 0
    for i in range(frames):
        for j in range(i + 1, frames):
            relative_turn(cosine, sine, i, j, c, d)
            for s in range(strips):
                sum_re[:] = np.float32(0.0)
                sum_im[:] = np.float32(0.0)
                for k in range(classes):
                    _add_weighted(re[s, k, place[p]], weight[k], sum_re)
                    _add_weighted(im[s, k, place[p]], weight[k], sum_im)
                _moments(sum_re, sum_im, c, d, narrow, parts)
                coherence[s, p], slope, bend = parts[0, 0], np.float64(parts[1, 0]), np.float64(parts[2, 0])
                score[s, i] += 2.0 * slope
                score[s, j] -= 2.0 * slope
                information[s, i, j] -= 2.0 * bend
                information[s, j, i] -= 2.0 * bend
                information[s, i, i] += 2.0 * bend
                information[s, j, j] += 2.0 * bend
            p += 1


@kernel
def _add_weighted(values: Plane, weight: Plane, total: Plane) -> None:
    for f in range(total.shape[0]):
        total[f] += values[f] * weight[f]


@kernel
def _add_classes(values: Plane, weight: Plane, total: Plane) -> None:
    """Add the classes of ``values`` (c, p, f), weighted, to ``total`` (p, f)."""
    for k in range(values.shape[0]):
        for p in range(values.shape[1]):
            _add_weighted(values[k, p], weight[k], total[p])


@kernel
def position_gains(re: Plane, im: Plane, weight: Plane, omega: Array, positions: Array, out: Array) -> None:
    """``sum_f w Re E`` over all pairs for each of some ``positions`` (b, n) [px] of the frames, ``out`` (b,).

    Pair products of all strips together ``re``, ``im`` (c, p, f); ``weight`` (c, f); ``omega`` (f,) [rad/px], evenly
    spaced.
    """
    pairs, count = re.shape[1:]
    frames = positions.shape[1]
    sum_re, sum_im = np.zeros((pairs, count), dtype=np.float32), np.zeros((pairs, count), dtype=np.float32)
    _add_classes(re, weight, sum_re)
    _add_classes(im, weight, sum_im)
    cosine, sine = np.empty((frames, count), dtype=np.float32), np.empty((frames, count), dtype=np.float32)
    c, d = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    total = np.empty(count, dtype=np.float32)
    for b in range(positions.shape[0]):
        turns(omega, positions[b], cosine, sine)
        total[:] = np.float32(0.0)
        p = 0
        for i in range(frames):
            for j in range(i + 1, frames):
                relative_turn(cosine, sine, i, j, c, d)
                _add_real(sum_re[p], sum_im[p], c, d, total)
                p += 1
        _fold(total)
        out[b] = total[0]


@kernel
def parameter_covariance(score: Array, information: Array, basis: Array, looks: Array, covariance: Array) -> bool:
    r"""Covariance of the parameters from the spread of the strips' scores; False if the likelihood has no maximum.

    .. math:: J^{-1} \, \frac{\nu M + \nu_0 \, \gamma J}{\nu + \nu_0} \, J^{-1}, \qquad
        M = \frac{S}{S - 1} \sum_s (g_s - \bar g)(g_s - \bar g)^T

    with :math:`\nu = S - 1`, shrunk with :math:`\nu_0` pseudo degrees of freedom towards the model's own information
    times the loss :math:`\gamma` of the window.

    Parameters
    ----------
    score, information
        Of the frames' positions in every strip, shapes (s, n) and (s, n, n).
    basis
        Positions per parameter, shape (n, m), m <= 2.
    looks
        :math:`\nu_0` and :math:`\gamma`.
    covariance
        Result, shape (m, m).
    """
    strips, many = score.shape[0], basis.shape[1]
    g, part = np.empty((strips, many)), np.empty((many, many))
    J, middle, mean = np.zeros((many, many)), np.zeros((many, many)), np.zeros(many)
    for s in range(strips):
        _project(basis, score[s], information[s], g[s], part)
        J += part
        mean += g[s] / strips
    inverse = _small_inverse(J)
    if not (inverse[0, 0] > 0.0 and np.isfinite(inverse[0, 0]) and inverse[many - 1, many - 1] > 0.0):
        return False
    free = max(strips - 1, 0)
    share = 0.0 if free == 0 else free * strips / max(strips - 1, 1) / (free + looks[0])
    for a in range(many):
        for b in range(many):
            for s in range(strips):
                middle[a, b] += share * (g[s, a] - mean[a]) * (g[s, b] - mean[b])
            middle[a, b] += looks[0] * looks[1] * J[a, b] / (free + looks[0])
    covariance[:] = 0.0
    for a in range(many):
        for b in range(many):
            for c in range(many):
                for e in range(many):
                    covariance[a, b] += inverse[a, c] * middle[c, e] * inverse[e, b]
    return True


@kernel
def _small_inverse(J: Array) -> Array:
    """Inverse of a matrix (m, m), m <= 2; not a number where it is not positive definite."""
    inverse = np.full(J.shape, np.nan)
    if J.shape[0] == 1:
        if J[0, 0] > 0.0:
            inverse[0, 0] = 1.0 / J[0, 0]
        return inverse
    determinant = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    if J[0, 0] > 0.0 and determinant > 0.0:
        inverse[0, 0], inverse[1, 1] = J[1, 1] / determinant, J[0, 0] / determinant
        inverse[0, 1], inverse[1, 0] = -J[0, 1] / determinant, -J[1, 0] / determinant
    return inverse


@kernel
def climb(
    re: Plane, im: Plane, weight: Plane, omega: Array, basis: Array, offset: Array, motion: Array, limits: Array
) -> bool:
    """Newton steps on the likelihood of ``motion`` (m,), in place; whether it has a maximum there.

    Parameters
    ----------
    re, im
        Pair products of all strips together, shape (c, p, f).
    weight
        Shape (c, f).
    omega
        Frequencies [rad/px], evenly spaced, shape (f,).
    basis
        Positions per parameter, shape (n, m), m <= 2.
    offset
        Positions of the windows [px], shape (n,).
    motion
        Start, and result.
    limits
        Longest step [px], step that ends the search [px], number of steps.
    """
    pairs, count = re.shape[1:]
    sum_re, sum_im = np.zeros((1, 1, pairs, count), dtype=np.float32), np.zeros((1, 1, pairs, count), dtype=np.float32)
    _add_classes(re, weight, sum_re[0, 0])
    _add_classes(im, weight, sum_im[0, 0])
    one, place = np.ones((1, count), dtype=np.float32), np.arange(pairs)
    frames, many = basis.shape
    score, information = np.empty((1, frames)), np.empty((1, frames, frames))
    coherence, position = np.empty((1, pairs)), np.empty(frames)
    g, J = np.empty(many), np.empty((many, many))
    for _ in range(int(limits[2])):
        for k in range(frames):
            position[k] = np.sum(basis[k] * motion) - offset[k]
        position_scores(sum_re, sum_im, place, one, omega, position, score, information, coherence)
        _project(basis, score[0], information[0], g, J)
        longest = _newton_step(g, J)
        if longest < 0.0:
            return False
        motion += g * min(1.0, limits[0] / max(longest, 1e-12))
        if longest < limits[1]:
            break
    return True


@kernel
def _project(basis: Array, score: Array, information: Array, g: Array, J: Array) -> None:
    """Score and information of the parameters."""
    frames, many = basis.shape
    g[:] = 0.0
    J[:] = 0.0
    for i in range(frames):
        for a in range(many):
            g[a] += basis[i, a] * score[i]
            for j in range(frames):
                for b in range(many):
                    J[a, b] += basis[i, a] * information[i, j] * basis[j, b]


@kernel
def _newton_step(g: Array, J: Array) -> float:
    """Replace ``g`` (m,) by the step ``J^-1 g``, m <= 2; its longest part, or -1 if there is no maximum."""
    if g.shape[0] == 1:
        if not J[0, 0] > 0.0:
            return -1.0
        g[0] /= J[0, 0]
        return float(abs(g[0]))
    determinant = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    if not (determinant > 0.0 and J[0, 0] > 0.0):
        return -1.0
    first = (J[1, 1] * g[0] - J[0, 1] * g[1]) / determinant
    g[1] = (J[0, 0] * g[1] - J[1, 0] * g[0]) / determinant
    g[0] = first
    return float(max(abs(g[0]), abs(g[1])))


@lru_cache(maxsize=64)
def centred_times(frames: int) -> Array:
    """Frame times from the middle of the window [periods], shape (n,)."""
    return np.arange(frames, dtype=np.float64) - 0.5 * (frames - 1)


@lru_cache(maxsize=64)
def motion_basis(frames: int, accelerated: bool) -> Array:
    """Positions per parameter, shape (n, 1 or 2): displacement per frame, and its change per frame."""
    t = centred_times(frames)
    basis = np.stack([t, 0.5 * (t**2 - np.mean(t**2))], axis=1)
    return np.array(basis[:, : 2 if accelerated else 1], dtype=np.float64, order="C")


@lru_cache(maxsize=64)
def free_positions(frames: int, fitted: int) -> Array:
    """Orthonormal positions that neither a common shift nor the first ``fitted`` parameters explain, (n, n-1-m)."""
    known = np.column_stack([np.ones(frames), motion_basis(frames, True)[:, :fitted]])
    return np.ascontiguousarray(np.linalg.svd(known.T)[2][known.shape[1] :].T)


@kernel
def coherent_power(re: Plane, im: Plane, omega: Array, position: Array, out: Plane) -> None:
    """Sum ``Re E_ij`` over all pairs for every frequency: products (c, p, f) to ``out`` (c, f)."""
    frames, count = position.shape[0], omega.shape[0]
    cosine, sine = np.empty((frames, count), dtype=np.float32), np.empty((frames, count), dtype=np.float32)
    turns(omega, position, cosine, sine)
    c, d = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    out[:] = np.float32(0.0)
    p = 0
    for i in range(frames):
        for j in range(i + 1, frames):
            relative_turn(cosine, sine, i, j, c, d)
            for k in range(re.shape[0]):
                _add_real(re[k, p], im[k, p], c, d, out[k])
            p += 1


@kernel
def _add_real(re: Plane, im: Plane, c: Plane, d: Plane, out: Plane) -> None:
    for f in range(out.shape[0]):
        out[f] += re[f] * c[f] - im[f] * d[f]
