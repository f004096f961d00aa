"""Frames that follow each other evenly, told from those of which one is missing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from axialnav.estimators.spectral import composite, fit_composite
from axialnav.estimators.spectral.copies import wall_copies
from axialnav.estimators.spectral.steps import surely_even
from axialnav.replay.simulate.render import dropped_frame
from tests.estimators.scenes import PERIOD_S, rendered

SLOW_PX = (0.6, 0.8, 1.2, 2.0)


def even(frames: NDArray[np.uint8]) -> bool:
    copies = wall_copies(list(frames))[0]
    assert copies is not None
    return surely_even(copies)


@pytest.mark.parametrize("displacement_px", SLOW_PX)
def test_a_missing_frame_is_told_from_even_motion_wherever_it_is_missing(displacement_px: float) -> None:
    def seen(**times: tuple[float, ...]) -> bool:
        return even(rendered(displacement_px, 1200, bright=True, contrast=0.1, **times).frames)

    assert seen()
    assert not any(seen(frame_times=dropped_frame(5, gap)) for gap in range(3))


def test_slow_walls_are_read_because_the_frames_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the look at the frames they are refused: the comb alone does not tell."""
    scenes = [(0.7, True), (0.9, True), (1.2, False), (1.6, False)]
    pictures = [rendered(speed, 1210, bright=bright, contrast=0.1).frames for speed, bright in scenes]
    read = [fit_composite(frames, PERIOD_S) for frames in pictures]
    assert [e.displacement_px for e in read] == pytest.approx([speed for speed, _ in scenes], rel=0.03)
    monkeypatch.setattr(composite, "surely_even", lambda _: False)
    assert not any(fit_composite(frames, PERIOD_S).accepted for frames in pictures)


def test_frames_that_do_not_move_prove_nothing() -> None:
    noise = np.random.default_rng(1).normal(100.0, 8.0, (5, 360, 640)).astype(np.uint8)
    assert not even(noise)
    assert not even(rendered(0.0, 1220, bright=True, contrast=0.1).frames)
