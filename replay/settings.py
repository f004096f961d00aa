"""Which settings of a run differ from what the defaults and the flight itself would give."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from axialnav.fusion.config import Config

ABSENT = "-"


def changed_settings(config: Config, flight_config: Config) -> list[tuple[str, str, str]]:
    """Dotted name, default and value of each setting that was changed for this run, in configuration order."""
    default = dict(_leaves(Config().with_defaults_from(flight_config).to_dict(), ""))
    chosen = dict(_leaves(config.to_dict(), ""))
    names = [*chosen, *(name for name in default if name not in chosen)]
    pairs = ((name, default.get(name, ABSENT), chosen.get(name, ABSENT)) for name in names)
    return [(name, _text(before), _text(after)) for name, before, after in pairs if before != after]


def _leaves(data: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in data.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        elif value is not None:
            yield f"{prefix}{key}", list(value) if isinstance(value, list | tuple) else value


def _text(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
