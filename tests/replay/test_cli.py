"""The command line: verbs, exit codes, and one line per error, also for what nobody foresaw."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from axialnav.fusion import complaints
from axialnav.replay import cli, cli_replay
from axialnav.replay.cli_output import progress_bar, wrapped

NOWHERE = "/nowhere/at/all"


def axialnav(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "axialnav", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **options)  # type: ignore[call-overload]


def one_line(text: str) -> bool:
    return text.count("\n") == 1 and text.startswith("axialnav: ") and "Traceback" not in text


def test_help_names_the_verbs_and_the_exit_codes() -> None:
    done = axialnav("--help")
    assert done.returncode == 0
    assert done.stderr == ""
    for word in ("replay", "demo", "motion", "2 usage error"):
        assert word in done.stdout


def test_help_loads_no_heavy_library() -> None:
    heavy = ("numpy", "numba", "scipy", "pyarrow", "plotly", "cv2", "jinja2")
    code = f"import sys, axialnav.replay.cli as c; c.main(['--help']); print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_no_verb_prints_the_help_and_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    assert "replay" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["fly"], 2, ["fly", "demo", "replay"]),
        (["replay"], 2, ["LOG"]),
        (["replay", NOWHERE], 3, [NOWHERE]),
        (["replay", NOWHERE, "--confg", "x"], 2, ["--confg"]),
        (["replay", NOWHERE, "--config", f"{NOWHERE}.toml"], 2, [f"{NOWHERE}.toml"]),
        (["replay", NOWHERE, "--param", "uwb.sigma_m"], 2, ["NAME=VALUE", "uwb.sigma_m"]),
        (["replay", NOWHERE, NOWHERE], 2, [NOWHERE]),
    ],
)
def test_bad_input_is_one_line_and_the_promised_exit_code(
    arguments: list[str], code: int, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(arguments) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert one_line(captured.err)
    for word in words:
        assert word in captured.err


def test_the_process_ends_with_the_exit_code() -> None:
    done = axialnav("replay", NOWHERE)
    assert done.returncode == 3
    assert one_line(done.stderr)


def test_a_config_with_an_unknown_key_names_the_nearest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "c.toml").write_text("[uwb]\nsigma = 0.4\n")
    assert cli.main(["replay", NOWHERE, "--config", str(tmp_path / "c.toml")]) == 2
    error = capsys.readouterr().err
    assert one_line(error)
    assert "sigma_m" in error


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (PermissionError(13, "Permission denied", "secret.csv"), 3, "secret.csv: Permission denied"),
        (ZeroDivisionError("two\nlines"), 3, "defect of axialnav: ZeroDivisionError: two lines"),
        (MemoryError(), 3, "defect of axialnav: MemoryError"),
    ],
)
def test_the_unforeseen_is_one_line_too(
    error: BaseException,
    code: int,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.delenv(complaints.DEBUG, raising=False)
    monkeypatch.setattr(cli_replay, "_refuse_flight_folder", fail)
    assert cli.main(["demo"]) == code
    captured = capsys.readouterr().err
    assert one_line(captured)
    assert words in captured


def test_the_traceback_is_there_for_whoever_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(complaints.DEBUG, "1")
    monkeypatch.setattr(cli_replay, "_refuse_flight_folder", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        cli.main(["demo"])


def test_a_run_is_never_written_over_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mav0").mkdir()
    assert cli.main(["demo", "--out", str(tmp_path)]) == 2
    assert "recorded flight" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mav0"]


def test_complaints_stay_on_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    complaints.complain("first\nsecond\r\n\tthird")
    assert capsys.readouterr().err == "axialnav: first second third\n"


def test_no_progress_where_nobody_watches(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("replay") as progress:
        assert progress is None
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("text", "pair"), [("uwb.sigma_m=0.4", ("uwb.sigma_m", "0.4")), ('a = "b=c"', ("a", '"b=c"'))])
def test_parameters_split_at_the_first_equals_sign(text: str, pair: tuple[str, str]) -> None:
    assert cli_replay._parameter(text) == pair


@pytest.mark.parametrize(
    ("name", "safe"), [("a flight/../x", "a_flight_.._x"), ("..", "flight"), ("", "flight"), ("ok-1.2_b", "ok-1.2_b")]
)
def test_a_flight_name_becomes_a_harmless_folder_name(name: str, safe: str) -> None:
    assert cli_replay._file_name(name) == safe


def test_a_narrow_terminal_wraps_between_words() -> None:
    line = (
        "flight     copter   80.0 s   imu0 3831 (47.9 Hz)   att0 767 (9.6 Hz)   flow0 761 (9.5 Hz)   tof0 509 (6.4 Hz)"
    )
    pieces = wrapped(line, 80).splitlines()
    assert len(pieces) == 2
    assert all(len(piece) <= 80 for piece in pieces)
    assert pieces[1].startswith(" " * 11)
    assert "".join(pieces).replace(" ", "") == line.replace(" ", "")
    assert wrapped(line, 120) == line
    path = "report     " + "x" * 100
    assert "x" * 100 in wrapped(path, 80)  # what one copies is never cut
