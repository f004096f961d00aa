"""Surveys in a left-handed frame: noticed by the inertial unit, mirrored for the filter, mirrored back for the user.

Anchors measured with the y axis on the wrong side fit every range, but turn the wrong way: yaw seen by the gyro and
yaw of the track have opposite signs, and the filter blames the accelerometer.  The strapdown needs a right-handed
frame, so such a survey is mirrored in y before the filter and the track afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config, Corridor, Initial, Section
from axialnav.fusion.events import Table
from axialnav.fusion.outcome import InnovationLog, Track
from axialnav.models.rig import Surface, Uwb, Vector3

Array = NDArray[np.float64]
MIRROR = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True, slots=True)
class MirroredTable:
    """A table of position fixes with y reversed."""

    t_ns: NDArray[np.int64]
    columns: Mapping[str, NDArray[np.generic]]


def _flip(v: Vector3) -> Vector3:
    return v[0], -v[1], v[2]


def mirror_config(config: Config) -> Config:
    """Copy with every world coordinate (anchors, surfaces, corridor, first state) mirrored in y."""
    corridor = config.corridor or Corridor()
    sections = tuple(
        msgspec.structs.replace(s, start=_flip(s.start), end=_flip(s.end))
        for s in corridor.section
        if isinstance(s, Section)
    )
    initial = config.initial
    if isinstance(initial, Initial):
        initial = msgspec.structs.replace(
            initial,
            position_m=_flip(initial.position_m),
            velocity_m_s=_flip(initial.velocity_m_s),
            yaw_rad=-initial.yaw_rad,
        )
    return msgspec.structs.replace(
        config,
        corridor=msgspec.structs.replace(corridor, axis=_flip(corridor.axis), section=sections),
        initial=initial,
        surface={name: _mirror_surface(s) for name, s in config.surface.items()},
        sensor={
            name: msgspec.structs.replace(s, anchors={k: _flip(a) for k, a in s.anchors.items()})
            if isinstance(s, Uwb)
            else s
            for name, s in config.sensor.items()
        },
    )


def _mirror_surface(surface: Surface) -> Surface:
    faces = tuple(
        msgspec.structs.replace(f, normal=_flip(f.normal), start=_flip(f.start), end=_flip(f.end)) for f in surface.face
    )
    return msgspec.structs.replace(surface, normal=_flip(surface.normal), face=faces)


def mirror_tables(tables: Mapping[str, Table]) -> dict[str, Table]:
    """Copy with position fixes mirrored in y; all other readings are the same in both frames."""
    out: dict[str, Table] = {}
    for name, table in tables.items():
        if "position_m" in table.columns:
            fixes = np.asarray(table.columns["position_m"], dtype=np.float64) * MIRROR
            out[name] = MirroredTable(table.t_ns, {**table.columns, "position_m": fixes})
        else:
            out[name] = table
    return out


def mirror_track(track: Track) -> Track:
    """Track in the user's left-handed frame; the attitude stays that of the right-handed one (it has no other)."""
    sign = np.outer(MIRROR, MIRROR)
    return replace(
        track,
        position_m=track.position_m * MIRROR,
        velocity_m_s=track.velocity_m_s * MIRROR,
        position_covariance=track.position_covariance * sign,
        velocity_covariance=track.velocity_covariance * sign,
    )


def is_undecided(config: Config) -> bool:
    """Whether a replay has to find the handedness: it may, and neither start nor heading is given."""
    surveyed = any(isinstance(s, Uwb) and name not in config.disabled for name, s in config.sensor.items())
    return config.handedness == "auto" and config.initial is None and surveyed


def log_likelihood(log: InnovationLog, used: NDArray[np.bool_] | None = None) -> float:
    """Bounded log-likelihood of the readings ``used`` (default: all that were predicted)."""
    used = log.dof > 0 if used is None else used
    nis = np.minimum(log.nis[used], log.gate[used])
    return float(-0.5 * (nis + np.nansum(np.log(log.variance[used]), axis=1)).sum())


def explains_better(mirrored: InnovationLog, plain: InnovationLog) -> float:
    """Log-likelihood of the mirrored run minus that of the plain one, over the readings that both predicted."""
    both = (mirrored.dof > 0) & (plain.dof > 0)
    return log_likelihood(mirrored, both) - log_likelihood(plain, both)
