"""The source tree as the house rules see it: its files, their functions and their imports."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("models", "estimators", "fusion", "replay")
TEXT_SUFFIXES = {".py", ".md", ".toml", ".yaml", ".yml", ".html", ".j2", ".css", ".js", ".txt", ".cfg", ".sh", ""}


@dataclass(frozen=True)
class Source:
    """One Python file; ``name`` is its path from the root of the repository."""

    path: Path

    @property
    def name(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    @property
    def is_test(self) -> bool:
        return self.name.startswith("tests/")

    @cached_property
    def text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text, self.name)

    @property
    def lines(self) -> int:
        return self.text.count("\n")

    def functions(self) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
        """Every function and method, nested ones included."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield node

    def imports(self) -> Iterator[tuple[int, str]]:
        """Line and dotted name of everything imported, at any depth; ``from a import b`` counts as ``a.b``."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                yield from ((node.lineno, alias.name) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                origin = "." * node.level + (node.module or "")
                yield from ((node.lineno, f"{origin}.{alias.name}") for alias in node.names)

    def undocumented(self) -> Iterator[str]:
        """Public module, classes, functions and methods without a docstring."""
        if not ast.get_docstring(self.tree):
            yield f"{self.name}:1 (module)"
        yield from self._undocumented(self.tree.body)

    def _undocumented(self, body: list[ast.stmt]) -> Iterator[str]:
        for node in body:
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) or node.name.startswith("_"):
                continue
            overload = any(ast.unparse(d).endswith(("overload", ".setter")) for d in node.decorator_list)
            if not ast.get_docstring(node) and not overload:
                yield f"{self.name}:{node.lineno} {node.name}"
            if isinstance(node, ast.ClassDef):
                yield from self._undocumented(node.body)


def length(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines from ``def`` to the last statement, docstring included."""
    return (node.end_lineno or node.lineno) - node.lineno + 1


def package_sources() -> list[Source]:
    """Every Python file that is shipped."""
    own = sorted((ROOT / "axialnav").glob("*.py"))
    return [Source(p) for p in own] + [Source(p) for layer in LAYERS for p in sorted((ROOT / layer).rglob("*.py"))]


def sources_of_tests() -> list[Source]:
    """Every Python file of the tests, benches included."""
    return [Source(p) for p in sorted((ROOT / "tests").rglob("*.py"))]


def text_files() -> list[Path]:
    """Every text file of the repository that a person may read."""
    folders = [ROOT / name for name in (*LAYERS, "tests", "docs", ".ci")]
    inside = (
        p for folder in folders for p in sorted(folder.rglob("*")) if not {"_build", "__pycache__"} & set(p.parts)
    )
    top = (
        p for p in [*sorted(ROOT.glob("*")), *sorted((ROOT / "axialnav").glob("*.py"))] if not p.name.startswith(".")
    )
    return [p for p in [*top, *inside] if p.is_file() and p.suffix in TEXT_SUFFIXES]
