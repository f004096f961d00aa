"""The shutter: motion during the exposure, rolling readout and lamps that flicker."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.motion import Path

Array = NDArray[np.float64]
NODES, NODES_PER_PX = 12, 1.75  # enough for 1e-8 at one cycle per pixel
LANCZOS_LOBES = 3


def exposure_nodes(exposure: float, blur_px: float) -> tuple[Array, Array]:
    """Gauss-Legendre abscissae in [-exposure/2, exposure/2] and weights that sum to one, shape (nodes,) each.

    Their number grows with the blur, so that the exposure integral of every wave a wall can hold is exact to 1e-8.
    """
    nodes = NODES + math.ceil(NODES_PER_PX * blur_px)
    abscissae, weights = np.polynomial.legendre.leggauss(nodes)
    return 0.5 * exposure * abscissae, 0.5 * weights


def motion_transfer(
    path: Path, frame: int, exposure: float, frequencies: Array, origin_px: tuple[int, int]
) -> NDArray[np.complex128]:
    r"""What the motion during one exposure does to the rows' spectra.

    .. math:: H_s(f) = \sum_j w_j \, h(y_j + s) \, e^{-2 \pi i f x_j}

    with :math:`(x_j, y_j)` the picture's position at node :math:`j` less ``origin_px`` and :math:`h` the Lanczos
    kernel that interpolates between rows; for constant motion along the rows it is the textbook
    :math:`\mathrm{sinc}(f \ell) e^{-2 \pi i f x}`.

    Parameters
    ----------
    path
        The camera's path.
    frame
        Number of the frame.
    exposure
        Exposure time in frame periods [-].
    frequencies
        Horizontal frequencies [cycles/px], shape (m,).
    origin_px
        Whole pixels already taken out of the position, (x, y).

    Returns
    -------
    ndarray, shape (2 S + 1, m)
        Transfer from row ``v + s - S`` to row ``v``; S = 0 when the picture does not move vertically.
    """
    ends = np.array([-0.5, 0.5]) * exposure
    blur = max(float(np.ptp(c)) for c in path.position_px(frame, ends))
    delay, weight = exposure_nodes(exposure, blur)
    x, y = path.position_px(frame, delay)
    x, y = x - origin_px[0], y - origin_px[1]
    phase = np.exp(-2j * np.pi * np.outer(x, frequencies))
    reach = 0 if not y.any() else LANCZOS_LOBES + math.ceil(np.abs(y).max())
    taps = lanczos(y[None, :] + np.arange(-reach, reach + 1)[:, None])
    taps /= taps.sum(axis=0)
    return np.asarray((taps * weight) @ phase)


def lanczos(x: Array) -> Array:
    """Lanczos interpolation kernel with three lobes at ``x`` [samples], same shape."""
    return np.where(np.abs(x) < LANCZOS_LOBES, np.sinc(x) * np.sinc(x / LANCZOS_LOBES), 0.0)


def row_delays(rows: int, readout: float) -> Array:
    """Delay of every row against the middle row of a rolling shutter [periods], shape (rows,)."""
    return ((np.arange(rows) + 0.5) / rows - 0.5) * readout


def flicker_gain(time: Array, depth: float, cycles: float, phase: float, exposure: float) -> Array:
    """Brightness of a flickering lamp averaged over an exposure, mean 1, same shape as ``time``.

    ``1 + depth sin(2 pi cycles t + phase)`` integrates to the same with ``depth sinc(cycles exposure)``: an exposure
    of a whole lamp period sees no flicker.

    Parameters
    ----------
    time
        Middle of the exposure [periods].
    depth
        Relative amplitude [-].
    cycles
        Lamp cycles per frame period [-].
    phase
        Of the lamp at time 0 [rad].
    exposure
        Exposure time [periods].
    """
    return 1.0 + depth * np.sinc(cycles * exposure) * np.sin(2.0 * np.pi * cycles * time + phase)
