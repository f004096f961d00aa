"""Camera frames to compressed pictures, without loss unless it is asked for."""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np

from axialnav.fusion.readings import CameraFrame

PictureFormat = Literal["png", "jpeg"]
LOSSLESS_PNG = [  # a third of the time of the defaults and fewer bytes: the noise of a picture does not repeat itself
    *(cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY),
    *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_AVG),
]
JPEG_QUALITY = 95


class PictureEncoder:
    """Compresses frames.

    Parameters
    ----------
    form
        ``"png"`` keeps every bit, so that a flight replays to the same digest; ``"jpeg"`` is smaller and does not.
    """

    def __init__(self, form: PictureFormat = "png") -> None:
        self._form = form
        self._options = LOSSLESS_PNG if form == "png" else [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]

    def __call__(self, frame: CameraFrame) -> tuple[str, bytes]:
        """Format and bytes of a picture.

        Raises
        ------
        ValueError
            A picture that the format cannot hold.
        """
        image = np.ascontiguousarray(frame.image)
        try:
            done, data = cv2.imencode(f".{self._form}", image, self._options)
        except cv2.error as error:
            raise ValueError(f"a picture of {image.dtype} {image.shape} is no {self._form}") from error
        if not done:
            raise ValueError(f"a picture of {image.dtype} {image.shape} is no {self._form}")
        return self._form, data.tobytes()
