"""Input files and their hashes: those that were read, as any other tool would hash them, in summary and report."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.inputs import combined, input_files
from axialnav.replay.run import replay
from axialnav.replay.sample_flights import sample_flight_path


@pytest.fixture(scope="module")
def sample() -> Flight:
    return load_flight(sample_flight_path())


def test_every_file_of_a_flight_folder_is_named_with_the_hash_of_its_content(sample: Flight) -> None:
    root = sample_flight_path()
    found = {one.path: one for one in sample.inputs}
    expected = [p for p in root.rglob("*") if p.is_file() and p.name != "LICENSE"]
    assert sorted(found) == sorted(p.relative_to(root).as_posix() for p in expected)
    for path in expected:
        one = found[path.relative_to(root).as_posix()]
        assert (one.bytes, one.sha256) == (path.stat().st_size, hashlib.sha256(path.read_bytes()).hexdigest())


def test_one_file_and_no_file(sample: Flight, tmp_path: Path) -> None:
    log = tmp_path / "log.bin"
    log.write_bytes(b"abc")
    (one,) = input_files(replace(sample, path=log))
    assert (one.path, one.bytes) == ("log.bin", 3)
    assert one.sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert input_files(replace(sample, path=tmp_path / "nowhere")) == ()


def test_many_pictures_are_one_entry_that_any_of_them_changes(sample: Flight, tmp_path: Path) -> None:
    pictures = tmp_path / "mav0" / "cam0" / "data"
    pictures.mkdir(parents=True)
    for k in range(30):
        (pictures / f"{k:02d}.png").write_bytes(bytes([k]))
    flight = replace(sample, path=tmp_path)
    (before,) = input_files(flight)
    assert (before.path, before.bytes) == ("mav0/cam0/data/ (30 files)", 30)
    (pictures / "17.png").write_bytes(b"x")
    (after,) = input_files(flight)
    assert after.sha256 != before.sha256
    assert combined([after]) != combined([before])


def test_summary_report_and_metrics_tell_the_same(sample: Flight, tmp_path: Path) -> None:
    run = replay(sample)
    run.write(tmp_path)
    listed = json.loads((tmp_path / "metrics.json").read_text())["inputs"]
    assert {one["path"]: one["sha256"] for one in listed} == {one.path: one.sha256 for one in sample.inputs}
    html = (tmp_path / "report.html").read_text()
    assert all(re.search(rf"<th>{re.escape(one.path)}</th>.*{one.sha256}", html) for one in sample.inputs)
    assert f"SHA-256 {combined(sample.inputs)[:16]}" in run.table
