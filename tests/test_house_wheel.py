"""What is shipped: real files behind the links, the data with the code, and a command that runs anywhere."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.house import LAYERS, ROOT

BUILD_LEFTOVERS = {"__pycache__", ".ruff_cache", ".mypy_cache"}
MAX_WHEEL_BYTES = 8_000_000


def run(*command: str | Path, cwd: Path, **environment: str) -> str:
    """Standard output of a command that has to end well."""
    ended = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def build(out: Path, *kinds: str) -> Path:
    """Build into ``out`` from the checkout, with the tools installed here, and return the wheel."""
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", out, *kinds, ROOT, cwd=out)
    (wheel,) = out.glob("*.whl")
    return wheel


def files_of(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("wheel"), "--wheel")


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder that holds the installed wheel and nothing of the checkout."""
    site = tmp_path_factory.mktemp("site")
    run(sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, wheel, cwd=site)
    return site


def test_the_wheel_holds_every_file_of_the_four_layers_and_nothing_else(wheel: Path) -> None:
    inside = {
        f"axialnav/{path.relative_to(ROOT).as_posix()}"
        for layer in LAYERS
        for path in (ROOT / layer).rglob("*")
        if path.is_file() and not BUILD_LEFTOVERS & set(path.parts) and path.suffix not in {".nbi", ".nbc"}
    }
    assert files_of(wheel) == inside | {"axialnav/__init__.py", "axialnav/__main__.py", "axialnav/py.typed"}
    assert wheel.stat().st_size < MAX_WHEEL_BYTES


def test_the_wheel_holds_a_flight_with_its_notice_and_the_report_templates(wheel: Path) -> None:
    names = files_of(wheel)
    flights = {name.removesuffix("/flight.toml") for name in names if name.endswith("/flight.toml")}
    assert flights
    for flight in flights:
        assert any(name.startswith(f"{flight}/mav0/imu0/data.csv") for name in names)
        assert any(name.startswith((f"{flight}/LICENSE", f"{flight}/NOTICE")) for name in names)
    assert any(name.startswith("axialnav/replay/report/") and name.endswith((".html", ".j2")) for name in names)


def test_a_wheel_built_from_the_source_archive_is_the_same(wheel: Path, tmp_path: Path) -> None:
    again = build(tmp_path)
    assert list(tmp_path.glob("*.tar.gz"))
    assert files_of(again) == files_of(wheel)


def test_the_installed_wheel_runs_outside_the_checkout(installed: Path, tmp_path: Path) -> None:
    where = run(
        sys.executable, "-c", "import axialnav; print(axialnav.__file__)", cwd=tmp_path, PYTHONPATH=str(installed)
    )
    assert Path(where.strip()).is_relative_to(installed)
    for command in ([sys.executable, "-m", "axialnav"], [installed / "bin" / "axialnav"]):
        printed = run(*command, "--help", cwd=tmp_path, PYTHONPATH=str(installed))
        assert "replay" in printed
        assert "motion" in printed


@pytest.mark.slow
def test_the_installed_wheel_flies_its_demo_outside_the_checkout(installed: Path, tmp_path: Path) -> None:
    run(sys.executable, "-m", "axialnav", "demo", "--out", "demo", cwd=tmp_path, PYTHONPATH=str(installed))
    assert "<html" in (tmp_path / "demo" / "report.html").read_text(encoding="utf-8")[:1000].lower()


def test_without_the_replay_extra_the_command_line_says_what_to_install(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "cyclopts.py").write_text("raise ModuleNotFoundError('No module named cyclopts', name='cyclopts')\n")
    path = os.pathsep.join([str(tmp_path), str(installed)])
    ended = subprocess.run(
        [sys.executable, "-m", "axialnav", "--help"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 2
    assert ended.stderr.count("\n") == 1
    assert "'cyclopts'" in ended.stderr
    assert "pip install 'axialnav[replay]'" in ended.stderr
