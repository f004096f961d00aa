"""How the command line speaks: results on stdout, progress on stderr."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LABEL = re.compile(r"\S*\s{2,}")  # the word that a line begins with, or its indentation


def emit(text: str | None = None) -> None:
    """Print a result, or only flush; a reader that has gone away (``| head``) does not change the exit code."""
    try:
        if text is not None:
            print(_fitted(text) if sys.stdout.isatty() else text)
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes stdout once more at exit: give it somewhere to go.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fitted(text: str) -> str:
    """Lines wrapped between words where the terminal ends, the rest of each set in; what is piped stays as it is."""
    width = shutil.get_terminal_size().columns
    return "\n".join(wrapped(line, width) for line in text.splitlines())


def wrapped(line: str, width: int) -> str:
    """A line in pieces of at most ``width`` columns; the columns of tables keep their gaps."""
    if len(line) <= width:
        return line
    label = LABEL.match(line)
    indent = " " * min(len(label[0]) if label else 4, width // 3)
    pieces = textwrap.wrap(
        line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False, replace_whitespace=False
    )
    return "\n".join(pieces)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None] | None]:
    """Progress on stderr while the block runs: a function that takes the share done, or None where nobody watches."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=1.0)
        yield lambda share: bar.update(task, completed=share)
