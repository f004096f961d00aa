"""The pages on the filter: their examples are run, and every measurement tells equation, Jacobian, noise and limits."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest

from tests.house import ROOT

PAGES = sorted((ROOT / "docs" / "filter").glob("*.md"))
MEASUREMENTS = ("pixel-motion", "wall-range", "uwb", "height", "tilt")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_examples_give_what_the_page_says(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    result = doctest.testfile(str(page), module_relative=False, encoding="utf-8")
    assert result.failed == 0
    assert result.attempted >= text.count("```pycon")


def test_there_are_examples() -> None:
    assert sum(page.read_text(encoding="utf-8").count("```pycon") for page in PAGES) >= 10


@pytest.mark.parametrize("name", MEASUREMENTS)
def test_every_measurement_is_told_in_the_same_order(name: str) -> None:
    text = (ROOT / "docs" / "filter" / f"{name}.md").read_text(encoding="utf-8")
    told = " ".join(re.findall(r"^## (.+)$", text, re.MULTILINE)).lower()
    at = [told.find(word) for word in ("equation", "jacobian", "noise", "when it is blind")]
    assert -1 not in at
    assert at == sorted(at)


def test_every_page_is_in_the_index() -> None:
    index = (ROOT / "docs" / "filter" / "index.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"\]\(([a-z-]+)\.md\)", index))
    assert listed == {page.stem for page in PAGES} - {"index"}
