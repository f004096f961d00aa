"""Every analytic Jacobian against central differences over random states, in the filter's own error state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from axialnav.models.aiding import height, tilt
from axialnav.models.pixel_motion import pixel_motion
from axialnav.models.state import N_ERROR, WALL_OFFSET
from axialnav.models.uwb import uwb_position, uwb_range, uwb_tdoa
from axialnav.models.wall_range import wall_range
from tests.models.states import central_differences, random_state, rotation_of

Array = NDArray[np.float64]
STATES = 60
DOWN_BS = Rotation.from_euler("ZYX", [0.3, 0.1, np.pi - 0.2]).as_matrix()  # z of the sensor downwards, not exactly
LEVER_B = np.array([0.13, -0.07, 0.05])
ANCHORS = np.array([[-6.0, 5.0, 0.3], [7.0, -4.0, 2.5]])
FLOOR_W = np.array([0.0, 0.0, 1.0])
GYRO = np.array([0.4, -0.7, 0.9])


@dataclass(frozen=True)
class Model:
    """One scalar measurement: ``predict(x, R, H)`` writes its row into ``H``."""

    name: str
    predict: Callable[[Array, Array, Array], float]


def flow(axis: int, lever: Array, offset_is_state: bool, slope: float = 0.0) -> Callable[[Array, Array, Array], float]:
    def predict(x: Array, R: Array, H: Array) -> float:
        offset = x[WALL_OFFSET] if offset_is_state else -0.2
        focal_window = np.array([5.2, 4.1])
        return pixel_motion(
            x,
            x[:3],
            R,
            GYRO,
            DOWN_BS,
            lever,
            FLOOR_W,
            offset,
            offset_is_state,
            focal_window,
            axis,
            slope,
            H,
            np.empty(11),
        )

    return predict


def distance(lever: Array, offset_is_state: bool) -> Callable[[Array, Array, Array], float]:
    def predict(x: Array, R: Array, H: Array) -> float:
        offset = x[WALL_OFFSET] if offset_is_state else -0.2
        return wall_range(x[:3], R, DOWN_BS, lever, FLOOR_W, offset, offset_is_state, H, np.empty(8))

    return predict


def blur_length(x: Array, R: Array, H: Array) -> float:
    signed = flow(0, LEVER_B, True)(x, R, H)
    if signed < 0.0:
        H *= -1.0
    return abs(signed)


ZERO = np.zeros(3)
MODELS = [
    *(Model(f"flow {'xy'[a]}, offset {'state' if o else 'known'}, {'lever' if lv.any() else 'centre'}", flow(a, lv, o))
      for a in (0, 1) for lv in (ZERO, LEVER_B) for o in (False, True)),
    *(Model(f"flow {'xy'[a]} beside the optical axis", flow(a, LEVER_B, True, 0.4)) for a in (0, 1)),
    Model("blur length", blur_length),
    *(Model(f"range, offset {'state' if o else 'known'}, {'lever' if lv.any() else 'centre'}", distance(lv, o))
      for lv in (ZERO, LEVER_B) for o in (False, True)),
    *(Model(f"uwb range {i}", lambda x, R, H, i=i: uwb_range(x, x[:3], R, LEVER_B, ANCHORS[i], 3 + i, H))
      for i in (0, 1)),
    Model("uwb range difference", lambda x, R, H: uwb_tdoa(x, x[:3], R, LEVER_B, ANCHORS[0], ANCHORS[1], 6, 5, H)),
    *(Model(f"uwb position {'xyz'[i]}", lambda x, R, H, i=i: uwb_position(x, x[:3], R, LEVER_B, i, i, H))
      for i in (0, 1, 2)),
    Model("height", lambda x, R, H: height(x[:3], 12.0, H)),
    *(Model(f"tilt {name}", lambda x, R, H, i=i: tilt(R, i, H)) for i, name in enumerate(("roll", "pitch"))),
]  # fmt: skip


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_jacobian_is_the_derivative_of_the_prediction(model: Model) -> None:
    rng = np.random.default_rng(11)
    informed = np.zeros(N_ERROR, bool)
    for _ in range(STATES):
        x = random_state(rng)
        H = np.zeros(N_ERROR)
        value = model.predict(x, rotation_of(x).as_matrix(), H)
        assert np.isfinite(value)
        numerical = central_differences(
            lambda y: model.predict(y, rotation_of(y).as_matrix(), np.zeros(N_ERROR)), x, 1e-6
        )[0]
        np.testing.assert_allclose(H, numerical, rtol=1e-6, atol=1e-7 * max(1.0, np.abs(H).max()))
        informed |= H != 0.0
    assert informed.any()


def test_every_error_state_but_the_accelerometer_bias_is_seen_by_some_measurement() -> None:
    """The bias of the accelerometer shows only through the velocity it makes; path 7 speaks in none of them."""
    x = random_state(np.random.default_rng(12))
    seen = np.zeros(N_ERROR, bool)
    for model in MODELS:
        H = np.zeros(N_ERROR)
        model.predict(x, rotation_of(x).as_matrix(), H)
        seen |= H != 0.0
    assert list(np.flatnonzero(~seen)) == [12, 13, 14, 24]
