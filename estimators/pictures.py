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


def decode_picture(data: bytes, where: str) -> NDArray[np.generic]:
    """Picture from its compressed bytes, with the channels and depth that it was stored with.

    Raises
    ------
    FrameError
        If the bytes cannot be decoded; ``where`` names them.
    """
    picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if picture is None:
        raise FrameError(f"{where}: a picture of {len(data)} bytes cannot be decoded; leave the camera out")
    return np.asarray(picture)


def video_shape(path: Path) -> tuple[int, int, int, float]:
    """Width, height [px], number of frames and frame rate [Hz] as the video's head says.

    Raises
    ------
    FrameError
        If the file cannot be opened or says no rate.
    """
    source = cv2.VideoCapture(str(path))
    try:
        keys = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FRAME_COUNT, cv2.CAP_PROP_FPS)
        width, height, count, rate_hz = (source.get(key) for key in keys)
    finally:
        source.release()
    if not (width > 0 and height > 0 and count > 0 and rate_hz > 0):
        raise FrameError(f"{path} cannot be opened as a video; re-encode it, or store the frames as PNG")
    return int(width), int(height), int(count), float(rate_hz)
