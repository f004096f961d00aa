"""Latency of one stage, counted in buckets: constant memory, any number of samples, read from any thread."""

from __future__ import annotations

import itertools
import math
from typing import Any

PER_OCTAVE = 16
LOWEST_S = 1e-6
BUCKETS = 384  # 1 us .. 17 s


class Latency:
    """Histogram with sixteen buckets per doubling, so that a quantile is right within 4.5 %."""

    def __init__(self) -> None:
        self._counts = [0] * BUCKETS
        self.count = 0
        self.greatest_s = 0.0

    def add(self, seconds: float) -> None:
        """Count one sample [s]; negative ones count as zero."""
        octaves = math.log2(seconds / LOWEST_S) if seconds > LOWEST_S else 0.0
        self._counts[min(int(octaves * PER_OCTAVE), BUCKETS - 1)] += 1
        self.count += 1
        self.greatest_s = max(self.greatest_s, seconds)

    def quantile_s(self, share: float) -> float | None:
        """Upper edge of the bucket that holds the quantile [s]; None without samples."""
        if not self.count:
            return None
        wanted = math.ceil(share * self.count)
        bucket = next(k for k, seen in enumerate(itertools.accumulate(self._counts)) if seen >= wanted)
        return min(float(LOWEST_S * 2.0 ** ((bucket + 1) / PER_OCTAVE)), self.greatest_s)

    def summary(self) -> dict[str, Any]:
        """Count, median, 99th percentile and maximum [ms]."""
        p50, p99 = self.quantile_s(0.5), self.quantile_s(0.99)
        return {
            "count": self.count,
            "p50_ms": None if p50 is None else round(p50 * 1e3, 3),
            "p99_ms": None if p99 is None else round(p99 * 1e3, 3),
            "max_ms": round(self.greatest_s * 1e3, 3),
        }
