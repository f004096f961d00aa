"""Ways from one thread to another that can neither grow nor block the sender; what does not fit is counted."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class BoundedQueue(Generic[T]):
    """First in, first out; when it is full the oldest goes.

    Attributes
    ----------
    dropped
        Items that made room for newer ones.
    """

    def __init__(self, capacity: int) -> None:
        self.dropped = 0
        self._items: deque[T] = deque()
        self._capacity = capacity
        self._ready = threading.Condition()

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: T) -> None:
        """Add an item."""
        with self._ready:
            if len(self._items) >= self._capacity:
                self._items.popleft()
                self.dropped += 1
            self._items.append(item)
            self._ready.notify()

    def take(self, timeout_s: float) -> T | None:
        """Oldest item, or None after ``timeout_s``."""
        with self._ready:
            if not self._items:
                self._ready.wait(timeout_s)
            return self._items.popleft() if self._items else None


class Mailbox(BoundedQueue[T]):
    """Room for one: who is late finds the newest."""

    def __init__(self) -> None:
        super().__init__(1)
