"""The README and the documentation keep their word; the examples themselves run in ``tests.readme_check``."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.house import ROOT
from tests.readme_check import Example, examples, run_example

PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]


def test_the_readme_shows_the_two_commands() -> None:
    shown = [e.text for e in examples((ROOT / "README.md").read_text(encoding="utf-8"))]
    assert {"make demo", "make test"} <= set(shown)


def test_commands_are_told_from_their_output() -> None:
    text = "```console\n$ first \\\n  --more\nprinted\n$ second\n```\n\n```python\nprint(1)\n```\n```text\nfree\n```\n"
    assert [(e.line, e.kind, e.text) for e in examples(text)] == [
        (1, "console", "first \\\n  --more"),
        (1, "console", "second"),
        (8, "python", "print(1)\n"),
    ]


@pytest.mark.parametrize(
    "block", ["```bash\nmake demo\n```\n", "```\nmake demo\n```\n", "```console\nmake demo\n```\n"]
)
def test_a_block_that_would_not_be_run_is_refused(block: str) -> None:
    with pytest.raises(ValueError, match=r"README\.md:1: a (block of kind|console block without)"):
        examples(block)


def test_a_failing_example_is_noticed_and_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_example(Example(1, "console", "echo fine"), tmp_path)
    assert not run_example(Example(1, "console", "echo the reason; exit 3"), tmp_path)
    printed = capsys.readouterr().out
    assert "the reason" in printed
    assert "exit code 3" in printed


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_links_between_pages_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?://|#|mailto:)([^)#\s]+)", page.read_text(encoding="utf-8"))
    assert [t for t in targets if not (page.parent / t).exists()] == []


def test_every_make_command_that_a_page_names_exists() -> None:
    targets = set(re.findall(r"^([a-z][a-z -]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    known = {word for line in targets for word in line.split()}
    named = {t for page in PAGES for t in re.findall(r"(?:`|\$ )make ([a-z-]+)", page.read_text(encoding="utf-8"))}
    assert {"demo", "test", "bench"} <= named
    assert named <= known
