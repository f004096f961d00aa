"""Where the numbers come from: recording, software, digest."""

from __future__ import annotations

import hashlib
import platform
from importlib import metadata

import numpy as np

from axialnav.replay.inputs import combined
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

LIBRARIES = ("axialnav", "numpy", "scipy", "numba")


def build(run: Run) -> Section:
    """Facts as name, value and explanation; what the reader refused as a table."""
    info = run.flight.info
    timing = run.metrics["timing"]
    replayed = f"{timing['flight_s']:.1f} s of flight in {timing['wall_s']:.2f} s"
    facts = [
        ("flight", run.flight.name, ""),
        *((key, info[key], "") for key in ("source", "licence", "note") if info.get(key)),
        (
            "estimator",
            run.metrics["estimator"],
            "corridor: all states; axial: the autopilot's attitude and four states",
        ),
        ("digest of fused.csv", run.metrics["digest"], "over every number of fused.csv: equal inputs, equal digest"),
        ("SHA-256 of the readings", _readings_digest(run), "over stamps and values of all sensors as they were read"),
        *_inputs(run),
        ("SHA-256 of config.toml", hashlib.sha256(run.config.to_toml().encode()).hexdigest(), "all settings, resolved"),
        ("software", ", ".join(f"{name} {_version(name)}" for name in LIBRARIES), ""),
        ("machine", f"Python {platform.python_version()}, {platform.system()} {platform.machine()}", ""),
        ("replay", replayed, "recorded time, and time that the replay took, reading excluded"),
    ]
    values = {"facts": facts, "inputs": run.flight.inputs, "drops": run.flight.drops}
    return Section("Provenance", template="provenance.html.j2", values=values)


def _inputs(run: Run) -> list[tuple[str, str, str]]:
    files = run.flight.inputs
    return [("SHA-256 of the input files", combined(files), "over the paths and hashes below")] if files else []


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed as a package"


def _readings_digest(run: Run) -> str:
    """Digest over stamps and values of all tables as read, in the order of their names."""
    total = hashlib.sha256()
    for name in sorted(run.flight.tables):
        table = run.flight.tables[name]
        total.update(name.encode())
        total.update(np.ascontiguousarray(table.t_ns, dtype="<i8").tobytes())
        for key in sorted(table.columns):
            column = np.asarray(table.columns[key])
            total.update(key.encode())
            total.update("\n".join(column.tolist()).encode() if column.dtype.kind in "UO" else column.tobytes())
    return total.hexdigest()
