"""The paper's composite picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


def composite_mean(frames: Sequence[ArrayLike] | NDArray[np.generic]) -> NDArray[np.float32]:
    r"""Mean of neighbouring frames.

    .. math:: I_{acc}(x, y) = \frac{1}{N} \sum_{i=1}^{N} I(x, y, t_i)

    (the paper's equation 10). A wall that moves by ``d`` px per frame leaves the transfer
    :math:`\mathrm{sinc}(f d t_e / T) \, D_N(f d)` with the Dirichlet kernel :math:`D_N`: dark lines at multiples of
    1 / (N d), bright ridges at multiples of 1 / d. Its apparent length is therefore ``N d``, not the ``d t_e / T`` of
    one exposure.

    Known failure: the mean of the frames in reverse is the same picture, so that the sign is lost; whether ridges or
    dark lines are read makes a factor N; noise falls with the root of N, but what stands still in the camera does not;
    a dropped frame makes another comb, which looks much like a faster wall.

    Parameters
    ----------
    frames
        N pictures of one shape (h, w).

    Returns
    -------
    ndarray, shape (h, w)
        Mean grey value [DN].

    Raises
    ------
    ValueError
        If there is no frame or their shapes differ.

    References
    ----------
    .. [1] Drones 2024, 8(7), 306, equation 10.
    """
    pictures = [np.asarray(frame) for frame in frames]
    shapes = {picture.shape for picture in pictures}
    if len(shapes) != 1 or pictures[0].ndim != 2:
        raise ValueError(f"a composite needs grey frames of one shape, got {sorted(shapes)}; pass (N, h, w)")
    return np.asarray(np.mean(pictures, axis=0, dtype=np.float32))
