"""Collects what a reader leaves out, so that nothing disappears without a count and a name."""

from __future__ import annotations

from axialnav.replay.flight import Drop

EXAMPLE_LENGTH = 80


def one_line(text: str) -> str:
    """The text on one line that a terminal can show: white space folded, other control characters escaped."""
    folded = " ".join(text.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in folded)


class DropLog:
    """Grows while a recording is read; :meth:`as_tuple` gives the result."""

    def __init__(self) -> None:
        self._drops: list[Drop] = []

    def add(self, sensor: str, reason: str, count: int, example: str) -> None:
        """Note ``count`` cases of ``reason``; nothing is noted for a count of zero."""
        if count:
            shown = one_line(example)
            if len(shown) > EXAMPLE_LENGTH:
                shown = shown[: EXAMPLE_LENGTH - 3] + "..."
            self._drops.append(Drop(sensor, reason, int(count), shown))

    def as_tuple(self) -> tuple[Drop, ...]:
        """Everything noted so far, in the order it was found."""
        return tuple(self._drops)
