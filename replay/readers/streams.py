"""A log as named streams of columns: what all readers of foreign formats have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.flight import Stamps


@dataclass(frozen=True)
class Stream:
    """Messages of one kind.

    Attributes
    ----------
    name
        Name in the log: a topic, or a message type with its instance.
    type
        Message type, where that is something else.
    t_ns
        When each message was made, or else logged [ns], shape (n,), in the order of the log.
    columns
        Field -> values (n,) or (n, k).
    pictures
        Of cameras: goes through the pictures in the order of the log.
    """

    name: str
    type: str
    t_ns: Stamps
    columns: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    pictures: Callable[[], Iterator[NDArray[np.generic]]] | None = None

    def matches(self, wanted: str) -> bool:
        """Whether ``wanted`` is this stream's name or its type."""
        return wanted in (self.name, self.type, self.type.replace("/msg/", "/"))

    def take(self, rows: NDArray[np.bool_]) -> Stream:
        """The messages chosen by a mask."""
        columns = {name: array[rows] for name, array in self.columns.items()}
        return Stream(self.name, self.type, self.t_ns[rows], columns)
