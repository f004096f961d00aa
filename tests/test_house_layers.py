"""Who may import what: the four layers, the heavy libraries, and nothing that is not declared."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib

import pytest

from tests.house import LAYERS, ROOT, Source, package_sources, sources_of_tests

SOURCES = package_sources() + sources_of_tests()

# Library -> paths that may import it; tests may import every one of them.
ALLOWED: dict[str, tuple[str, ...]] = {
    "cv2": ("estimators/", "fusion/live/camera", "replay/simulate/"),
    "pymavlink": ("fusion/live/", "replay/readers/", "replay/convert/"),
    "filterpy": ("fusion/axial.py",),
    "scipy.stats": (),
    "matplotlib": ("replay/experiments/",),
    "plotly": ("replay/",),
    "jinja2": ("replay/",),
    "rich": ("replay/",),
    "cyclopts": ("replay/",),
    "pyarrow": ("replay/",),
}
DISTRIBUTION = {
    "cv2": "opencv-python-headless",
    "distributed": "dask",
    "rerun": "rerun-sdk",
    "serial": "pyserial",
    "yaml": "pyyaml",
}


def test_the_layers_import_only_downwards() -> None:
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as run; run()", "--no-cache"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "1 kept, 0 broken" in ended.stdout


@pytest.mark.parametrize("library", ALLOWED)
def test_heavy_libraries_stay_in_their_rooms(library: str) -> None:
    places = [
        f"{s.name}:{line} {name}"
        for s in SOURCES
        if not s.name.startswith(("tests/", *ALLOWED[library]))
        for line, name in s.imports()
        if f"{name}.".startswith(f"{library}.")
    ]
    assert places == []


def test_our_modules_are_imported_by_their_full_name() -> None:
    """Never ``models.rig``: anybody's own ``models`` folder would shadow it."""
    own = re.compile(rf"\.|({'|'.join(LAYERS)})(\.|$)")
    assert [f"{s.name}:{line} {name}" for s in SOURCES for line, name in s.imports() if own.match(name)] == []


@pytest.mark.parametrize("layer", [*LAYERS, "axialnav"])
def test_every_imported_library_is_declared(layer: str) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    requirements = [
        *project["dependencies"],
        *(
            r
            for extra in ("replay", "cluster", "viewer")
            if layer == "replay"
            for r in project["optional-dependencies"][extra]
        ),
    ]
    declared = {re.split(r"[^A-Za-z0-9_.-]", r)[0].lower() for r in requirements}
    known = declared | set(sys.stdlib_module_names) | {"axialnav"}
    assert [place for s in package_sources() for place in _unknown(s, layer, known)] == []


def _unknown(source: Source, layer: str, known: set[str]) -> list[str]:
    if not source.name.startswith(f"{layer}/"):
        return []
    tops = ((line, name.partition(".")[0]) for line, name in source.imports())
    return [f"{source.name}:{line} {top}" for line, top in tops if DISTRIBUTION.get(top, top).lower() not in known]
