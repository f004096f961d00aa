"""Run every command and every Python example that README.md shows, in a fresh clone.

``python -m tests.readme_check`` clones the checkout (what is committed) into a temporary folder and works there.
``--in-place`` works in the checkout itself, for a caller that has just cloned it; ``--ran COMMAND`` names a command
that this caller has already run, which is then listed instead of run again.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FENCE = re.compile(r"^```(?P<kind>[a-z]*)\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
RUN_KINDS = ("console", "python")
SHOWN_KINDS = ("text", "toml")
TIMEOUT_S = 1500.0


@dataclass(frozen=True)
class Example:
    """One command line, or one Python program; ``line`` is where its block starts in the README."""

    line: int
    kind: str
    text: str

    @property
    def title(self) -> str:
        """The command itself, or the first line of the program."""
        return f"$ {self.text}" if self.kind == "console" else f"python example: {self.text.splitlines()[0]}"

    def argv(self) -> list[str]:
        """How to run it from the root of the clone."""
        return ["bash", "-c", self.text] if self.kind == "console" else [".venv/bin/python", "-c", self.text]


def examples(markdown: str) -> list[Example]:
    """Every example in order; ``$ `` starts a command, a trailing backslash continues it, other lines are its output.

    Raises
    ------
    ValueError
        If a fenced block is of a kind that is neither run nor meant to be read only, or a console block has no command.
    """
    found: list[Example] = []
    for fence in FENCE.finditer(markdown):
        kind, body, line = fence["kind"], fence["body"], markdown.count("\n", 0, fence.start()) + 1
        if kind == "python":
            found.append(Example(line, kind, body))
        elif kind == "console":
            commands = [c.strip() for c in re.findall(r"^\$ ((?:.*\\\n)*.*)$", body, re.MULTILINE)]
            if not commands:
                raise ValueError(f"README.md:{line}: a console block without a line that starts with '$ '")
            found += [Example(line, kind, command) for command in commands]
        elif kind not in SHOWN_KINDS:
            known = ", ".join((*RUN_KINDS, *SHOWN_KINDS))
            raise ValueError(f"README.md:{line}: a block of kind {kind!r} would be skipped; use one of {known}")
    return found


def run_example(example: Example, folder: Path) -> bool:
    """Run one example without standard input, say how it went, and return whether it ended well."""
    began = time.perf_counter()
    print(f"README.md:{example.line}: {example.title}", flush=True)
    ended = subprocess.run(
        example.argv(),
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    if ended.returncode != 0:
        print(ended.stdout[-5000:])
    print(f"    exit code {ended.returncode} after {time.perf_counter() - began:.1f} s", flush=True)
    return ended.returncode == 0


def check(folder: Path, ran: Sequence[str]) -> int:
    """Run the examples of the README in ``folder``; return how many failed."""
    todo = examples((folder / "README.md").read_text(encoding="utf-8"))
    failed = 0
    for example in todo:
        if example.text in ran:
            print(f"README.md:{example.line}: {example.title}\n    the caller ran it before")
        else:
            failed += not run_example(example, folder)
    print(f"README.md: {len(todo)} examples, {failed} of them broken")
    return failed


def main() -> int:
    """Exit code 0 if every example works and there is at least one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--in-place", action="store_true", help="work in this checkout, which is a fresh clone")
    parser.add_argument("--ran", action="append", default=[], metavar="COMMAND", help="already run by the caller")
    options = parser.parse_args()
    if options.in_place:
        return int(check(ROOT, options.ran) > 0)
    with tempfile.TemporaryDirectory() as scratch:
        clone = Path(scratch) / "axialnav"
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        return int(check(clone, options.ran) > 0)


if __name__ == "__main__":
    sys.exit(main())
