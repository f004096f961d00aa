"""Flights, readers, simulator, run, metrics, report and the command line.

The contract gives one name to two things: this layer, and the function that does its main job.  Importing any module of
the layer makes Python store the layer under ``axialnav.replay``, so a function kept there would vanish at the first
``from axialnav.replay.flight import Flight``.  Therefore the layer's module can itself be called:
``axialnav.replay(flight)`` is :func:`axialnav.replay.run.replay`, whatever was imported before and in whatever order.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from axialnav.replay.run import Run


class _CallableLayer(ModuleType):
    """Module type of this layer; see "Customizing module attribute access" in the Python data model."""

    def __call__(self, *args: Any, **options: Any) -> Run:
        """Replay a flight; arguments and result are those of :func:`axialnav.replay.run.replay`."""
        from axialnav.replay.run import replay

        return replay(*args, **options)


sys.modules[__name__].__class__ = _CallableLayer
