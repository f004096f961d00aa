"""Every verb with every kind of file that is none: one line on stderr, the right exit code, nothing left behind."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from axialnav.replay import cli
from axialnav.replay.convert.convert import convert
from tests.replay.made_recordings import flown
from tests.replay.made_runs import make_run

LOG_VERBS: dict[str, list[str]] = {
    "doctor": ["doctor", "BAD"],
    "motion": ["motion", "BAD"],
    "replay": ["replay", "BAD", "--out", "OUT"],
    "tune": ["tune", "BAD", "--out", "OUT"],
    "tune held out": ["tune", "GOOD", "--hold-out", "BAD", "--out", "OUT"],
    "calibrate": ["calibrate", "BAD", "--out", "OUT"],
    "allan": ["allan", "BAD", "--out", "OUT"],
    "convert": ["convert", "BAD", "OUT"],
    "check": ["check", "BAD"],
    "compare": ["compare", "BAD", "BAD"],
}
SETTING_VERBS: dict[str, list[str]] = {
    "simulate": ["simulate", "BAD", "OUT"],
    "replay --config": ["replay", "GOOD", "--config", "BAD", "--out", "OUT"],
    "tune --config": ["tune", "GOOD", "--config", "BAD", "--out", "OUT"],
    "calibrate --config": ["calibrate", "GOOD", "--config", "BAD", "--out", "OUT"],
    "sweep --config": ["sweep", "GOOD", "--config", "BAD", "--out", "OUT"],
    "sweep --mapping": ["sweep", "GOOD", "--mapping", "BAD", "--out", "OUT"],
    "check --limits": ["check", "RUN", "--limits", "BAD"],
    "live": ["live", "--config", "BAD"],
    "camera": ["camera", "--config", "BAD"],
}


def cut(recording: str, share: float) -> Callable[[Path, Path], None]:
    def make(path: Path, material: Path) -> None:
        data = (material / recording).read_bytes()
        path.write_bytes(data[: int(share * len(data))])

    return make


def sparse(path: Path, _: Path) -> None:
    with path.open("wb") as file:
        os.truncate(file.fileno(), 2 << 30)


def noise(path: Path, _: Path) -> None:
    path.write_bytes(np.random.default_rng(11).bytes(100_000))


BAD: dict[str, Callable[[Path, Path], None]] = {
    "missing": lambda path, _: None,
    "empty": lambda path, _: path.write_bytes(b"") and None,
    "noise": noise,
    "text": lambda path, _: path.write_text("= once upon a time\n" * 50) and None,
    "2 GB of nothing": sparse,
    "picture": lambda path, _: path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(500)) and None,
    "empty folder": lambda path, _: path.mkdir(),
    "mcap, cut": cut("log.mcap", 0.004),
    "tlog, cut": cut("log.tlog", 0.0005),
    "ardupilot, cut": cut("log.bin", 0.001),
    "bag, cut": cut("log.bag", 0.002),
}


@pytest.fixture(scope="module")
def material(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A good flight, the same in other formats, and a run."""
    folder, flight = tmp_path_factory.mktemp("material"), flown(1, 3.0)
    for name in ("flight", "log.mcap", "log.tlog", "log.bin", "log.bag"):
        convert(flight, folder / name)
    make_run().write(folder / "run")
    return folder


def refused(words: list[str], bad: str, place: Path, material: Path, capsys: pytest.CaptureFixture[str]) -> int:
    path, out = place / "bad.log", place / "out"
    BAD[bad](path, material)
    named = {"BAD": str(path), "OUT": str(out), "GOOD": str(material / "flight"), "RUN": str(material / "run")}
    code = cli.main([named.get(word, word) for word in words])
    told = capsys.readouterr()
    assert told.err.count("\n") == 1, told.err
    assert told.err.endswith("\n")
    assert 40 < len(told.err) < 600 + len(str(path))
    assert "Traceback" not in told.err
    assert told.out == ""
    assert not out.exists()
    return code


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("verb", LOG_VERBS)
def test_what_is_no_recording_is_refused_in_one_line(
    verb: str, bad: str, tmp_path: Path, material: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert refused(LOG_VERBS[verb], bad, tmp_path, material, capsys) == 3


@pytest.mark.parametrize("bad", ["missing", "empty folder", "noise", "text", "2 GB of nothing"])
@pytest.mark.parametrize("verb", SETTING_VERBS)
def test_what_is_no_settings_file_is_a_usage_error(
    verb: str, bad: str, tmp_path: Path, material: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert refused(SETTING_VERBS[verb], bad, tmp_path, material, capsys) == 2


@pytest.mark.parametrize("bad", BAD)
def test_a_sweep_goes_on_and_names_what_it_could_not_read(
    bad: str, tmp_path: Path, material: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.log"
    BAD[bad](path, material)
    code = cli.main(["sweep", str(path), "--workers", "1", "--out", str(tmp_path / "out")])
    told = capsys.readouterr()
    assert (code, told.err) == (3, "")
    assert sum(line.startswith("failed") for line in told.out.splitlines()) == 1


@pytest.mark.parametrize("verb", ["doctor", "replay", "tune", "tune held out", "calibrate", "allan", "convert"])
def test_every_verb_that_reads_a_log_reads_it_by_the_mapping(
    verb: str, tmp_path: Path, material: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Told by what a mapping that asks for the impossible leads to."""
    mapping = tmp_path / "mapping.toml"
    mapping.write_text('[source.sonar0]\nfrom = ["RANGEFINDER"]\n', encoding="utf-8")
    log = str(material / "log.tlog")
    named = {"BAD": log, "GOOD": log, "OUT": str(tmp_path / "out")}
    code = cli.main([*(named.get(word, word) for word in LOG_VERBS[verb]), "--mapping", str(mapping)])
    assert code == 3
    assert "[source.sonar0] has no [sensor.sonar0]" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_sweep_reads_its_logs_by_the_mapping(
    tmp_path: Path, material: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mapping = tmp_path / "mapping.toml"
    words = ["sweep", str(material / "log.tlog"), "--workers", "1", "--out", str(tmp_path / "out")]
    for text, code in (("", 0), ('[source.sonar0]\nfrom = ["RANGEFINDER"]\n', 3)):
        mapping.write_text(text, encoding="utf-8")
        assert (
            cli.main([*words, "--mapping", str(mapping)]) == code
        )  # another mapping is another job: not taken as done
    assert "[source.sonar0] has no [sensor.sonar0]" in capsys.readouterr().out
