"""How the camera moves past the wall, told as the motion of the picture in pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """Motion of the wall's picture during one window of frames.

    Displacements are those of the picture's content, positive to the right and down (as a flow sensor counts); time
    is counted in frame periods from the middle of the window, so that ``displacement_px`` is the mean over it.

    Parameters
    ----------
    displacement_px
        Along the rows, per frame period [px].
    acceleration_px
        Change of the displacement per frame period [px].
    drift_px
        Down the columns, per frame period [px].
    jitter_px
        Independent x error of every frame, standard deviation [px]: unmeasured yaw.
    roll_jitter_rad
        Independent roll of every frame about the optical axis, standard deviation [rad].
    roll_rate_rad
        Steady roll about the optical axis per frame period, level in the middle of the window [rad].
    yaw_rad
        Constant angle between the optical axis and the wall's normal [rad].
    frame_times
        When each frame is taken [periods]; None for 0, 1, 2 ... A dropped frame leaves out a number, a duplicated
        one repeats it.
    """

    displacement_px: float = 0.0
    acceleration_px: float = 0.0
    drift_px: float = 0.0
    jitter_px: float = 0.0
    roll_jitter_rad: float = 0.0
    roll_rate_rad: float = 0.0
    yaw_rad: float = 0.0
    frame_times: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        numbers = (self.displacement_px, self.acceleration_px, self.drift_px, self.jitter_px)
        rolls = (self.roll_jitter_rad, self.roll_rate_rad)
        if not all(math.isfinite(number) for number in (*numbers, *rolls)):
            raise ConfigError(f"every motion of a trajectory must be finite, got {self}")
        if not abs(self.yaw_rad) <= MAX_YAW_RAD:
            raise ConfigError(
                f"yaw_rad must lie within +-{MAX_YAW_RAD:.2f} rad, got {self.yaw_rad}; "
                "beyond it the camera looks past the wall"
            )

    def path(self, frames: int, rng: np.random.Generator) -> Path:
        """Draw the random parts for ``frames`` frames.

        Raises
        ------
        ConfigError
            If ``frames`` is not positive or differs from the number of ``frame_times``.
        """
        times = tuple(float(k) for k in range(frames)) if self.frame_times is None else self.frame_times
        if frames < 1 or len(times) != frames:
            raise ConfigError(f"asked for {frames} frames, but the trajectory has {len(times)} frame times")
        middle = 0.5 * (max(times) + min(times))
        jitter = self.jitter_px * rng.standard_normal(frames)
        roll = self.roll_jitter_rad * rng.standard_normal(frames) + self.roll_rate_rad * (np.array(times) - middle)
        for k in range(1, frames):
            if times[k] == times[k - 1]:  # the same picture delivered twice
                jitter[k], roll[k] = jitter[k - 1], roll[k - 1]
        return Path(self, np.array(times) - middle, jitter, roll)


MAX_YAW_RAD = 0.35


@dataclass(frozen=True)
class Path:
    """A trajectory with its random parts drawn; times in periods from the middle of the window.

    Parameters
    ----------
    trajectory
        What was asked for.
    times
        Middle of every exposure [periods], shape (n,).
    jitter_px, roll_rad
        Drawn x error [px] and roll [rad] of every frame, shape (n,).
    """

    trajectory: Trajectory
    times: Array
    jitter_px: Array
    roll_rad: Array

    def position_px(self, frame: int, delay: Array) -> tuple[Array, Array]:
        """Where the wall's picture is, ``delay`` [periods] after the middle of a frame's exposure: x and y [px]."""
        time = self.times[frame] + delay
        motion = self.trajectory
        x = motion.displacement_px * time + 0.5 * motion.acceleration_px * time**2 + self.jitter_px[frame]
        return x, motion.drift_px * time

    def middle_px(self) -> Array:
        """Positions at the middle of every exposure [px], shape (n, 2)."""
        return np.array([np.hstack(self.position_px(k, np.zeros(1))) for k in range(len(self.times))])


def displacement_px(focal_px: float, velocity_m_s: float, distance_m: float, period_s: float) -> float:
    """Picture motion ``f v T / Z`` per frame period [px] for a picture that moves at ``velocity_m_s`` [m/s].

    A camera that flies to its own right sees the wall move to the left: pass the negative of its velocity.

    Raises
    ------
    ConfigError
        If focal length, distance or period is not positive.
    """
    if not (focal_px > 0.0 and distance_m > 0.0 and period_s > 0.0):
        raise ConfigError(
            f"focal_px, distance_m and period_s must be positive, got {focal_px}, {distance_m} and {period_s}"
        )
    return focal_px * velocity_m_s * period_s / distance_m


def dropped_frame(frames: int, after: int) -> tuple[float, ...]:
    """Frame times with one frame missing after frame number ``after``."""
    return tuple(float(k + (k > after)) for k in range(frames))


def duplicated_frame(frames: int, after: int) -> tuple[float, ...]:
    """Frame times in which the frame after number ``after`` repeats it."""
    return tuple(float(k - (k > after)) for k in range(frames))
