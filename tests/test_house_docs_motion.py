"""The page on image motion: its examples run, and it knows every reason and every method there is."""

from __future__ import annotations

import doctest
from pathlib import Path

from axialnav.estimators.methods import LEAST_FRAMES
from axialnav.estimators.result import MotionReason

PAGE = Path(__file__).parents[1] / "docs" / "image-motion.md"
TEXT = PAGE.read_text(encoding="utf-8")


def test_examples_give_what_the_page_says() -> None:
    result = doctest.testfile(str(PAGE), module_relative=False, encoding="utf-8")
    assert result.failed == 0
    assert result.attempted > 10


def test_every_reason_and_every_method_is_on_the_page() -> None:
    rows = [line for line in TEXT.splitlines() if line.startswith("| `")]
    assert [
        r.name for r in MotionReason if r is not MotionReason.GOOD and not any(f"`{r.name}`" in x for x in rows)
    ] == []
    assert [method for method in LEAST_FRAMES if f"`{method}`" not in TEXT] == []
