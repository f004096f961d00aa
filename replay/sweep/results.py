"""Results of a sweep on disk: a journal that survives a kill, and the Parquet table made of it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from axialnav.fusion.errors import ConfigError

JOURNAL, TABLE = "journal.jsonl", "results.parquet"


class Journal:
    """One line of JSON per finished job, on disk before the next is taken; a line cut by a kill counts as not there.

    Parameters
    ----------
    folder
        Folder of the sweep; made if it is not there.

    Raises
    ------
    ConfigError
        The folder cannot be made or written.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / JOURNAL
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.done = {row["key"]: row for row in self._read()}
            self._repair()
            self._file = self._path.open("a", encoding="utf-8")
        except OSError as error:
            why = error.strerror or str(error)
            raise ConfigError(f"sweep folder {folder}: cannot be written ({why}); choose another with --out") from None

    def _read(self) -> Iterable[dict[str, Any]]:
        if not self._path.exists():
            return
        for line in self._path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                row = json.loads(line)
            except ValueError:
                continue
            if isinstance(row, dict) and "key" in row:
                yield row

    def _repair(self) -> None:
        """Without this the next line would be glued to the stump of a cut one."""
        if self._path.exists():
            whole = "".join(json.dumps(row) + "\n" for row in self.done.values())
            swap = self._path.with_suffix(".swap")
            swap.write_text(whole, encoding="utf-8")
            swap.replace(self._path)

    def add(self, row: dict[str, Any]) -> None:
        """Take a result; one that is there already is not taken twice."""
        if row["key"] in self.done:
            return
        self._file.write(json.dumps(_plain(row)) + "\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        self.done[row["key"]] = row

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in row.items()}


def write_table(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write rows as Parquet; columns are the union of all keys, absent values null."""
    import pyarrow as pa
    from pyarrow import parquet

    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = {name: [_plain(row).get(name) for row in rows] for name in names}
    parquet.write_table(pa.table(columns), path, compression="zstd")
