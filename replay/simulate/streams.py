"""One random generator per purpose, so that what one sensor draws does not change what another reads."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

START_NS = 1_000_000_000


@dataclass(frozen=True)
class Streams:
    """Generators that follow from one seed and a name."""

    seed: int

    def of(self, name: str) -> np.random.Generator:
        """Generator for ``name``; equal seeds and names give equal numbers."""
        return np.random.default_rng([self.seed, zlib.crc32(name.encode())])


def stamps(t_s: np.typing.NDArray[np.float64]) -> np.typing.NDArray[np.int64]:
    """Seconds after the first inertial sample as stamps [ns]."""
    return START_NS + np.round(np.asarray(t_s) * 1e9).astype(np.int64)
