"""The page of the command line names every verb and option that exists, and no other."""

from __future__ import annotations

import re

import pytest

from axialnav.replay import cli
from tests.house import ROOT

PAGE = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## `axialnav (\w+)[^`]*`\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL))
VERBS = sorted(name for name in cli.build_app() if not name.startswith("-"))


def options(text: str) -> set[str]:
    return set(re.findall(r"--[a-z][a-z-]*", text)) - {"--help", "--version"}


def test_every_verb_has_a_section() -> None:
    assert sorted(SECTIONS) == VERBS


@pytest.mark.parametrize("verb", VERBS)
def test_every_option_is_on_the_page(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([verb, "--help"]) == 0
    exists = options(capsys.readouterr().out)
    assert exists
    assert options("\n".join(re.findall(r"^\| `(.*?)`", SECTIONS[verb], re.MULTILINE))) == exists


def test_every_exit_code_is_on_the_page() -> None:
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", PAGE, re.MULTILINE)}
    assert codes == {cli.PASSED, cli.FAILED, cli.USAGE, cli.UNUSABLE, cli.INTERRUPTED}
