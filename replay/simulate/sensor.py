"""From light on the sensor to the picture that leaves the camera."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.exposure import flicker_gain, row_delays
from axialnav.replay.simulate.noise import expose, jpeg
from axialnav.replay.simulate.occluders import occluder
from axialnav.replay.simulate.optics import fixed_pattern, light_falloff
from axialnav.replay.simulate.scene import Scene


class Sensor:
    """One camera with its own fixed pattern, occluders and lamp.

    Parameters
    ----------
    scene
        What is rendered.
    rng
        Draws the fixed pattern, the occluders' surfaces and the lamp's phase.
    """

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        camera, disturbance = scene.camera, scene.disturbance
        size = (camera.height, camera.width)
        self._scene = scene
        self._phase = float(rng.uniform(0.0, 2.0 * math.pi))
        self._occluders = [occluder(name, *size, rng) for name in disturbance.occluders]
        self._gain: NDArray[np.float32] | None = None
        if camera.vignette or disturbance.lamp_spot:
            self._gain = light_falloff(*size, camera.vignette, disturbance.lamp_spot)
        if camera.pixel_pattern or camera.column_pattern:
            pattern = fixed_pattern(*size, camera.pixel_pattern, camera.column_pattern, rng)
            self._gain = pattern if self._gain is None else self._gain * pattern

    def picture(self, light: NDArray[np.float32], time: float, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Picture (h, w) from relative light (h, w) at ``time`` [frame periods]."""
        for opacity, own in self._occluders:
            light = light + opacity * (own - light)
        if self._gain is not None:
            light = light * self._gain
        lamp = self._lamp(time, rng)
        if lamp is not None:
            light = light * lamp
        camera = self._scene.camera
        image = expose(np.ascontiguousarray(light), self._scene.light, rng, camera.gamma)
        return image if camera.jpeg_quality is None else jpeg(image, camera.jpeg_quality)

    def _lamp(self, time: float, rng: np.random.Generator) -> NDArray[np.float32] | None:
        """Brightness of every row, shape (h, 1), or None for steady light."""
        disturbance, camera = self._scene.disturbance, self._scene.camera
        if not (disturbance.flicker_depth or disturbance.gain_jitter):
            return None
        times = time + row_delays(camera.height, camera.readout_ratio)
        cycles = disturbance.flicker_hz * camera.frame_period_s
        gain = flicker_gain(times, disturbance.flicker_depth, cycles, self._phase, camera.exposure_ratio)
        gain *= max(0.0, 1.0 + disturbance.gain_jitter * rng.standard_normal())
        return np.asarray(gain[:, None], dtype=np.float32)
