"""Frames that nobody here made: a slider past a poster, and a hand-held camera over a floor."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from axialnav.estimators.estimate import estimate_motion
from axialnav.replay.flight import load_flight
from axialnav.replay.motion import run_motion
from axialnav.replay.motion_table import score

pytestmark = pytest.mark.flights
POSTER_M = 0.603


def test_the_slider_runs_at_the_speed_it_was_set_to(shared: Path) -> None:
    run = run_motion(load_flight(shared / "flights" / "davis_slider_far"), distance_m=POSTER_M)
    in_metres = score(run, "m/s")
    assert in_metres is not None
    assert in_metres.used >= 125
    assert in_metres.mean_error == pytest.approx(0.0, abs=0.005 * in_metres.mean_truth)


def test_sigma_is_honest_on_real_frames(shared: Path) -> None:
    """Upper and lower half of the poster are two measurements of one motion.

    They differ by up to 3 % because the halves are not equally far, slowly over the run; from one window to the next
    the difference changes by no more than the sigmas allow.
    """
    flight = load_flight(shared / "flights" / "davis_slider_far")
    names = flight.tables["cam0"].columns["filename"].tolist()[10:120]
    frames = [cv2.imread(str(flight.path / "mav0/cam0/data" / name), cv2.IMREAD_GRAYSCALE) for name in names]
    gaps, sigmas = [], []
    for k in range(0, len(frames) - 5, 5):
        halves = [
            estimate_motion([f[rows] for f in frames[k : k + 5]], frame_period_s=0.0466)
            for rows in (slice(0, 90), slice(90, 180))
        ]
        if all(half.accepted for half in halves):
            gaps.append(halves[0].displacement_px - halves[1].displacement_px)
            sigmas.append(np.hypot(halves[0].sigma_px, halves[1].sigma_px))
    assert len(gaps) >= 10
    changes = np.diff(gaps) / np.hypot(sigmas[1:], sigmas[:-1])
    assert np.sqrt(np.mean(changes**2)) < 2.0


def test_a_hand_held_camera_agrees_with_registration(shared: Path) -> None:
    """240 frames per second, painted floor, grey levels within 3: shifts registered by others' means."""
    folder = shared / "frames_240fps"
    with (folder / "shifts.csv").open() as file:
        rows = {int(row["frame"]): row for row in csv.DictReader(file)}
    frames = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted(folder.glob("f*.png"))]
    errors = []
    for k in range(0, len(frames) - 4, 2):
        estimate = estimate_motion([frames[k], frames[k + 4]], frame_period_s=4 / 240)
        if estimate.accepted and k in rows:
            errors.append(abs(estimate.displacement_px - float(rows[k]["dx4"])))
    assert len(errors) >= 15
    assert np.median(errors) < 0.1
    assert max(errors) < 1.0
