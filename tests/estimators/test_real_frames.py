"""Frames that nobody here made: a slider past a poster, and a hand-held camera over a floor."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from axialnav.estimators.estimate import estimate_motion
from axialnav.estimators.spectral import fit_single
from axialnav.replay.flight import load_flight
from axialnav.replay.motion import run_motion
from axialnav.replay.motion_table import score
from tests.bench.handheld import exposed, measure_pairs, read_floor
from tests.bench.slider import compare

pytestmark = pytest.mark.flights
POSTER_M = 0.603


def test_the_slider_runs_at_the_speed_it_was_set_to(shared: Path) -> None:
    run = run_motion(load_flight(shared / "flights" / "davis_slider_far"), distance_m=POSTER_M)
    in_metres = score(run, "m/s")
    assert in_metres is not None
    assert in_metres.used >= 125
    assert in_metres.mean_error == pytest.approx(0.0, abs=0.005 * in_metres.mean_truth)


@pytest.mark.slow
def test_sigma_covers_what_the_motor_of_the_slider_does_not_record(shared: Path) -> None:
    """The posters are not flat and the carriage gives a kick every 67 mm; both are known from other frames.

    GIVEN windows that miss the motor's record by several sigma WHEN they are compared with frames of the same wall that
    move as other pairs of frames say, and with the kicks of other turns THEN they are right, and so is their sigma.
    """
    flight = load_flight(shared / "flights" / "davis_slider_far")
    seen = compare(flight, run_motion(flight, distance_m=POSTER_M), every=3)
    record, wall, all_known = np.sqrt(np.mean(((seen.value - seen.expected) / seen.sigma) ** 2, axis=1))
    assert len(seen.value) >= 35
    assert 0.6 < all_known < 1.5 < record / 2
    assert all_known < wall < record
    assert np.mean(seen.value - seen.expected[2]) == pytest.approx(0.0, abs=0.005)
    assert seen.period == pytest.approx(8.8, abs=0.1)
    assert seen.repeats > 0.6


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


def test_the_composite_reads_the_slider_and_refuses_only_what_is_wrong(shared: Path) -> None:
    flight = load_flight(shared / "flights" / "davis_slider_far")
    joint, composite = (run_motion(flight, method=name, distance_m=POSTER_M) for name in ("joint", "composite"))
    both = joint.accepted() & composite.accepted()
    share = composite.values("displacement_px")[both] / np.abs(joint.values("displacement_px")[both]) - 1.0
    assert composite.accepted().mean() > 0.85
    assert np.abs(share).max() < 0.05
    assert np.median(np.abs(share)) < 0.01


def _floor_frames(folder: Path) -> tuple[np.ndarray, dict[int, dict[str, float]]]:
    """Frames at 240 per second (n, h, w), and the shifts registered by others' means."""
    with (folder / "shifts.csv").open() as file:
        rows = {int(row["frame"]): {key: float(value) for key, value in row.items()} for row in csv.DictReader(file)}
    frames = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted(folder.glob("f*.png"))]
    return np.stack(frames), rows


def test_exposures_of_a_hand_held_camera_agree_with_two_registrations(shared: Path) -> None:
    """GIVEN three fast frames averaged into 12.5 ms WHEN two of them 33 ms apart are compared THEN shifts agree.

    The floor moves by 1 px more at one end of the picture than at the other, so that registrations do not agree with
    one another either.
    """
    floor = read_floor(shared / "frames_240fps")
    seen = measure_pairs(floor, 3)
    assert len(seen.value) >= 18
    for registered in (seen.shifts, seen.tracked):
        off = np.abs(seen.value - registered)
        assert np.median(off) < 0.12
        assert off.max() < 0.35


def test_exposures_that_last_all_the_time_are_refused_where_the_camera_changes_its_speed(shared: Path) -> None:
    """Averages of 8: nowhere here is the motion even over two of them, it changes by a pixel and more a fast frame."""
    seen = measure_pairs(read_floor(shared / "frames_240fps"), 8)
    assert len(seen.value) < 0.3 * seen.pairs
    assert seen.gross == 0
    assert np.abs(seen.value - seen.shifts).max() < 1.5


def test_the_blur_of_one_real_exposure_is_what_registration_says(shared: Path) -> None:
    """The floor moves 15 degrees off the rows: the picture is turned until it does not."""
    frames, rows = _floor_frames(shared / "frames_240fps")
    found = []
    for k in range(0, 46):
        path = np.sum([(rows[k + i]["dx1"], rows[k + i]["dy1"]) for i in range(3)], axis=0)
        degrees, size = np.degrees(np.arctan2(path[1], path[0])), frames.shape[:0:-1]
        turn = cv2.getRotationMatrix2D((size[0] / 2, size[1] / 2), degrees, 1.0)
        level = cv2.warpAffine(exposed(frames, k, 3), turn, size, flags=cv2.INTER_CUBIC)[60:240, 70:450]
        estimate = fit_single([level], 3 / 240, 3 / 240, highest_frequency=0.2)
        if estimate.accepted:
            found.append(estimate.displacement_px - np.hypot(*path))
    assert len(found) >= 1
    assert np.abs(found).max() < 1.5


def test_a_hand_held_camera_agrees_with_registration(shared: Path) -> None:
    """240 frames per second, painted floor, grey levels within 3: shifts registered by others' means."""
    frames, rows = _floor_frames(shared / "frames_240fps")
    errors = []
    for k in range(0, len(frames) - 4, 2):
        estimate = estimate_motion([frames[k], frames[k + 4]], frame_period_s=4 / 240)
        if estimate.accepted and k in rows:
            errors.append(abs(estimate.displacement_px - rows[k]["dx4"]))
    assert len(errors) >= 15
    assert np.median(errors) < 0.1
    assert max(errors) < 1.0
