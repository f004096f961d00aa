"""The cache of compiled kernels must not outlive a change in any function that a kernel calls."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba

import axialnav
from axialnav.models.jit import source_stamp

CALLER = """from axialnav.models.inner import inner
from axialnav.models.jit import kernel


@kernel
def outer(x):
    return inner(x)
"""
INNER = "from axialnav.models.jit import kernel\n\n\n@kernel\ndef inner(x):\n    return {factor} * x\n"


def copy_of_the_package(folder: Path) -> Path:
    root = Path(axialnav.__file__).resolve().parent.parent
    package = folder / "axialnav"
    for layer in ("models", "estimators", "fusion", "fusion/kernels"):
        (package / layer).mkdir(parents=True)
        (package / layer / "__init__.py").touch()
    (package / "__init__.py").touch()
    (package / "models" / "jit.py").write_text((root / "models" / "jit.py").read_text())
    (package / "models" / "outer.py").write_text(CALLER)
    return package


def outer_of_three(folder: Path) -> str:
    code = "from axialnav.models.outer import outer; print(outer(3.0))"
    environment = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_change_in_a_called_function_is_seen(tmp_path: Path) -> None:
    package = copy_of_the_package(tmp_path)
    (package / "models" / "inner.py").write_text(INNER.format(factor=2.0))
    assert outer_of_three(tmp_path) == "6.0"
    assert outer_of_three(tmp_path) == "6.0"
    (package / "models" / "inner.py").write_text(INNER.format(factor=20.0))
    assert outer_of_three(tmp_path) == "60.0"


def test_the_stamp_sees_every_source(tmp_path: Path) -> None:
    package = copy_of_the_package(tmp_path)
    before = source_stamp(package)
    (package / "fusion" / "kernels" / "more.py").write_text("x = 1\n")
    assert source_stamp(package) != before


def test_an_index_of_another_version_counts_as_empty(tmp_path: Path) -> None:
    package = copy_of_the_package(tmp_path)
    (package / "models" / "inner.py").write_text(INNER.format(factor=2.0))
    assert outer_of_three(tmp_path) == "6.0"
    for index in (tmp_path / "cache").rglob("*.nbi"):
        # a pickle that names something that is no longer there
        gone = pickle.dumps(numba.__version__) + b"caxialnav.models.jit\nGone\n."
        index.write_bytes(gone)
    assert outer_of_three(tmp_path) == "6.0"
