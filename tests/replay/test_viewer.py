"""The recording for the Rerun viewer, read back with Rerun's own reader."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from axialnav.fusion.outcome import Verdict
from axialnav.replay import cli
from axialnav.replay.flight_writer import write_flight
from axialnav.replay.viewer import RECORDING, TIMELINE, write_recording
from tests.replay.made_recordings import flown
from tests.replay.made_runs import make_run

Column = tuple[np.ndarray, list[Any]]


@pytest.fixture
def rerun() -> Any:
    return pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed: pip install 'axialnav[viewer]'")


def read_back(reader: Any, path: Path) -> dict[str, Column]:
    """ "entity component" -> seconds (empty for what holds always) and values."""
    found: dict[str, Column] = {}
    for chunk in reader.RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        names = batch.schema.names
        seconds = np.array([])
        if TIMELINE in names:
            seconds = batch.column(names.index(TIMELINE)).to_numpy(zero_copy_only=False).astype(np.int64) * 1e-9
        for name, column in zip(names, batch.columns, strict=True):
            if ":" in name:
                before = found.get(f"{chunk.entity_path} {name}", (np.array([]), []))
                values = [value[0] for value in column.to_pylist() if value]
                found[f"{chunk.entity_path} {name}"] = (np.append(before[0], seconds), before[1] + values)
    return found


def test_what_is_written_is_read_back(rerun: Any, tmp_path: Path) -> None:
    run = make_run()
    found = read_back(rerun, write_recording(run, tmp_path / "deep" / RECORDING))
    seconds, velocity = found["/axial_velocity/fused Scalars:scalars"]
    np.testing.assert_allclose(velocity, run.columns["axial_velocity_m_s"], rtol=1e-12)
    np.testing.assert_allclose(seconds, (run.track.t_ns - run.track.t_ns[0]) * 1e-9, atol=1e-9)
    _, above = found["/axial_velocity/3_sigma_above Scalars:scalars"]
    sigma = run.columns["sigma_axial_velocity_m_s"]
    np.testing.assert_allclose(np.array(above) - np.array(velocity), 3.0 * sigma, atol=1e-9)
    gated = int(((run.log.verdict == Verdict.GATED) & (run.log.source == 1)).sum())
    assert len(found["/innovations/uwb0/gated Scalars:scalars"][1]) == gated > 100
    times, states = found["/supervisor/uwb0 StateChange:state"]
    assert states == ["ok", "suspect", "reacquire", "ok"]
    np.testing.assert_allclose(times, [0.0, 12.0, 13.2, 13.6])
    times, events = found["/events TextLog:text"]
    assert events == ["dead reckoning begins", "dead reckoning ends", "position reset"]
    np.testing.assert_allclose(times, [12.0, 13.6, 13.6])
    assert len(found["/world/truth LineStrips3D:strips"][1][0]) == len(run.flight.truth.t_ns)  # type: ignore[union-attr]
    _, turns = found["/world/vehicle Transform3D:quaternion"]
    np.testing.assert_allclose(np.array(turns)[:, 3], 1.0)  # w comes last there


def test_the_verb_writes_it_beside_the_report(rerun: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_flight(flown(3, 4.0), tmp_path / "flight")
    assert cli.main(["replay", str(folder), "--out", str(tmp_path / "run"), "--viewer"]) == 0
    assert f"rerun {tmp_path / 'run' / RECORDING}" in capsys.readouterr().out
    assert "/innovations/uwb0/fused Scalars:scalars" in read_back(rerun, tmp_path / "run" / RECORDING)


def test_without_the_package_it_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert cli.main(["replay", str(tmp_path), "--viewer", "--out", str(tmp_path / "run")]) == 2
    assert "pip install 'axialnav[viewer]'" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()  # said before any work was done
