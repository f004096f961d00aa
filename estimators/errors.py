"""The one error of the image methods."""

from __future__ import annotations


class FrameError(ValueError):
    """Frames, time stamps or options cannot be used; the message says what, value, limit and way out in one line."""
