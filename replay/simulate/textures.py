"""The wall photographs that come with the package; their licences are in ``textures/LICENSES.md``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError

FOLDER = Path(__file__).parent / "textures"
NAMES = ("concrete", "near_blank", "plaster", "rock")
SHADING_SHARE = 8  # shading slower than width / SHADING_SHARE belongs to the photographer's lamp, not to the wall
THUMBNAIL = 16  # shading is found on a picture this much smaller


def load_texture(name: str) -> NDArray[np.float32]:
    """Texture of one shipped photograph, its shading removed, zero mean and unit variance.

    Parameters
    ----------
    name
        One of ``NAMES``.

    Returns
    -------
    ndarray, shape (h, w)
        Grey values in standard deviations [-].

    Raises
    ------
    ConfigError
        If there is no such photograph or it cannot be decoded.
    """
    path = FOLDER / f"{name}.jpg"
    if name not in NAMES or not path.is_file():
        raise ConfigError(f"there is no wall photograph named {name!r}; choose from {', '.join(NAMES)}")
    grey = cv2.imdecode(np.frombuffer(path.read_bytes(), dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    if grey is None:
        raise ConfigError(f"{path} is not a readable JPEG; reinstall the package")
    return standardised(grey.astype(np.float32))


def standardised(grey: NDArray[np.float32]) -> NDArray[np.float32]:
    """Grey photograph (h, w) [DN] without slow shading, zero mean and unit variance [-]."""
    size = (max(1, grey.shape[1] // THUMBNAIL), max(1, grey.shape[0] // THUMBNAIL))
    thumbnail = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    smooth = cv2.GaussianBlur(thumbnail, (0, 0), size[0] / SHADING_SHARE)
    shading = cv2.resize(smooth, grey.shape[::-1], interpolation=cv2.INTER_LINEAR)
    texture = grey - shading
    texture -= texture.mean()
    return np.asarray(texture / texture.std(), dtype=np.float32)
