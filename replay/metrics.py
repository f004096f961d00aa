"""Scores of a run: the dictionary that becomes ``metrics.json``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.outcome import Health, InnovationLog, Track
from axialnav.replay.axial import AxialFrame, along, axial_frame, sigma_along
from axialnav.replay.reference import Matched, match
from axialnav.replay.sensor_metrics import sensor_metrics
from axialnav.replay.series import chi_square_mean_band, effective_samples_of_squares
from axialnav.replay.speed_metrics import NO_SPEED, SPEED_KEYS, speed_metrics

if TYPE_CHECKING:
    from axialnav.replay.flight import Flight

Array = NDArray[np.float64]
AXIAL_KEYS = ("rmse", "mean_error", "max_abs_error", "min_abs_error", "mean_sigma", "in_3_sigma")


def score(track: Track, log: InnovationLog, flight: Flight, config: Config) -> dict[str, Any]:
    """Everything in ``metrics.json`` that does not depend on the clock on the wall.

    Values that could not be evaluated are None, never 0.  ``reference.available`` counts the estimates inside the
    scoring window (for GPS: its samples there), ``reference.used`` those that had a reference.

    Beside the promised keys: ``reference.kind`` (truth, gps, none), ``alignment`` (none or rigid),
    ``nees_velocity_band`` and ``nees_velocity_samples`` (see :func:`nees`), the keys of
    :func:`~axialnav.replay.speed_metrics.speed_metrics` for flights that only have GPS, ``resets``, ``drops`` (what the
    reader refused, by sensor and reason) and ``health`` (share of the flight under each condition that is not good).

    Parameters
    ----------
    track, log
        What the filter said.
    flight
        Gives truth or GPS, the scoring window and the count of readings; nothing of it is changed.
    config
        As replayed.  Without ``initial`` the filter could not know the truth's frame: scored after a rigid alignment.
    """
    matched = _matched(track, flight, config)
    speed = NO_SPEED
    if flight.truth is None and flight.gps is not None:
        speed = speed_metrics(track, flight.gps, flight.evaluation)
    aligned = matched is not None and config.initial is None
    return {
        "reference": _reference(matched, flight, speed),
        "alignment": None if matched is None else ("rigid" if aligned else "none"),
        **_truth_scores(matched, config),
        **{key: speed[key] for key in SPEED_KEYS},
        "sensors": sensor_metrics(track, log, flight.tables, config),
        "resets": int(track.resets[-1]) if track.resets.size else 0,
        "drops": [{"sensor": d.sensor, "reason": d.reason, "count": d.count} for d in flight.drops],
        **_health(track),
    }


def _matched(track: Track, flight: Flight, config: Config) -> Matched | None:
    if flight.truth is None:
        return None
    return match(track, flight.truth, flight.evaluation, align=config.initial is None)


def _reference(matched: Matched | None, flight: Flight, speed: dict[str, Any]) -> dict[str, Any]:
    if matched is not None:
        return {"used": int(matched.row.size), "available": matched.available, "kind": "truth"}
    if flight.gps is not None:
        return {"used": speed["used"], "available": speed["available"], "kind": "gps"}
    return {"used": 0, "available": 0, "kind": "none"}


def _truth_scores(matched: Matched | None, config: Config) -> dict[str, Any]:
    """Axial, per-axis, consistency and per-section scores, all None without truth."""
    result: dict[str, Any] = {
        "axial_velocity_m_s": dict.fromkeys(AXIAL_KEYS),
        "velocity_rmse_m_s": None,
        "position_rmse_m": None,
        "position_rmse_3d_m": None,
        **dict.fromkeys(("nees_velocity", "nees_velocity_band", "nees_velocity_samples")),
        "sections": {},
    }
    if matched is None or matched.row.size == 0:
        return result
    position_error = matched.position_m - matched.truth_position_m
    result["position_rmse_m"] = _rms(position_error).tolist()
    result["position_rmse_3d_m"] = float(np.sqrt((position_error**2).sum(axis=1).mean()))
    has_velocity = np.isfinite(matched.truth_velocity_m_s).all(axis=1)
    if has_velocity.any():
        error = (matched.velocity_m_s - matched.truth_velocity_m_s)[has_velocity]
        covariance = matched.velocity_covariance[has_velocity]
        frame = axial_frame(config.corridor, matched.truth_position_m[has_velocity])
        result |= {"velocity_rmse_m_s": _rms(error).tolist(), **nees(error, covariance)}
        result |= axial_scores(error, covariance, frame)
    return result


def axial_scores(error: Array, covariance: Array, frame: AxialFrame) -> dict[str, Any]:
    """Scores of the velocity along the axis of the section the truth is in, overall and per section.

    error : (n, 3) estimate minus truth [m/s].  covariance : (n, 3, 3).  frame : of the true positions.
    ``in_3_sigma`` is a share (0.997 for honest Gaussian errors).
    """
    component, sigma = along(frame.axis, error), sigma_along(frame.axis, covariance)
    sections: dict[str, Any] = {}
    for index, name in enumerate(frame.names):
        here = frame.section == index
        sections[name] = _axial(component[here], sigma[here])
    return {"axial_velocity_m_s": _axial(component, sigma), "sections": sections}


def _axial(error: Array, sigma: Array) -> dict[str, float | None]:
    if error.size == 0:
        return dict.fromkeys(AXIAL_KEYS)
    size = np.abs(error)
    values = (
        np.sqrt((error**2).mean()),
        error.mean(),
        size.max(),
        size.min(),
        sigma.mean(),
        (size <= 3 * sigma).mean(),
    )
    return {key: float(value) for key, value in zip(AXIAL_KEYS, values, strict=True)}


def nees(error: Array, covariance: Array) -> dict[str, Any]:
    """Mean normalised estimation error squared of velocity, with the band an honest filter stays in.

    ``nees_velocity`` is the mean of ``e^T P^-1 e`` (3 expected).  Errors of neighbouring samples are nearly the same,
    so the band ``nees_velocity_band`` (95 %) is that of a mean over ``nees_velocity_samples`` independent draws of
    chi-square with 3 degrees of freedom; that number comes from the autocorrelation of the errors themselves
    (:func:`~axialnav.replay.series.effective_samples_of_squares`).

    error : (n, 3).  covariance : (n, 3, 3).  None where a covariance is not positive definite.
    """
    empty = dict.fromkeys(("nees_velocity", "nees_velocity_band", "nees_velocity_samples"))
    try:
        root = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return {**empty}
    whitened = np.linalg.solve(root, error[:, :, None])[:, :, 0]
    samples = effective_samples_of_squares(whitened)
    return {
        "nees_velocity": float((whitened**2).sum(axis=1).mean()),
        "nees_velocity_band": list(chi_square_mean_band(3, samples)),
        "nees_velocity_samples": samples,
    }


def _rms(error: Array) -> Array:
    root: Array = np.sqrt((error**2).mean(axis=0))
    return root


def _health(track: Track) -> dict[str, Any]:
    """Share of the track under each condition that is not good, by the name of the flag."""
    flags = track.flags
    shares = {flag.name: float(((flags & int(flag)) != 0).mean()) if flags.size else 0.0 for flag in Health if flag}
    return {"health": {str(name).lower(): share for name, share in shares.items() if share > 0.0}}
