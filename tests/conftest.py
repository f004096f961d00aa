"""Fixtures of the whole suite, and the reason given when a test cannot find the recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[1].parent / "shared"
WHY_SKIPPED = (
    f"the recordings are not at {SHARED / 'flights'}; their licences allow tests but not redistribution, "
    "so they are kept beside the checkout, not in it"
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what is marked ``flights`` where the recordings are absent."""
    if (SHARED / "flights").is_dir():
        return
    for item in items:
        if item.get_closest_marker("flights"):
            item.add_marker(pytest.mark.skip(reason=WHY_SKIPPED))


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder that holds ``flights/`` (recordings) and ``textures/``, beside the checkout."""
    if not (SHARED / "flights").is_dir():
        pytest.skip(WHY_SKIPPED)
    return SHARED
