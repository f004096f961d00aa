"""The house rules that a machine can check; each failure lists every place that breaks the rule."""

from __future__ import annotations

import ast
import doctest
import importlib
import re
import statistics

import pytest

from tests.house import ROOT, Source, length, package_sources, sources_of_tests, text_files

PACKAGE = package_sources()
TESTS = sources_of_tests()

MAX_FILE_LINES = 400
MAX_FUNCTION_LINES = 60
AIM_FUNCTION_LINES = 15
AIM_FILE_LINES = 150

# A bracket round one letter keeps this list from matching itself.
FORBIDDEN = {
    r"\bTO[D]O\b|\bFIX[M]E\b|\bX[X]X\b|\bHA[C]K\b": "unfinished work belongs in the tracker, not in the text",
    r"\bfor[ ]now\b|place[h]older": "either it is done or it is not there",
    r"NotImplemented[E]rror": "no stubs",
    r"/wor[k]/|\.\./share[d]/(?!flights|textures|logs)": "paths of somebody's machine",
    r"\bissue #?[0-9]|\bsu[b]-?agent|\bAI[- ](generated|assisted)|\bLL[M]\b": "the text speaks of the project alone",
    r"\bimport pandas\b|\bfrom pandas\b": "numpy in the code, pyarrow at the edge",
}


def test_the_rules_look_at_the_whole_tree() -> None:
    names = {source.name for source in PACKAGE}
    assert {"axialnav/__init__.py", "models/rig.py", "fusion/readings.py", "replay/__init__.py"} <= names
    assert {"README.md", "Makefile", "pyproject.toml", "CHANGELOG.md"} <= {p.name for p in text_files()}


def test_no_file_is_longer_than_400_lines() -> None:
    assert [f"{s.name}: {s.lines}" for s in PACKAGE + TESTS if s.lines > MAX_FILE_LINES] == []


def test_no_function_is_longer_than_60_lines() -> None:
    long = [
        f"{s.name}:{f.lineno} {f.name}: {length(f)}"
        for s in PACKAGE + TESTS
        for f in s.functions()
        if length(f) > MAX_FUNCTION_LINES
    ]
    assert long == []


def test_half_of_all_functions_and_files_are_short() -> None:
    assert statistics.median(length(f) for s in PACKAGE for f in s.functions()) <= AIM_FUNCTION_LINES
    assert statistics.median(s.lines for s in PACKAGE) <= AIM_FILE_LINES


def test_everything_public_has_a_docstring() -> None:
    assert [place for s in PACKAGE for place in s.undocumented()] == []


@pytest.mark.parametrize("pattern", FORBIDDEN)
def test_forbidden_words(pattern: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}"
        for path in text_files()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(pattern, line)
    ]
    assert found == [], FORBIDDEN[pattern]


def test_only_the_command_line_prints() -> None:
    assert [place for s in PACKAGE if not _may_print(s) for place in _calls(s, r"print")] == []


def _may_print(source: Source) -> bool:
    return source.name == "axialnav/__main__.py" or source.name.startswith("replay/cli")


def test_algorithms_read_no_wall_clock_and_draw_no_unseeded_numbers() -> None:
    clock = r"(time\.time(_ns)?|(datetime\.)?datetime\.(now|utcnow|today))"
    drawn = r"((np|numpy)\.)?random\.default_rng|default_rng"
    places = [place for s in PACKAGE for place in _calls(s, clock)]
    places += [place for s in PACKAGE + TESTS for place in _calls(s, drawn, without_arguments=True)]
    assert places == []


def _calls(source: Source, pattern: str, *, without_arguments: bool = False) -> list[str]:
    """Places where a function whose dotted name matches is called."""
    return [
        f"{source.name}:{node.lineno} {ast.unparse(node)[:60]}"
        for node in ast.walk(source.tree)
        if isinstance(node, ast.Call)
        and re.fullmatch(pattern, ast.unparse(node.func))
        and not (without_arguments and (node.args or node.keywords))
    ]


def test_every_test_can_fail() -> None:
    hollow = [
        f"{s.name}:{f.lineno} {f.name}"
        for s in TESTS
        if s.path.name.startswith("test_")
        for f in s.functions()
        if f.name.startswith("test_") and not any(_can_fail(node) for node in ast.walk(f))
    ]
    assert hollow == []


def _can_fail(node: ast.AST) -> bool:
    if isinstance(node, ast.Call):
        return re.search(r"assert|raises|warns|check|fail", ast.unparse(node.func)) is not None
    return isinstance(node, ast.Assert)


@pytest.mark.parametrize("source", [s for s in PACKAGE if ">>> " in s.text], ids=lambda s: s.name)
def test_examples_in_docstrings_do_what_they_show(source: Source) -> None:
    dotted = source.name.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    module = importlib.import_module(dotted if dotted.startswith("axialnav") else f"axialnav.{dotted}")
    result = doctest.testmod(module)
    assert result.attempted > 0
    assert result.failed == 0
