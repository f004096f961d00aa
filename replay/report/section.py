"""What a section hands to the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from axialnav.replay.report.figure import Figure


@dataclass(frozen=True, slots=True)
class Section:
    """Title, figures and values for one template.

    ``template`` is a file in ``templates/``; it sees ``numbered`` (number on the page and
    :class:`Figure`, pairs) and the entries of ``values``.
    """

    title: str
    figures: Sequence[Figure] = ()
    template: str = "figures.html.j2"
    note: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)
