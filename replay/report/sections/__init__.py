"""Sections of the report, one module each; every module has ``build(run) -> Section | None``."""
