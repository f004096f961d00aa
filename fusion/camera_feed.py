"""Camera frames on their way into the filter: neighbouring frames become pixel motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ReadingError
from axialnav.fusion.readings import CameraFrame, PixelMotion
from axialnav.models.rig import Camera, Imu

if TYPE_CHECKING:
    from axialnav.estimators.streaming import MotionEstimator


USUAL_IMU_HZ = 200.0


class CameraFeed:
    """One image-motion estimator per camera that looks at a described surface."""

    def __init__(self, config: Config) -> None:
        self._cameras: dict[str, MotionEstimator] = {}
        self._config = config
        self._periods = config.camera.frames - 1
        for name, spec in config.sensor.items():
            if isinstance(spec, Camera) and spec.surface is not None:
                self._cameras[name] = _motion_estimator(spec, config)

    def push(self, frame: CameraFrame) -> PixelMotion | None:
        """Pixel motion of the window that ``frame`` completes, or None where there is none to be believed.

        The displacement is per frame period and a mean over the window, at whose middle it is stamped.

        Raises
        ------
        ReadingError
            The camera is not configured with a surface.
        FrameError
            The picture cannot be used or its stamp does not follow the previous one.
        """
        if frame.sensor not in self._cameras:
            known = ", ".join(self._cameras) or "none"
            raise ReadingError(
                f"no camera named {frame.sensor!r} looks at a surface; there are {known}; "
                f'describe it as [sensor.{frame.sensor}] with kind = "camera" and surface'
            )
        estimate = self._cameras[frame.sensor].push(frame.t_ns, frame.image, frame.exposure_s)
        if estimate is None or not estimate.accepted or estimate.t_ns is None:
            return None
        period_s = estimate.window_s / self._periods
        seen = math.isfinite(estimate.cross_px)
        rotation_px = [rotation_sigma_px(self._config, frame.sensor, period_s, axis) for axis in range(2)]
        return PixelMotion(
            t_ns=estimate.t_ns,
            sensor=frame.sensor,
            window_s=period_s,
            dx_px=estimate.displacement_px,
            dy_px=estimate.cross_px if seen else None,
            sigma_px=math.hypot(estimate.sigma_px, rotation_px[0]),
            sigma_dy_px=math.hypot(estimate.cross_sigma_px, rotation_px[1]) if seen else None,
            coherence_px=estimate.coherence_px if math.isfinite(estimate.coherence_px) else None,
        )


def rotation_sigma_px(config: Config, camera: str, period_s: float, axis: int = 0) -> float:
    """What the gyro's noise makes of the image's rotation over a frame period, along one of its axes [px].

    The filter takes the rotation out with the mean rate over the period, so that the noise of that mean is noise of the
    reading: ``f T`` times density over the root of the period, or of the sampling period where that is longer.
    """
    imu = next((s for n, s in config.sensor.items() if isinstance(s, Imu) and n not in config.disabled), None)
    spec = config.sensor[camera]
    if imu is None or not isinstance(spec, Camera):
        return 0.0
    rate_hz = min(imu.rate_hz or USUAL_IMU_HZ, 1.0 / period_s)
    mean = imu.gyro_noise_density * config.imu.gyro_noise_scale * math.sqrt(rate_hz)
    return spec.focal_px[axis] * period_s * mean


def _motion_estimator(camera: Camera, config: Config) -> MotionEstimator:
    from axialnav.estimators.streaming import MotionEstimator  # brings OpenCV, which vehicles without camera can spare

    return MotionEstimator(camera, frames=config.camera.frames, method=config.camera.method)
