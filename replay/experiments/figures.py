"""Figures of the experiments: plain SVG files that look the same on every machine.

matplotlib comes with filterpy and is loaded only when a figure is drawn.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, MUTED, RULE = "#1f2933", "#7b8794", "#d9dee4"
COLOURS = ("#0b6e99", "#c8553d", "#6b8f3a", "#8a5aa8", "#b8860b", "#3d8b85", "#9a9a9a")
GREY_STEP = 16
STYLE: Any = {
    "svg.hashsalt": "axialnav",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": RULE,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8,
}


def draw(path: Path, size_in: tuple[float, float], paint: Any, dpi: float = 100.0) -> Path:
    """Create a figure of ``size_in`` inches, let ``paint(figure)`` fill it, and write it in the format of the suffix.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure: Figure = Figure(figsize=size_in, layout="constrained", dpi=dpi)
        paint(figure)
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
    return path


def picture(axes: Axes, image: NDArray[Any], title: str) -> None:
    """Show a grey picture (h, w) of 0-255 without ticks, in few grey levels to keep the file small."""
    axes.imshow(image // GREY_STEP * GREY_STEP, cmap="gray", interpolation="none", aspect="auto", vmin=0, vmax=255)
    axes.set_title(title)
    axes.set_axis_off()


def _area_mean(image: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Picture reduced to ``shape`` by averaging nearly equal blocks."""
    small = image.astype(np.float64)
    for axis, cells in enumerate(shape):
        edges = np.linspace(0, image.shape[axis], cells + 1).astype(int)
        sizes = np.diff(edges).reshape([-1 if a == axis else 1 for a in range(2)])
        small = np.add.reduceat(small, edges[:-1], axis=axis) / sizes
    return small


def log_spectrum(image: NDArray[Any], shape: tuple[int, int] = (90, 180)) -> NDArray[np.uint8]:
    """Centred log spectrum of a picture, shrunk to ``shape`` and stretched to 0-255 for show."""
    grey = np.asarray(image, dtype=np.float32)
    spectrum = np.fft.fftshift(np.log1p(np.abs(np.fft.fft2(grey - grey.mean())))).astype(np.float32)
    small = _area_mean(spectrum, shape)
    low, high = np.percentile(small, (1.0, 99.5))
    return np.asarray(np.clip((small - low) * (255.0 / (high - low)), 0, 255), dtype=np.uint8)


def shrunk(image: NDArray[Any], shape: tuple[int, int] = (90, 180)) -> NDArray[np.uint8]:
    """Picture reduced to ``shape`` for show, its grey values stretched to 0-255."""
    small = _area_mean(np.asarray(image, dtype=np.float32), shape)
    low, high = np.percentile(small, (0.5, 99.5))
    return np.asarray(np.clip((small - low) * (255.0 / max(high - low, 1e-6)), 0, 255), dtype=np.uint8)
