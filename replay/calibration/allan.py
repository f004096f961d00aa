r"""Noise densities of an inertial unit from a recording at rest.

The overlapping Allan deviation (IEEE Std 952-1997, annex C) of each axis is fitted with

.. math:: \sigma^2(\tau) = N^2 / \tau + \frac{2 \ln 2}{\pi} B^2 + K^2 \tau / 3

N is the white noise density and K that of the bias' walk, in the convention of Kalibr: N is what the -1/2 slope reads
at 1 s, K what the +1/2 slope reads at 3 s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import FlightError
from axialnav.models.rig import Imu
from axialnav.replay.flight import Flight

Array = NDArray[np.float64]
MIN_LENGTH_S = 60.0
CLUSTERS = 9  # a tau is used while the recording holds that many of it
POINTS = 40
GAP = 1.5
STILL_RATE_RAD_S, STILL_FORCE_M_S2 = 0.03, 0.3
FLICKER = 2.0 * np.log(2.0) / np.pi
CLEAR = 2.0
SAFETY = 3.0


@dataclass(frozen=True)
class Density:
    """One quantity, worst of its three axes.

    Attributes
    ----------
    white, sigma_white
        Root density of the white noise and its standard error.
    walk, sigma_walk
        Root density of the walk, None where the recording is too short to show it.
    needed_s
        How long a recording has to be to show the walk; None where this one is long enough.
    taus_s, deviation
        The Allan deviation, (n,) and (n, 3).
    """

    white: float
    sigma_white: float
    walk: float | None
    sigma_walk: float | None
    needed_s: float | None
    taus_s: Array
    deviation: Array


@dataclass(frozen=True)
class Allan:
    """Densities of gyro [rad/s/sqrt(Hz)] and accelerometer [m/s^2/sqrt(Hz)], rate and length of what was used."""

    sensor: str
    rate_hz: float
    length_s: float
    recorded_s: float
    gyro: Density
    accel: Density


def overlapping_deviation(values: Array, rate_hz: float, clusters: NDArray[np.int64]) -> Array:
    """Overlapping Allan deviation of a rate signal for clusters of the given numbers of samples.

    values : (n, m) evenly sampled.  clusters : (k,).  Returns (k, m).
    """
    angle = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values - values.mean(axis=0), axis=0)]) / rate_hz
    result = np.empty((clusters.size, values.shape[1]))
    for row, m in enumerate(clusters.tolist()):
        second = angle[2 * m :] - 2.0 * angle[m:-m] + angle[: -2 * m]
        result[row] = np.sqrt(0.5 * np.mean(second**2, axis=0)) / (m / rate_hz)
    return result


def allan(flight: Flight) -> Allan:
    """Densities of the inertial unit of a recording at rest.

    Raises
    ------
    FlightError
        No inertial unit, too short, or the vehicle moved.
    """
    name = next(
        (n for n, s in flight.config.sensor.items() if isinstance(s, Imu) and len(flight.tables.get(n, ()))), None
    )
    if name is None:
        raise FlightError(f"{flight.name}: no IMU samples; allan needs a recording of an inertial unit at rest")
    spec = flight.config.sensor[name]
    assert isinstance(spec, Imu)
    table = flight.tables[name]
    t_s = (table.t_ns - table.t_ns[0]) * 1e-9
    start, stop = longest_stretch(t_s)
    length = float(t_s[stop - 1] - t_s[start])
    if length < MIN_LENGTH_S:
        raise FlightError(
            f"{flight.name}: {length:.1f} s of {name} without a gap are too short for an Allan deviation; "
            f"record at least {MIN_LENGTH_S:.0f} s at rest for the white noise, hours for the bias walk"
        )
    rate = (stop - 1 - start) / length
    signals = [np.asarray(table.columns[key], dtype=np.float64)[start:stop] for key in ("gyro_rad_s", "accel_m_s2")]
    _refuse_motion(flight.name, signals, rate)
    expected = (spec.gyro_bias_walk, spec.accel_bias_walk)
    gyro, accel = (_density(s, rate, length, walk) for s, walk in zip(signals, expected, strict=True))
    return Allan(name, rate, length, float(t_s[-1]), gyro, accel)


def longest_stretch(t_s: Array) -> tuple[int, int]:
    """First and one past the last sample of the longest stretch without a gap of 1.5 periods."""
    steps = np.diff(t_s)
    if steps.size == 0:
        return 0, t_s.size
    breaks = np.flatnonzero((steps > GAP * np.median(steps)) | (steps <= 0.0)) + 1
    edges = np.concatenate(([0], breaks, [t_s.size]))
    widest = int(np.argmax(np.diff(edges)))
    return int(edges[widest]), int(edges[widest + 1])


def _refuse_motion(flight: str, signals: list[Array], rate_hz: float) -> None:
    """Means over a second of something at rest hardly differ from their neighbours."""
    second = max(round(rate_hz), 1)
    for values, limit, unit in zip(signals, (STILL_RATE_RAD_S, STILL_FORCE_M_S2), ("rad/s", "m/s^2"), strict=True):
        whole = len(values) // second * second
        means = values[:whole].reshape(-1, second, 3).mean(axis=1)
        change = float(np.abs(np.diff(means, axis=0)).max(initial=0.0))
        if change > limit:
            raise FlightError(
                f"{flight}: the vehicle moves ({change:.3g} {unit} from one second to the next, limit {limit:g}); "
                f"allan needs a recording at rest"
            )


def _density(values: Array, rate_hz: float, length_s: float, expected_walk: float) -> Density:
    from scipy.optimize import nnls

    largest = int(len(values) / CLUSTERS)
    clusters = np.unique(np.geomspace(1, largest, POINTS).astype(np.int64))
    taus = clusters / rate_hz
    deviation = overlapping_deviation(values, rate_hz, clusters)
    error = 1.0 / np.sqrt(2.0 * (length_s / taus - 1.0))
    terms = np.stack([1.0 / taus, np.full(taus.size, FLICKER), taus / 3.0], axis=1)
    fits = []
    for axis in range(values.shape[1]):
        variance = deviation[:, axis] ** 2
        weight = 1.0 / (2.0 * error * variance)
        solution, _ = nnls(terms * weight[:, None], variance * weight)
        # neighbouring taus share data: each octave counts about once
        shared = POINTS / max(np.log2(largest), 1.0)
        covariance = np.linalg.pinv((terms * weight[:, None]).T @ (terms * weight[:, None])) * max(shared, 1.0)
        fits.append((solution, np.sqrt(np.diag(covariance))))
    worst = max(fits, key=lambda fit: float(fit[0][0]))
    white = float(np.sqrt(worst[0][0]))
    walk_fit = max(fits, key=lambda fit: float(fit[0][2]))
    clear = float(walk_fit[0][2]) > CLEAR * float(walk_fit[1][2])
    walk = float(np.sqrt(walk_fit[0][2])) if clear else None
    needed = None if clear else SAFETY * CLUSTERS * np.sqrt(3.0) * white / expected_walk
    return Density(
        white,
        float(worst[1][0]) / (2.0 * white),
        walk,
        float(walk_fit[1][2]) / (2.0 * walk) if walk else None,
        None if needed is None else float(max(needed, 2.0 * length_s)),
        taus,
        deviation,
    )


def summary(found: Allan) -> str:
    """Densities as continuous values and as the scatter of single samples."""
    lines = [
        f"imu        {found.sensor}   {found.rate_hz:.1f} Hz   used {found.length_s:.1f} of {found.recorded_s:.1f} s"
    ]
    units = (("gyro", found.gyro, "rad/s", "rad/s^2"), ("accelerometer", found.accel, "m/s^2", "m/s^3"))
    for name, density, unit, walk_unit in units:
        sample = density.white * np.sqrt(found.rate_hz)
        lines.append(
            f"{name:<14}white noise {density.white:.3e} +- {density.sigma_white:.1e} {unit}/sqrt(Hz) "
            f"(one sample: {sample:.3e} {unit})"
        )
        if density.walk is not None and density.sigma_walk is not None:
            lines.append(f"{'':<14}bias walk   {density.walk:.3e} +- {density.sigma_walk:.1e} {walk_unit}/sqrt(Hz)")
        else:
            hours = (density.needed_s or 0.0) / 3600.0
            lines.append(f"{'':<14}bias walk   NOT_EVALUATED: too short to show it; record about {hours:.1f} h at rest")
    return "\n".join(lines)


def imu_yaml(found: Allan) -> str:
    """The densities with the keys of Kalibr's imu.yaml, as in the sensor.yaml of a flight folder."""
    lines = ["# Found by axialnav allan; continuous-time densities, worst axis, not inflated."]
    for name, density in (("accelerometer", found.accel), ("gyroscope", found.gyro)):
        lines.append(f"{name}_noise_density: {density.white:.6e}")
        if density.walk is not None:
            lines.append(f"{name}_random_walk: {density.walk:.6e}")
    return "\n".join([*lines, f"update_rate: {found.rate_hz:.3f}", ""])
