"""Frames from files: one picture per frame, or a video."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError


def read_picture(path: Path) -> NDArray[np.generic]:
    """Grey picture of a file, 8 or 16 bit as stored.

    Raises
    ------
    FrameError
        If the file cannot be decoded.
    """
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    if picture is None:
        raise FrameError(f"{path} cannot be decoded as a picture; replace it or remove its row from data.csv")
    image: NDArray[np.generic] = picture
    return image


def read_video(path: Path) -> Iterator[NDArray[np.generic]]:
    """Frames of a video, BGR, in order.

    Raises
    ------
    FrameError
        If the file cannot be opened.
    """
    source = cv2.VideoCapture(str(path))
    if not source.isOpened():
        raise FrameError(f"{path} cannot be opened as a video; re-encode it, or store the frames as PNG")
    try:
        good, frame = source.read()
        while good:
            yield frame
            good, frame = source.read()
    finally:
        source.release()
