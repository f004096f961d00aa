"""What a person waits for with a log of ten minutes, and how sweeps use a second core.

``python -m tests.bench.bench_tools [LOGS]``; LOGS is the number of recordings in the sweep, 24 if not given.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from axialnav.replay.flight_writer import write_flight
from tests.bench.markdown import machine, table
from tests.bench.timing import median_of_processes
from tests.replay.made_recordings import flown

MINUTES, SEEDS, LOGS, REPEATS = 10.0, (1, 2, 3, 4), 24, 3
REPORT_MB, REPLAY_S, DOCTOR_S, EFFICIENCY = 8.0, 5.0, 2.0, 0.9
TIME_HEAD = ("verb", "wall [s]", "processor [s]", "asked", "verdict")
SWEEP_HEAD = ("recordings", "workers", "wall [s]", "a recording [s]", "efficiency", "asked", "verdict")


def make_logs(folder: Path, minutes: float = MINUTES, seeds: Sequence[int] = SEEDS) -> list[Path]:
    """Flight folders at 200 Hz with image motion, range finder and UWB, and the truth."""
    return [write_flight(flown(seed, 60.0 * minutes), folder / f"log{seed}") for seed in seeds]


def time_rows(log: Path, folder: Path, repeats: int = REPEATS) -> Iterator[list[str]]:
    """Replay and doctor as processes, from start to end, with everything compiled; and the size of the report."""
    run = folder / "run"
    replay = ["-m", "axialnav", "replay", str(log), "--out", str(run)]
    median_of_processes(1, replay)
    for name, words, limit in (
        ("replay", replay, REPLAY_S),
        ("doctor", ["-m", "axialnav", "doctor", str(log)], DOCTOR_S),
    ):
        spent = median_of_processes(repeats, words)
        asked = f"<= {limit:g} s"
        yield [name, f"{spent.wall_s:.2f}", f"{spent.cpu_s:.2f}", asked, "ok" if spent.wall_s <= limit else "SHORT"]
    size = (run / "report.html").stat().st_size / 1e6
    yield ["report.html", f"{size:.1f} MB", "", f"<= {REPORT_MB:g} MB", "ok" if size <= REPORT_MB else "SHORT"]


def sweep_rows(logs: Sequence[Path], folder: Path, count: int = LOGS) -> Iterator[list[str]]:
    """The same sweep with one worker and with two; start and end of the processes count."""
    copies = []
    for k in range(count):
        copies.append(folder / f"copy{k:03d}")
        shutil.copytree(logs[k % len(logs)], copies[-1])
    walls = []
    for workers in (1, 2):
        out = folder / f"sweep{workers}"
        words = ["-m", "axialnav", "sweep", *map(str, copies), "--workers", str(workers), "--out", str(out)]
        walls.append(median_of_processes(1, words).wall_s)
        share = walls[0] / (workers * walls[-1])
        asked = f">= {EFFICIENCY:.0%}" if workers > 1 else ""
        verdict = ("ok" if share >= EFFICIENCY else "SHORT") if workers > 1 else ""
        each = walls[-1] / count
        yield [str(count), str(workers), f"{walls[-1]:.1f}", f"{each:.2f}", f"{share:.0%}", asked, verdict]


def main(count: int = LOGS) -> None:
    """Print both tables."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        logs = make_logs(folder)
        sys.stdout.write(f"{machine()}; logs of {MINUTES:g} minutes at 200 Hz\n\n")
        sys.stdout.write(table(TIME_HEAD, time_rows(logs[0], folder)) + "\n\n")
        sys.stdout.write(table(SWEEP_HEAD, sweep_rows(logs, folder, count)) + "\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
