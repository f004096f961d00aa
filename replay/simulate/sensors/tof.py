"""Single-beam range finders on the side and below."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.flight import SensorTable
from axialnav.replay.simulate.rays import cast
from axialnav.replay.simulate.streams import stamps
from axialnav.replay.simulate.vehicle import Motion
from axialnav.replay.simulate.world import TREAD_M, World

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TofSheet:
    """Data sheet of a laser range finder.

    Attributes
    ----------
    rate_hz
        Readings per second.
    range_min_m, range_max_m
        Outside of these it gives nothing.
    sigma_m
        White noise.
    step_m
        Quantisation.
    min_cosine
        Beams that graze more than this are not returned [-].
    miss_share, spike_share
        Of the readings, with the faults ``tof_misses`` and ``tof_spikes`` [-].
    """

    rate_hz: float = 50.0
    range_min_m: float = 0.15
    range_max_m: float = 8.0
    sigma_m: float = 0.010
    step_m: float = 0.001
    min_cosine: float = 0.35
    miss_share: float = 0.02
    spike_share: float = 0.01


def read_tof(
    sheet: TofSheet,
    world: World,
    motion: Motion,
    T_BS: NDArray[np.float64],
    faults: tuple[str, ...],
    rng: np.random.Generator,
) -> SensorTable:
    """Ranges along the sensor's z axis; what is not returned has no row.

    Parameters
    ----------
    sheet, world
        The sensor and what it may meet.
    motion
        Truth at the instants of measurement.
    T_BS
        Mounting, shape (4, 4).
    faults
        Names of a mission's faults.
    rng
        Draws noise, misses and spikes.
    """
    count = len(motion.t_s)
    origin = motion.position_m + motion.rotation_WB.apply(T_BS[:3, 3])
    beam = motion.rotation_WB.apply(T_BS[:3, 2])
    hits = cast(world, origin, beam)
    distance = hits.distance_m + _steps(
        world, hits.facet, origin + np.nan_to_num(hits.distance_m, posinf=0.0)[:, None] * beam
    )
    reading = distance + sheet.sigma_m * rng.normal(size=count)
    missed = rng.random(count) < (sheet.miss_share if "tof_misses" in faults else 0.0)
    spiked = rng.random(count) < (sheet.spike_share if "tof_spikes" in faults else 0.0)
    spike = rng.uniform(sheet.range_min_m, sheet.range_max_m, count)
    reading = np.where(spiked, spike, reading)
    reading = np.round(reading / sheet.step_m) * sheet.step_m
    with np.errstate(invalid="ignore"):
        given = (reading >= sheet.range_min_m) & (reading <= sheet.range_max_m) & ~missed
    given &= (hits.cosine >= sheet.min_cosine) | spiked
    return SensorTable(stamps(motion.t_s)[given], {"range_m": reading[given]})


def _steps(world: World, facet: NDArray[np.int64], points: Array) -> Array:
    """How much longer the beam runs to a tread than to the incline through the middle of the risers [m], shape (n,)."""
    extra = np.zeros(len(facet))
    for index, piece in enumerate(world.facets):
        here = facet == index
        if piece.riser_m and here.any():
            along = piece.corners[1] - piece.corners[0]
            run = np.linalg.norm(along[:2])
            x = (points[here, :2] - piece.corners[0, :2]) @ (along[:2] / run)
            treads = max(1, round(run / TREAD_M))
            within = np.mod(x / run * treads, 1.0)
            extra[here] = piece.riser_m * (within - 0.5)
    return extra
