"""The core alone, as a companion computer installs it: a fresh environment, the wheel, a short flight on loopback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from axialnav.fusion.strict_toml import dump
from tests.fusion.live.accounts import PATIENCE_S, wait_for
from tests.fusion.live.streamed import StreamedVehicle, ahead, streamed_flight, vehicle_of
from tests.fusion.live.test_live_stream import SLOW_SCENE, without_none
from tests.house import ROOT

AWAY = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
EXTRAS = ("cyclopts", "rich", "plotly", "jinja2", "pyarrow", "rosbags", "pyulog", "pytest")


def run(*command: str | Path, cwd: Path) -> str:
    """Standard output of a command that has to end well, away from the checkout."""
    ended = subprocess.run(
        [str(word) for word in command], cwd=cwd, env=AWAY, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


@pytest.mark.slow
@pytest.mark.skipif(
    "AXIALNAV_FRESH_INSTALL" not in os.environ, reason="installs a hundred megabytes, compiles for a minute"
)
def test_the_core_alone_flies(tmp_path: Path) -> None:
    run(sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", tmp_path, ROOT, cwd=tmp_path)
    (wheel,) = tmp_path.glob("*.whl")
    run(sys.executable, "-m", "venv", tmp_path / "board", cwd=tmp_path)
    python, axialnav = tmp_path / "board/bin/python", tmp_path / "board/bin/axialnav"
    run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel, cwd=tmp_path)
    there = "import importlib.util as u; print(*[n for n in {!r} if u.find_spec(n)])"
    assert run(python, "-c", there.format(EXTRAS), cwd=tmp_path).split() == []
    assert "--config" in run(axialnav, "live", "--help", cwd=tmp_path)
    course = streamed_flight(SLOW_SCENE)
    streamed = StreamedVehicle(course)
    vehicle = vehicle_of(ahead(course.config), streamed.port, streamed.ttys)
    data = {**msgspec.to_builtins(vehicle), "record": {"folder": str(tmp_path / "flights")}}
    (tmp_path / "vehicle.toml").write_text(dump(without_none(data)), encoding="utf-8")
    process = subprocess.Popen(
        [axialnav, "live", "--config", tmp_path / "vehicle.toml"],
        cwd=tmp_path,
        env=AWAY,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        assert "compiling" in process.stdout.readline()
        assert "sending: full" in process.stdout.readline()  # everything has been compiled by then
        streamed.start()
        assert wait_for(lambda: streamed.contract.used("ODOMETRY") > 30)
        process.terminate()
        out, err = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
        streamed.close()
    assert (process.returncode, err) == (0, "")
    assert out.endswith("stopped\n")
    assert [path.stat().st_size > 100_000 for path in (tmp_path / "flights").glob("*.mcap")] == [True]
