"""The files that a recording was read from, each with its hash, so that a result can be traced to its bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from axialnav.models.rig import Camera

if TYPE_CHECKING:
    from axialnav.replay.flight import Flight

PICTURES = 20  # a folder with more files than this is one entry


@dataclass(frozen=True)
class InputFile:
    """One file, or a folder of pictures as one.

    Attributes
    ----------
    path
        Relative to the recording's folder; the file's own name where the recording is one file.
    bytes
        Size.
    sha256
        Of the content; for a folder of pictures of the lines ``<name> <SHA-256 of the content>``, sorted by name.
    """

    path: str
    bytes: int
    sha256: str


def input_files(flight: Flight) -> tuple[InputFile, ...]:
    """Files of a recording in the order of their paths; empty for one that was never on disk.

    Pictures of cameras that look at no surface are not read by any filter and left out.
    """
    root = flight.path
    if root.is_file():
        return (_file(root, root.name),)
    if not root.is_dir():
        return ()
    return tuple(_below(root, root, _unread(flight)))


def combined(files: Iterable[InputFile]) -> str:
    """SHA-256 over the paths and hashes of all files."""
    return hashlib.sha256("".join(f"{f.path} {f.sha256}\n" for f in files).encode()).hexdigest()


def _unread(flight: Flight) -> frozenset[Path]:
    blind = [n for n, s in flight.config.sensor.items() if isinstance(s, Camera) and s.surface is None]
    return frozenset(flight.path / "mav0" / name / "data" for name in blind)


def _below(folder: Path, root: Path, unread: frozenset[Path]) -> Iterator[InputFile]:
    """A flight folder is its flight.toml and mav0; whatever else lies beside them was not read."""
    entries = sorted(entry for entry in folder.iterdir() if not entry.name.startswith("."))
    if folder == root and (root / "mav0").is_dir():
        entries = [entry for entry in entries if entry.name in {"flight.toml", "mav0"}]
    files = [entry for entry in entries if entry.is_file()]
    if len(files) > PICTURES:
        each = [_file(file, file.name) for file in files]
        lines = "".join(f"{one.path} {one.sha256}\n" for one in each)
        name = f"{folder.relative_to(root).as_posix()}/ ({len(each)} files)"
        yield InputFile(name, sum(one.bytes for one in each), hashlib.sha256(lines.encode()).hexdigest())
    else:
        yield from (_file(file, file.relative_to(root).as_posix()) for file in files)
    for entry in entries:
        if entry.is_dir() and entry not in unread:
            yield from _below(entry, root, unread)


def _file(path: Path, name: str) -> InputFile:
    with path.open("rb") as file:
        return InputFile(name, path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest())
