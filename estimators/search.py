"""The likelihood of every displacement at once, by inverse transforms of the lag sums."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectrum import LAST_FREQUENCY, Band
from axialnav.estimators.texture import matched_weight, sharp_family, texture_power
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Index = NDArray[np.int64]
STEP_PX = 0.25
SOFTENING = 3.0  # windows and texture that is not Gaussian make the likelihood over-confident by about this factor
NEAR_PX = 1.0
RIVAL_PX = 8.0
TINY = 1e-12
NOISE_SHARE = 0.85  # above this share of the frequencies the fixed windows hold mostly noise
ENOUGH_INFORMATION, REACH_MARGIN, REACH_STEP = 0.98, 1.25, LAST_FREQUENCY / 12
LEAST_REACH = 0.5 * LAST_FREQUENCY  # noise and patterns of the pixels are seen above the texture
LEAST_ABOVE, MOST_ABOVE = -30.0, 50.0  # log-likelihoods beyond which a mass is none, and all
HANN_VARIANCE = 1.94  # of a sum over neighbouring bins, which a Hann window makes dependent


def search_step(frames: int) -> float:
    """Distance of the displacements to look at [px]: two frames tell them less sharply apart than more do."""
    return STEP_PX if frames > 2 else 2.0 * STEP_PX


@dataclass(frozen=True)
class Profiles:
    """Log-likelihoods over displacement, one row per band of the picture.

    Parameters
    ----------
    grid_px
        Displacements [px], shape (d,).
    gain
        Log-likelihood of every band, shape (b, d); differences matter.
    spread
        Standard deviation that ``gain`` would have if the frames had nothing in common, shape (b,).
    reach
        Frequency beyond which hardly anything tells of the motion [cycles/px].
    """

    grid_px: Array
    gain: Plane
    spread: Array
    reach: float = LAST_FREQUENCY

    @cached_property
    def everyone(self) -> Plane:
        """Sum over all bands, shape (d,)."""
        total = np.empty(self.gain.shape[1], dtype=np.float32)
        _sum_bands(self.gain, total)
        return total

    def sheared(self, shift_px: Array) -> Profiles:
        """The same with every band read ``shift_px`` further on (b,), to the nearest grid point."""
        steps = np.rint(shift_px / (self.grid_px[1] - self.grid_px[0])).astype(np.int64)
        place = np.clip(np.arange(self.gain.shape[1]) + steps[:, None], 0, self.gain.shape[1] - 1)
        return replace(self, gain=np.take_along_axis(self.gain, place, axis=1))

    def total(self, bands: NDArray[np.bool_]) -> Plane:
        """Sum over some bands, shape (d,)."""
        return self.everyone if bands.all() else np.asarray(bands.astype(np.float32) @ self.gain)

    def near(self, index: int, reach_px: float) -> slice:
        """Grid points within ``reach_px`` of a grid point."""
        steps = int(reach_px / float(self.grid_px[1] - self.grid_px[0]))
        return slice(max(0, index - steps), index + steps + 1)

    def highest(self, index: int, reach_px: float) -> tuple[Plane, Plane]:
        """Highest likelihood of every band anywhere and within ``reach_px`` of a grid point, shapes (b,).

        The latter is interpolated at the border.
        """
        anywhere, near = np.empty((2, len(self.gain)), dtype=np.float32)
        _highest(self.gain, index, reach_px / float(self.grid_px[1] - self.grid_px[0]), anywhere, near)
        return anywhere, near

    def peak_px(self, index: int, bands: NDArray[np.bool_]) -> float:
        """Displacement at the top of a parabola through the total at a grid point and its neighbours."""
        if not 0 < index < len(self.grid_px) - 1:
            return float(self.grid_px[index])
        left, middle, right = self.total(bands)[index - 1 : index + 2].tolist()
        bend = 2.0 * middle - left - right
        shift = 0.5 * (right - left) / bend if bend > 0.0 else 0.0
        step = float(self.grid_px[1] - self.grid_px[0])
        return float(self.grid_px[index]) + step * max(-0.5, min(0.5, shift))

    def significance(self, index: int, bands: NDArray[np.bool_]) -> float:
        """Height of the total at a grid point in standard deviations of unrelated frames."""
        spread = self.spread[bands]
        return float(self.total(bands)[index]) / math.sqrt(float(spread @ spread))

    def rivals(self, index: int, bands: NDArray[np.bool_]) -> tuple[float, float]:
        """What speaks for displacements other than that of a grid point.

        Posterior mass further than 1 px from it under the softened likelihood, and the highest total further than 8 px
        away over the total there [-].
        """
        near, apart = self.near(index, NEAR_PX), self.near(index, RIVAL_PX)
        return _rivals(self.total(bands), index, np.array([near.start, near.stop, apart.start, apart.stop]))


@kernel
def _sum_bands(gain: Plane, total: Plane) -> None:
    total[:] = np.float32(0.0)
    for b in range(gain.shape[0]):
        _add(gain[b], total)


@kernel
def _highest(gain: Plane, index: int, steps: float, anywhere: Plane, near: Plane) -> None:
    """Highest of every band (b, d): of all, and within so many steps of one, with the border interpolated."""
    whole = int(steps)
    share = np.float32(steps - whole)
    for b in range(gain.shape[0]):
        line = gain[b]
        first, last = max(index - whole, 0), min(index + whole, line.shape[0] - 1)
        top = line[index]
        for d in range(first, last + 1):
            top = max(top, line[d])
        if first > 0:
            top = max(top, line[first] + share * (line[first - 1] - line[first]))
        if last + 1 < line.shape[0]:
            top = max(top, line[last] + share * (line[last + 1] - line[last]))
        near[b], anywhere[b] = top, max(top, _peak(line))


@kernel
def _peak(line: Plane) -> np.float32:
    """Highest number of a line, eight at a time: that is four times as fast."""
    top, at = line[0], 0
    while at + 8 <= line.shape[0]:
        t = line[at : at + 8]
        top = max(top, max(max(max(t[0], t[1]), max(t[2], t[3])), max(max(t[4], t[5]), max(t[6], t[7]))))
        at += 8
    for d in range(at, line.shape[0]):
        top = max(top, line[d])
    return np.float32(top)


@kernel
def _rivals(total: Plane, index: int, edges: Index) -> tuple[float, float]:
    """See :meth:`Profiles.rivals`: what is near lies between the first two ``edges``, what is far beyond the others."""
    outside, inside, highest = 0.0, 0.0, np.float32(-np.inf)
    for d in range(total.shape[0]):
        above = (total[d] - total[index]) / SOFTENING
        if above > LEAST_ABOVE:
            mass = np.exp(min(above, MOST_ABOVE))
            if edges[0] <= d < edges[1]:
                inside += mass
            else:
                outside += mass
        if d < edges[2] or d >= edges[3]:
            highest = max(highest, total[d])
    share = highest / total[index] if total[index] > 0.0 and highest > -np.inf else 0.0
    return outside / (inside + outside), share


class LagTransform:
    """From pair products to the profiles of all bands; scratch of one size.

    A product of frames m periods apart turns m times as fast with the displacement: its frequency f is put in the
    place of m f, and one inverse transform of the sum over all lags gives the likelihood of all displacements.

    Parameters
    ----------
    bands
        Bands of the picture.
    band
        Frequencies in use.
    """

    def __init__(self, bands: int, band: Band) -> None:
        self.band, self.bands = band, bands
        self._spectrum, self._likelihood = np.empty((2, bands * round(band.length / STEP_PX)), dtype=np.float32)

    def profiles(self, re: Plane, im: Plane, order: Index, weight: Plane, grid_px: Array, spread: Array) -> Profiles:
        """Evaluate ``2 sum_m sum_f Re(C_m exp(-i w d m))`` on the grid of displacements.

        Parameters
        ----------
        re, im
            Sums of ``Y_i conj(Y_j)`` for the frames in slots i, j, shape (n, n, b * c, f): only those of an older frame
            i and a younger j are read.
        order
            Slots of the frames, oldest first.
        weight
            Matched weights, shape (c, f).
        grid_px
            Displacements [px], neighbouring multiples of ``STEP_PX`` or of a multiple of it, shape (d,).
        spread
            See :class:`Profiles`.
        """
        step = float(grid_px[1] - grid_px[0])
        length = round(self.band.length / step)
        spectrum, likelihood = (
            scratch[: self.bands * length].reshape(self.bands, length) for scratch in (self._spectrum, self._likelihood)
        )
        lag_spectrum(re, im, order, weight, self.band.first, spectrum)
        cv2.dft(spectrum, likelihood, flags=cv2.DFT_ROWS | cv2.DFT_INVERSE | cv2.DFT_REAL_OUTPUT)
        gain = np.empty((self.bands, len(grid_px)), dtype=np.float32)
        _cut_out(likelihood, round(float(grid_px[0]) / step), gain)
        return Profiles(grid_px, gain, spread)


@kernel
def lag_spectrum(re: Plane, im: Plane, order: Index, weight: Plane, first: int, spectrum: Plane) -> None:
    """Spectrum over displacement of every band's likelihood, (b, l), in the form that the inverse transform takes.

    Products (n, n, b * c, f) from bin ``first`` on, slots in use, weights (c, f).
    """
    frames, (classes, count) = order.shape[0], weight.shape
    sum_re, sum_im = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    spectrum[:] = np.float32(0.0)
    for b in range(spectrum.shape[0]):
        for lag in range(1, frames):
            sum_re[:] = np.float32(0.0)
            sum_im[:] = np.float32(0.0)
            for i in range(frames - lag):
                for c in range(classes):
                    _add_weighted(re[order[i], order[i + lag], b * classes + c], weight[c], sum_re)
                    _add_weighted(im[order[i], order[i + lag], b * classes + c], weight[c], sum_im)
            _put(sum_re, sum_im, first, lag, spectrum[b])


@kernel
def _add_weighted(values: Plane, weight: Plane, total: Plane) -> None:
    for f in range(total.shape[0]):
        total[f] += values[f] * weight[f]


@kernel
def _put(re: Plane, im: Plane, first: int, lag: int, line: Plane) -> None:
    """Add conjugate spectra at ``lag`` times their frequencies to (Re_0, Re_1, Im_1, Re_2, ...), round its end."""
    length = line.shape[0]
    place = lag * first % length
    for f in range(re.shape[0]):
        if 2 * place < length and place > 0:
            line[2 * place - 1] += re[f]
            line[2 * place] -= im[f]
        elif 2 * place > length:
            line[2 * (length - place) - 1] += re[f]
            line[2 * (length - place)] += im[f]
        else:  # the two numbers that have no imaginary part, and no mirror image
            line[max(2 * place - 1, 0)] += np.float32(2.0) * re[f]
        place += lag
        if place >= length:
            place -= length


@kernel
def _cut_out(circle: Plane, first: int, out: Plane) -> None:
    """Samples (b, d) of circular functions (b, l) from number ``first`` on, which may be negative."""
    length = circle.shape[1]
    for b in range(circle.shape[0]):
        start, done = first % length, 0
        while done < out.shape[1]:
            many = min(length - start, out.shape[1] - done)
            out[b, done : done + many] = circle[b, start : start + many]
            start, done = 0, done + many


def search_weights(power: Plane, order: Index, frames: int, rows: Array, band: Band) -> tuple[Plane, Array, float]:
    """How much every frequency counts in a search.

    Parameters
    ----------
    power
        Sums of ``|Y|^2`` over the rows, by slot, shape (n, b * c, f).
    order
        Slots in use.
    frames
        Number of frames in them.
    rows
        Rows of every band and class, shape (b, c).
    band
        Frequencies in use.

    Returns
    -------
    weight
        Matched weights of texture and white noise, the latter read off the finest class, shape (c, f).
    spread
        Standard deviation of the profile of frames that share nothing but their spectra, shape (b,).
    reach
        Frequency beyond which hardly anything tells of the motion, in steps of a twelfth of the band [cycles/px].  It
        has a margin, for finer rows than those of the search hold finer detail.
    """
    weight, spread = np.empty((rows.shape[1], band.count), dtype=np.float32), np.zeros(len(rows))
    family = sharp_family(band.first, band.count, band.length)
    last = _weigh(power, order, frames, rows, band.omega(), *family, weight, spread) + band.first
    steps = math.ceil(REACH_MARGIN * last / band.length / REACH_STEP)
    return weight, spread, min(max(steps * REACH_STEP, LEAST_REACH), LAST_FREQUENCY)


@kernel
def _weigh(
    power: Plane,
    order: Index,
    frames: int,
    rows: Array,
    omega: Array,
    shapes: Array,
    family: Array,
    starts: Index,
    weight: Plane,
    spread: Array,
) -> int:
    """See :func:`search_weights`; ``weight`` and ``spread`` (zeros) are filled, the last telling bin is returned."""
    (bands, classes), count = rows.shape, omega.shape[0]
    total, mean = np.zeros((bands * classes, count), dtype=np.float32), np.zeros((classes, count))
    for k in range(order.shape[0]):
        for g in range(bands * classes):
            _add(power[order[k], g], total[g])
    for g in range(bands * classes):
        _add(total[g], mean[g % classes])
    looks = np.zeros(classes)
    for g in range(bands * classes):
        looks[g % classes] += frames * rows[g // classes, g % classes]
    for c in range(classes):
        mean[c] /= looks[c]
    noise = np.full(count, np.mean(mean[classes - 1, int(NOISE_SHARE * count) :]) + TINY)
    texture, information = np.empty(count), np.zeros(count)
    for c in range(classes):
        texture_power(mean[c], noise, looks[c], shapes, family, starts, texture)
        matched_weight(texture, noise, frames, 1.0, weight[c])
        for f in range(count):
            information[f] += looks[c] * weight[c, f] * texture[f] * omega[f] ** 2
        for b in range(bands):
            spread[b] += _squares(total[b * classes + c], weight[c]) / rows[b, c]
    for b in range(bands):
        spread[b] = np.sqrt(HANN_VARIANCE * (frames - 1) / frames * spread[b])
    return _enough(information)


@kernel
def _add(line: Plane, total: Plane) -> None:
    for f in range(total.shape[0]):
        total[f] += line[f]


@kernel
def _squares(power: Plane, weight: Plane) -> float:
    """Sum of the squares of weighted power (f,)."""
    total = 0.0
    for f in range(power.shape[0]):
        value = np.float64(power[f] * weight[f])
        total += value * value
    return total


@kernel
def _enough(information: Array) -> int:
    """Number of frequencies after which almost all information (f,) is in; it is summed up in place."""
    for f in range(1, information.shape[0]):
        information[f] += information[f - 1]
    return int(np.searchsorted(information, ENOUGH_INFORMATION * information[-1]))
