"""Errors of the package: one line each that says what, value, limit and way out."""

from __future__ import annotations


class AxialnavError(Exception):
    """Base of every error raised on purpose; its message is one line for a person."""


class ConfigError(AxialnavError):
    """A configuration cannot be used (command line: exit code 2)."""


class FlightError(AxialnavError):
    """A recording cannot be used (command line: exit code 3)."""


class ReadingError(AxialnavError, ValueError):
    """A reading is nonsense and was refused at construction."""
