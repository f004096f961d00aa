"""Things fixed to the airframe that stand in front of the wall and do not move in the picture."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError

Mask = NDArray[np.float32]
Picture = NDArray[np.float32]
SOFT_EDGE_PX = 0.8
ROUGHNESS = 0.15


def occluder(name: str, height: int, width: int, rng: np.random.Generator) -> tuple[Mask, Picture]:
    """Opacity [0-1] and light (1 = mean of the wall) of one object, shape (height, width) each.

    Parameters
    ----------
    name
        One of ``NAMES``: landing ``gear`` (a leg over 8 % of the width and 20 % of the height and its skid), frame
        ``corner`` (25 % by 30 %), a thin ``cable``, a vertical ``bar`` over the full height.
    height, width
        Size of the picture [px].
    rng
        Draws the surface.

    Raises
    ------
    ConfigError
        If there is no such object.
    """
    if name not in _SHAPES:
        raise ConfigError(f"there is no occluder named {name!r}; choose from {', '.join(NAMES)}")
    mask = np.zeros((height, width), dtype=np.uint8)
    _SHAPES[name](mask)
    opacity = cv2.GaussianBlur(mask.astype(np.float32) / 255.0, (0, 0), SOFT_EDGE_PX)
    surface = cv2.GaussianBlur(rng.standard_normal((height, width), dtype=np.float32), (0, 0), 1.5)
    shine = 0.35 + 0.25 * np.sin(np.arange(width) * (40.0 / width))
    light = shine[None, :] * (1.0 + ROUGHNESS * surface / surface.std())
    return np.asarray(opacity, dtype=np.float32), np.maximum(light, 0.02).astype(np.float32)


def _gear(mask: NDArray[np.uint8]) -> None:
    height, width = mask.shape
    left, top = int(0.60 * width), int(0.80 * height)
    mask[top:, left : left + max(2, int(0.02 * width))] = 255
    mask[top:, left + int(0.06 * width) : left + int(0.08 * width)] = 255
    mask[int(0.93 * height) : int(0.96 * height), left : left + int(0.08 * width)] = 255


def _corner(mask: NDArray[np.uint8]) -> None:
    height, width = mask.shape
    triangle = np.array([[0, 0], [int(0.25 * width), 0], [0, int(0.30 * height)]], dtype=np.int32)
    cv2.fillConvexPoly(mask, triangle, 255)


def _cable(mask: NDArray[np.uint8]) -> None:
    height, width = mask.shape
    u = np.linspace(0.0, width, 40)
    v = 0.25 * height + 0.35 * height * (u / width) ** 2
    curve = np.stack([u, v], axis=1).round().astype(np.int32)
    cv2.polylines(mask, [curve], False, 255, thickness=max(2, height // 150), lineType=cv2.LINE_AA)


def _bar(mask: NDArray[np.uint8]) -> None:
    width = mask.shape[1]
    mask[:, int(0.30 * width) : int(0.33 * width)] = 255


_SHAPES: dict[str, Callable[[NDArray[np.uint8]], None]] = {
    "gear": _gear,
    "corner": _corner,
    "cable": _cable,
    "bar": _bar,
}
NAMES = tuple(_SHAPES)
