"""The part of the picture that is looked at, with the lens' distortion taken out of it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError
from axialnav.estimators.frames import MIN_SIDE_PX, Image
from axialnav.models.camera import RADTAN, pinhole_pixels, undistorted_grid
from axialnav.models.rig import Camera

NONE = ("none", "")
RADTAN_NAMES = (RADTAN, "radtan", "plumb_bob")


class CentralView:
    """Cut a region of interest out of a frame and undistort it.

    The undistorted picture keeps the camera's focal length and principal point, so that displacements in it obey the
    pinhole law.  Only the region itself is computed.

    Parameters
    ----------
    camera
        Camera with a distortion model, or None to leave the picture as it is.
    roi
        First row, first column, rows, columns [px]; None for the whole picture.

    Raises
    ------
    FrameError
        If the region is too small or the distortion model unknown.
    """

    def __init__(self, camera: Camera | None, roi: tuple[int, int, int, int] | None) -> None:
        if roi is not None and (min(roi[:2]) < 0 or min(roi[2:]) < MIN_SIDE_PX):
            raise FrameError(
                f"roi must be (row, column, rows, columns) with sides of at least {MIN_SIDE_PX} px, got {roi}"
            )
        self._roi = roi
        self._maps: tuple[NDArray[np.int16], NDArray[np.uint16]] | None = None
        if camera is not None and camera.distortion_model not in NONE and any(camera.distortion_coefficients):
            self._maps = _maps(camera, roi)

    def __call__(self, image: Image) -> Image:
        """View (a copy where the lens is undistorted) of the region.

        Raises
        ------
        FrameError
            If the frame does not contain the region.
        """
        if self._roi is not None:
            row, column, rows, columns = self._roi
            if row + rows > image.shape[0] or column + columns > image.shape[1]:
                raise FrameError(f"roi {self._roi} does not fit into a frame of {image.shape[0]} x {image.shape[1]} px")
        if self._maps is not None:
            view: Image = cv2.remap(image, *self._maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
            return view
        if self._roi is not None:
            return image[row : row + rows, column : column + columns]
        return image


def _maps(camera: Camera, roi: tuple[int, int, int, int] | None) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
    if camera.distortion_model not in RADTAN_NAMES:
        raise FrameError(
            f"distortion model {camera.distortion_model!r} is not known; choose {RADTAN!r} or 'none', "
            "or switch undistortion off"
        )
    width, height = camera.resolution
    row, column, rows, columns = roi or (0, 0, height, width)
    v, u = np.mgrid[row : row + rows, column : column + columns].astype(np.float64)
    x, y = undistorted_grid(u, v, camera.intrinsics)
    u_raw, v_raw = pinhole_pixels(x, y, camera.intrinsics, camera.distortion_coefficients)
    maps: tuple[NDArray[np.int16], NDArray[np.uint16]] = cv2.convertMaps(
        u_raw.astype(np.float32), v_raw.astype(np.float32), cv2.CV_16SC2
    )
    return maps
