"""The part of the picture that is looked at, with the lens' distortion taken out of it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError
from axialnav.estimators.frames import Image
from axialnav.estimators.options import Region, check_camera, check_region
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
        If the region cannot be, does not lie within the camera's picture, or the distortion model is unknown.
    """

    def __init__(self, camera: Camera | None, roi: Region | None) -> None:
        check_camera(camera)
        check_region(roi)
        self._roi = roi
        self._size = None if camera is None else (camera.resolution[1], camera.resolution[0])
        if self._size is not None:
            self._require_region(*self._size)
        self._maps: tuple[NDArray[np.int16], NDArray[np.uint16]] | None = None
        if camera is not None and camera.distortion_model not in NONE and any(camera.distortion_coefficients):
            self._maps = _maps(camera, roi)

    def __call__(self, image: Image) -> Image:
        """View (a copy where the lens is undistorted) of the region.

        Raises
        ------
        FrameError
            If the frame is not of the camera's resolution, or does not contain the region.
        """
        height, width = image.shape
        if self._size is not None and (height, width) != self._size:
            raise FrameError(
                f"the frame is {width} x {height} px, the camera's resolution {self._size[1]} x {self._size[0]}; "
                "describe the camera in the mode it runs in"
            )
        self._require_region(height, width)
        if self._maps is not None:
            view: Image = cv2.remap(image, *self._maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
            return view
        if self._roi is not None:
            row, column, rows, columns = self._roi
            return image[row : row + rows, column : column + columns]
        return image

    def _require_region(self, height: int, width: int) -> None:
        if self._roi is None:
            return
        row, column, rows, columns = self._roi
        if row + rows > height or column + columns > width:
            raise FrameError(
                f"roi {self._roi} does not fit into a frame of {height} x {width} px; choose a smaller one"
            )


def _maps(camera: Camera, roi: Region | None) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
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
