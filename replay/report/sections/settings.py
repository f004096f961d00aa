"""Settings that were changed for this run, and all of them as TOML."""

from __future__ import annotations

from axialnav.replay.report.section import Section
from axialnav.replay.run import Run
from axialnav.replay.settings import changed_settings


def build(run: Run) -> Section:
    """Changed settings first; the resolved file can be copied."""
    values = {"changed": changed_settings(run.config, run.flight.config), "toml": run.config.to_toml()}
    return Section("Settings", template="settings.html.j2", values=values)
