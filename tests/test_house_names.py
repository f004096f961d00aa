"""The public names: all there, loaded at first use only, and ``replay`` callable whatever was imported before."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys

import pytest

import axialnav as an

CONTRACT = [
    *("Config", "CorridorEstimator", "Flight", "Run", "load_flight", "replay", "__version__"),
    *("estimate_motion", "MotionEstimate", "MotionEstimator"),
    *("AxialState", "Outcome", "Verdict", "Reason", "Health"),
    *("ImuSample", "PixelMotion", "BlurLength", "WallRange", "UwbRange", "UwbTdoa", "UwbFix", "Height", "Attitude"),
    *("AxialnavError", "ConfigError", "FlightError", "ReadingError"),
]

HEAVY = ["cv2", "filterpy", "matplotlib", "numba", "numpy", "pandas", "plotly", "pyarrow", "pymavlink", "rich", "scipy"]


def run_python(program: str) -> str:
    """Standard output of a fresh interpreter that ran ``program``; what it complained of where it failed."""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def modules_after(program: str) -> set[str]:
    """Names in ``sys.modules`` of a fresh interpreter that ran ``program``."""
    return set(json.loads(run_python(f"{program}\nimport sys, json; print(json.dumps(sorted(sys.modules)))")))


@pytest.mark.parametrize("name", CONTRACT)
def test_every_promised_name_is_there(name: str) -> None:
    assert getattr(an, name) is not None
    assert name in an.__all__
    assert name in dir(an)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'CoridorEstimator'"):
        _ = an.CoridorEstimator  # type: ignore[attr-defined]


def test_importing_the_package_loads_no_library_at_all() -> None:
    assert modules_after("import axialnav").isdisjoint(HEAVY)


@pytest.mark.parametrize(
    ("program", "spared"),
    [
        (
            "from axialnav import Config, ImuSample, Verdict",
            "cv2 filterpy matplotlib numba plotly pyarrow pymavlink rich scipy",
        ),
        ("from axialnav import CorridorEstimator", "cv2 filterpy matplotlib plotly pyarrow pymavlink rich scipy.stats"),
        ("from axialnav import load_flight", "cv2 filterpy matplotlib plotly scipy.stats"),
        ("import axialnav.replay.run", "cv2 filterpy matplotlib scipy.stats"),
    ],
)
def test_each_name_loads_only_what_it_needs(program: str, spared: str) -> None:
    assert modules_after(program).isdisjoint(spared.split())


@pytest.mark.parametrize(
    "order",
    [
        *itertools.permutations(
            ["import axialnav.replay", "from axialnav.replay.flight import Flight", "from axialnav import replay, Run"]
        )
    ],
    ids=" / ".join,
)
def test_replay_is_the_layer_and_its_main_function_in_every_import_order(order: tuple[str, ...]) -> None:
    look = "import axialnav as an, axialnav.replay.run as run; print(callable(an.replay), an.replay.run is run)"
    assert run_python("\n".join([*order, look])).split() == ["True", "True"]


def test_calling_the_layer_calls_the_function(monkeypatch: pytest.MonkeyPatch) -> None:
    from axialnav.replay import run

    monkeypatch.setattr(run, "replay", lambda *args, **options: (args, options))
    assert an.replay("flight", smooth=True) == (("flight",), {"smooth": True})  # type: ignore[arg-type, comparison-overlap]
