"""How far apart parts of a picture may move and still be taken for one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift

from axialnav.estimators.estimate import estimate_motion
from axialnav.estimators.result import MotionEstimate

HEIGHT, WIDTH, FRAMES, MOTION_PX = 120, 320, 5, 3.0
PERIOD_S = 1.0 / 30.0


def wall(seed: int, smooth_px: float) -> NDArray[np.float64]:
    """Texture of unit variance, wider than the picture."""
    grey = gaussian_filter(np.random.default_rng(seed).normal(size=(HEIGHT, 2 * WIDTH)), smooth_px, mode="wrap")
    return grey / grey.std()


def seen(apart_px: float, contrast_dn: float, smooth_px: float = 1.5) -> MotionEstimate:
    """Estimate from frames whose right fifth moves ``apart_px`` more per frame than the rest."""
    rest, part = wall(1, smooth_px), wall(2, smooth_px)
    edge, rng, frames = 4 * WIDTH // 5, np.random.default_rng(3), []
    for k in range(FRAMES):
        moved = [
            shift(one, (0.0, motion * (k - 2)), order=3, mode="grid-wrap")[:, :WIDTH]
            for one, motion in ((rest, MOTION_PX), (part, MOTION_PX + apart_px))
        ]
        moved[0][:, edge:] = moved[1][:, edge:]
        light = 110.0 + contrast_dn * moved[0] + 2.4 * rng.normal(size=moved[0].shape)
        frames.append(np.clip(np.rint(light), 0, 255).astype(np.uint8))
    return estimate_motion(np.stack(frames), frame_period_s=PERIOD_S, exposure_s=0.001)


def test_a_part_that_moves_otherwise_pulls_the_hardest_at_the_offset_that_is_told() -> None:
    told = seen(0.0, 12.0).coherence_px
    offset = told * np.array([0.3, 0.65, 1.0, 1.5, 2.5])
    pull = np.array([seen(apart, 12.0).displacement_px - MOTION_PX for apart in offset.tolist()])
    assert int(np.argmax(pull)) == 2
    assert pull[-1] < 0.6 * pull.max()


@pytest.mark.parametrize(("contrast_dn", "smooth_px"), [(0.6, 1.5), (12.0, 5.0)])
def test_walls_that_are_nearly_blank_or_blurred_hold_together_farther(contrast_dn: float, smooth_px: float) -> None:
    assert seen(0.0, contrast_dn, smooth_px).coherence_px > 1.3 * seen(0.0, 12.0).coherence_px
