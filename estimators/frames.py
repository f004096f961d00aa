"""What may be handed in as frames, and the grey picture that is taken from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError
from axialnav.estimators.options import MIN_SIDE_PX, check_axis, check_count
from axialnav.estimators.result import MotionReason

Image = NDArray[np.unsignedinteger[Any]]
Frames = NDArray[np.generic] | Sequence[NDArray[np.generic]]
MAX_SATURATED = 0.2
DARK_DN = 1
FULL_DN = 255
PROBE = 8  # every 8th row decides about saturation and darkness


def luma(image: NDArray[np.generic]) -> Image:
    """Grey picture (h, w) of a grey (h, w), BGR (h, w, 3) or YUYV (h, w, 2) picture; a view where possible.

    BGR is reduced to its green channel: the sharpest one of a Bayer sensor, and a view instead of a pass over all
    pixels. YUYV holds its luma in channel 0.

    Raises
    ------
    FrameError
        If the picture is not uint8 or uint16, has another shape or a mask, or is smaller than 32 x 32.
    """
    if not isinstance(image, np.ndarray):
        raise FrameError(f"a frame must be a numpy array, got {type(image).__name__}; decode it first")
    if isinstance(image, np.ma.MaskedArray):
        raise FrameError("a frame must be a plain array, got a masked one; cut a region of interest out instead")
    if image.dtype not in (np.uint8, np.uint16):
        raise FrameError(f"a frame must be uint8 or uint16, got {image.dtype}; hand in the camera's own numbers")
    if image.ndim == 3 and image.shape[2] in (1, 2, 3):
        image = image[:, :, 1 if image.shape[2] == 3 else 0]
    if image.ndim != 2 or min(image.shape) < MIN_SIDE_PX:
        raise FrameError(
            f"a frame must be (h, w) grey, (h, w, 3) BGR or (h, w, 2) YUYV with sides of at least {MIN_SIDE_PX} px, "
            f"got shape {image.shape}"
        )
    return cast(Image, image)


def frame_stack(
    frames: Frames, axis: str, least: int, method: str, view: Callable[[Image], Image] | None = None
) -> list[Image]:
    """Grey frames of one shape with the axis of motion along the rows.

    Parameters
    ----------
    frames
        (N, h, w) or a sequence of frames.
    axis
        ``"x"`` (along the rows) or ``"y"`` (down the columns).
    least
        Smallest usable N.
    method
        Name of the method that needs so many.
    view
        What is done to every grey picture first; None: nothing.

    Raises
    ------
    FrameError
        If these are no frames, too few or too many, their shapes or types differ, or the axis has another name.
    """
    check_axis(axis)
    if not isinstance(frames, Sequence) and np.ndim(frames) < 3:
        what = f"shape {frames.shape}" if isinstance(frames, np.ndarray) else type(frames).__name__
        raise FrameError(f"frames must be an array (N, h, w) or a list of pictures, got {what}")
    check_count(len(frames), least, method)
    stack = [luma(frame) for frame in frames]
    kinds = {(frame.shape, frame.dtype.name) for frame in stack}
    if len(kinds) != 1:
        raise FrameError(f"all frames must have one size and one type, got {sorted(map(str, kinds))}")
    if view is not None:
        stack = [view(frame) for frame in stack]
    return stack if axis == "x" else [np.ascontiguousarray(frame.T) for frame in stack]


def unusable(image: Image) -> str:
    """Why one picture cannot hold a displacement (black, saturated, constant); "" if it can.

    A sensor of any depth saturates at a number of the form 2^n - 1.
    """
    probed = image[::PROBE]
    low, top = (int(value) for value in cv2.minMaxLoc(probed)[:2])
    if top <= DARK_DN and int(image.max()) <= DARK_DN:
        return MotionReason.DARK
    if top >= FULL_DN and top & (top + 1) == 0 and np.count_nonzero(probed == top) > MAX_SATURATED * probed.size:
        return MotionReason.SATURATED
    if low == top and int(image.min()) == int(image.max()):
        return MotionReason.NO_TEXTURE
    return ""


def same_picture(first: NDArray[Any], second: NDArray[Any]) -> bool:
    """Whether two pictures of one size are equal pixel by pixel; noise in the middle row usually tells at once."""
    row = first.shape[0] // 2
    return np.array_equal(first[row], second[row]) and np.array_equal(first, second)
