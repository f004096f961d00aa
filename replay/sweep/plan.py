"""What a sweep has to do: every recording with every combination of settings, each with a name of its own."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.strict_toml import parse, read_text

MAX_JOBS = 100_000


@dataclass(frozen=True)
class Job:
    """One replay: a recording, changed settings, and what they are combined with.

    ``key`` names the job by what it does, so that a sweep that is taken up again knows what is done.
    """

    key: str
    log: str
    params: tuple[tuple[str, str], ...]
    config: str | None
    without: tuple[str, ...]
    estimator: str
    mapping: str | None = None


def plan(
    logs: Sequence[Path],
    grid: Mapping[str, Sequence[str]],
    *,
    config_text: str | None = None,
    without: Sequence[str] = (),
    estimator: str = "corridor",
    mapping: Path | None = None,
) -> list[Job]:
    """All jobs, recordings slowest.

    Raises
    ------
    ConfigError
        No recording, more than a hundred thousand replays, or a mapping that cannot be read.
    """
    if not logs:
        raise ConfigError("sweep needs a flight or more, got none: axialnav sweep LOGS... [--param NAME=V1,V2,...]")
    combinations = list(itertools.product(*([(name, value) for value in values] for name, values in grid.items())))
    if len(combinations) * len(logs) > MAX_JOBS:
        raise ConfigError(
            f"{len(logs)} flights times {len(combinations)} settings are {len(logs) * len(combinations)} replays, "
            f"the limit is {MAX_JOBS}; sweep fewer values at once"
        )
    mapped = [] if mapping is None else [parse(read_text(mapping, "mapping"), where=str(mapping))]
    place = None if mapping is None else str(mapping.resolve())
    jobs = []
    for log in dict.fromkeys(str(path.resolve()) for path in logs):
        for params in combinations:
            what = [log, list(params), config_text, list(without), estimator, *mapped]
            key = hashlib.sha256(json.dumps(what, default=str).encode()).hexdigest()[:16]
            jobs.append(Job(key, log, tuple(params), config_text, tuple(without), estimator, place))
    return jobs


def parse_grid(texts: Sequence[str]) -> dict[str, list[str]]:
    """Values of ``NAME=V1,V2,...`` by name; commas inside brackets and quotes do not separate.

    Raises
    ------
    ConfigError
        Not of that form, or a name or a value given twice.
    """
    grid: dict[str, list[str]] = {}
    for text in texts:
        name, equals, rest = (part.strip() for part in text.partition("="))
        values = [value.strip() for value in _split(rest)]
        if not (name and equals and all(values)):
            raise ConfigError(f"--param must be NAME=V1,V2,... like uwb.sigma_m=0.1,0.2, got {text!r}")
        if name in grid:
            raise ConfigError(f"--param names {name} twice; give all its values at once")
        if len(set(values)) < len(values):
            raise ConfigError(f"--param {name} lists a value twice: {rest}")
        grid[name] = values
    return grid


def _split(text: str) -> list[str]:
    parts, depth, quoted = [""], 0, False
    for letter in text:
        quoted ^= letter == '"'
        depth += (letter in "[{") - (letter in "]}")
        if letter == "," and depth == 0 and not quoted:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
