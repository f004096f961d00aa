"""The cache of compiled kernels must not outlive a change in any function that a kernel calls."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import axialnav
from axialnav.models.jit import source_stamp

CALLER = """from axialnav.models.inner import inner
from {decorator} import kernel


@kernel
def outer(x):
    return inner(x)
"""
INNER = "from {decorator} import kernel\n\n\n@kernel\ndef inner(x):\n    return {factor} * x\n"
DECORATORS = "axialnav.models.jit", "axialnav.models.scalar_kernel"


def copy_of_the_package(folder: Path, decorator: str = DECORATORS[0]) -> Path:
    root = Path(axialnav.__file__).resolve().parent.parent
    package = folder / "axialnav"
    for layer in ("models", "estimators", "fusion", "fusion/kernels"):
        (package / layer).mkdir(parents=True)
        (package / layer / "__init__.py").touch()
    (package / "__init__.py").touch()
    for name in ("jit.py", "one_module.py", "pieces.py", "quick_lowering.py", "quick_passes.py", "scalar_kernel.py"):
        (package / "models" / name).write_text((root / "models" / name).read_text())
    (package / "models" / "outer.py").write_text(CALLER.format(decorator=decorator))
    return package


def outer_of_three(folder: Path, then: str = "print(outer(3.0))") -> str:
    code = f"from axialnav.models.outer import outer; {then}"
    environment = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("decorator", DECORATORS)
def test_a_change_in_a_called_function_is_seen(tmp_path: Path, decorator: str) -> None:
    package = copy_of_the_package(tmp_path, decorator)
    (package / "models" / "inner.py").write_text(INNER.format(factor=2.0, decorator=decorator))
    assert outer_of_three(tmp_path) == "6.0"
    assert outer_of_three(tmp_path) == "6.0"
    (package / "models" / "inner.py").write_text(INNER.format(factor=20.0, decorator=decorator))
    assert outer_of_three(tmp_path) == "60.0"


def test_a_part_is_compiled_once_and_read_from_disk_for_another_whole(tmp_path: Path) -> None:
    """A second caller of a kernel finds it on disk, and so does the kernel itself when Python calls it."""
    decorator = DECORATORS[1]
    package = copy_of_the_package(tmp_path, decorator)
    (package / "models" / "inner.py").write_text(INNER.format(factor=2.0, decorator=decorator))
    (package / "models" / "top.py").write_text(
        CALLER.format(decorator=decorator).replace("inner", "outer").replace("def outer", "def top")
    )
    say = "print(outer(3.0), sum(inner.part.stats.cache_hits.values()), len(inner.part.stats.cache_misses))"
    assert outer_of_three(tmp_path, f"from axialnav.models.inner import inner; {say}") == "6.0 0 1"
    say = "from axialnav.models.top import top; print(top(3.0), outer.part.stats.cache_hits)"
    assert outer_of_three(tmp_path, say).startswith("6.0 Counter()")  # not called from another kernel until now
    (package / "models" / "top.py").write_text((package / "models" / "top.py").read_text() + "\n")
    assert outer_of_three(tmp_path, "from axialnav.models.inner import inner; print(inner(4.0))") == "8.0"
    assert outer_of_three(tmp_path) == "6.0"


@pytest.mark.parametrize(("field", "argument"), [("", "3.0"), (".a", "numpy.array([(3.0,)], [('a', 'f8')])[0]")])
def test_what_another_process_kept_meanwhile_fits_what_this_one_compiles(
    tmp_path: Path, field: str, argument: str
) -> None:
    """Two programs that start together for the first time compile half of the kernels each and link the other's half.

    Were functions, files or the types of records numbered as they come, each would look for what the other calls
    something else; that ended in a crash of the process.
    """
    decorator = DECORATORS[1]
    package = copy_of_the_package(tmp_path, decorator)
    inner = INNER.format(factor=2.0, decorator=decorator).replace("* x", f"* x{field}")
    (package / "models" / "inner.py").write_text(inner)
    (package / "models" / "top.py").write_text(
        CALLER.format(decorator=decorator).replace("inner", "outer").replace("def outer", "def top")
    )
    say = f"import numpy; from axialnav.models.top import top; print(top({argument}))"
    others = "import numba, numpy; numba.njit(lambda: 1)(); numba.typeof(numpy.zeros(1, [('b', 'f8')])); "
    assert outer_of_three(tmp_path, others + say) == "6.0"
    for kept in (tmp_path / "cache").rglob("inner.inner*"):
        kept.unlink()  # this process had read an empty index just before the other wrote it
    for kept in (tmp_path / "cache").rglob("top.top*"):
        kept.unlink()
    assert outer_of_three(tmp_path, say) == "6.0"


def test_two_processes_that_keep_different_overloads_do_not_take_the_same_file(tmp_path: Path) -> None:
    package = copy_of_the_package(tmp_path)
    (package / "models" / "inner.py").write_text(INNER.format(factor=2.0, decorator=DECORATORS[0]))
    both = """from axialnav.models.inner import inner
inner(1.0), inner(1)
cache = inner._cache._cache_file
kept, names = cache._load_index(), []
for key in kept:
    cache._save_index({})  # as each of the two saw it
    cache.save(key, "data")
    names += cache._load_index().values()
print(len(kept), len(set(names)))"""
    assert outer_of_three(tmp_path, both) == "2 2"


def test_the_object_code_of_a_whole_names_none_of_its_parts(tmp_path: Path) -> None:
    """Two wholes hold their own copies of a part, each with other arguments optimised away.

    Were the copies named in the object code, the loader could hand out one of them for the other; that ended in a crash
    of the process.
    """
    decorator = DECORATORS[1]
    package = copy_of_the_package(tmp_path, decorator)
    body = "".join(f"    x = math.sin(x + {i}.0) * math.cos(x) + x * {i}.5\n" for i in range(60))
    calls = " + ".join(f"inner(x + {i}.0)" for i in range(12))  # too large and too often called to be inlined
    inner = INNER.format(factor=2.0, decorator=decorator).replace("    return", body + "    return")
    (package / "models" / "inner.py").write_text("import math\n" + inner)
    (package / "models" / "outer.py").write_text(CALLER.format(decorator=decorator).replace("inner(x)", calls))
    say = """from axialnav.models.inner import inner; outer(3.0)
whole, part = (next(iter(f.overloads.values())) for f in (outer, inner.part))
code, name = whole.library._get_compiled_object(), part.fndesc.mangled_name
print(whole.fndesc.mangled_name.encode() in code, name in whole.library.get_llvm_str(), name.encode() in code)"""
    assert outer_of_three(tmp_path, say) == "True True False"


def test_the_stamp_sees_every_source(tmp_path: Path) -> None:
    package = copy_of_the_package(tmp_path)
    before = source_stamp(package)
    (package / "fusion" / "kernels" / "more.py").write_text("x = 1\n")
    assert source_stamp(package) != before


def test_an_index_of_another_version_counts_as_empty(tmp_path: Path) -> None:
    package = copy_of_the_package(tmp_path)
    (package / "models" / "inner.py").write_text(INNER.format(factor=2.0, decorator=DECORATORS[0]))
    assert outer_of_three(tmp_path) == "6.0"
    for index in (tmp_path / "cache").rglob("*.nbi"):
        # a pickle that names something that is no longer there
        gone = pickle.dumps(numba.__version__) + b"caxialnav.models.jit\nGone\n."
        index.write_bytes(gone)
    assert outer_of_three(tmp_path) == "6.0"
