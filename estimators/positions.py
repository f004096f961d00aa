r"""Score and information of the frames' positions, from pair products.

With ``E_ij = C_ij exp(i w (x_i - x_j))`` the log-likelihood is :math:`2 \sum_{f} w_q \sum_{i<j} \Re E_ij`, so that

.. math::
    \partial_i L = -2 \sum_f w_q \, \omega \sum_j \Im E_{ij}, \qquad
    -\partial_i \partial_j L = -2 \sum_f w_q \, \omega^2 \, \Re E_{ij} \; (i \neq j),

and rows of the information sum to zero.  Every motion model that is linear in its parameters (constant displacement,
acceleration, free positions) follows by a small matrix product.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]


@kernel
def position_scores(
    re: Plane,
    im: Plane,
    omega: Array,
    position: Array,
    score: Array,
    information: Array,
    coherence: Array,
) -> None:
    """Fill score (s, n), information (s, n, n) and coherence (s, p) = ``sum_f Re E`` of every strip.

    Pair products ``re``, ``im`` (s, p, f), weights included, in the order of ``pair_frames``; ``omega`` (f,)
    [rad/px]; ``position`` (n,) [px] at which to evaluate.
    """
    strips, _, count = re.shape
    frames = position.shape[0]
    cosine = np.empty((frames, count))
    sine = np.empty((frames, count))
    for k in range(frames):
        for f in range(count):
            cosine[k, f] = np.cos(omega[f] * position[k])
            sine[k, f] = np.sin(omega[f] * position[k])
    omega2 = omega * omega
    score[:] = 0.0
    information[:] = 0.0
    p = 0
    for i in range(frames):
        for j in range(i + 1, frames):
            for s in range(strips):
                a, b = re[s, p], im[s, p]
                slope = 0.0
                bend = 0.0
                sum_re = 0.0
                for f in range(count):
                    c = cosine[i, f] * cosine[j, f] + sine[i, f] * sine[j, f]
                    d = sine[i, f] * cosine[j, f] - cosine[i, f] * sine[j, f]
                    e_re = a[f] * c - b[f] * d
                    e_im = a[f] * d + b[f] * c
                    sum_re += e_re
                    slope -= omega[f] * e_im
                    bend += omega2[f] * e_re
                coherence[s, p] = sum_re
                score[s, i] += 2.0 * slope
                score[s, j] -= 2.0 * slope
                information[s, i, j] -= 2.0 * bend
                information[s, j, i] -= 2.0 * bend
                information[s, i, i] += 2.0 * bend
                information[s, j, j] += 2.0 * bend
            p += 1


def centred_times(frames: int) -> Array:
    """Frame times from the middle of the window [periods], shape (n,)."""
    return np.arange(frames, dtype=np.float64) - 0.5 * (frames - 1)


def motion_basis(frames: int, accelerated: bool) -> Array:
    """Positions per parameter, shape (n, 1 or 2): displacement per frame, and its change per frame."""
    t = centred_times(frames)
    basis = np.stack([t, 0.5 * (t**2 - np.mean(t**2))], axis=1)
    return np.asarray(basis[:, : 2 if accelerated else 1], dtype=np.float64)


@kernel
def coherent_power(re: Plane, im: Plane, omega: Array, position: Array, out: Array) -> None:
    """Sum ``Re E_ij`` over all pairs for every frequency: products (c, p, f) to ``out`` (c, f)."""
    frames, count = position.shape[0], omega.shape[0]
    cosine, sine = np.empty((frames, count)), np.empty((frames, count))
    for k in range(frames):
        for f in range(count):
            cosine[k, f] = np.cos(omega[f] * position[k])
            sine[k, f] = np.sin(omega[f] * position[k])
    out[:] = 0.0
    for c in range(re.shape[0]):
        p = 0
        for i in range(frames):
            for j in range(i + 1, frames):
                for f in range(count):
                    turn_re = cosine[i, f] * cosine[j, f] + sine[i, f] * sine[j, f]
                    turn_im = sine[i, f] * cosine[j, f] - cosine[i, f] * sine[j, f]
                    out[c, f] += re[c, p, f] * turn_re - im[c, p, f] * turn_im
                p += 1
