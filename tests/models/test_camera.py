"""The two laws of the paper, kept apart, and the lens."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from axialnav.models.camera import (
    CompositeBlur,
    ExposureBlur,
    composite_law,
    exposure_law,
    exposure_ratio,
    metres_per_pixel,
    pinhole_pixels,
    undistorted_grid,
)

FOCAL_PX = 1.95e-3 / 3.24e-6
PERIOD_S, EXPOSURE_S, DISTANCE_M = 1.0 / 30.0, 0.010, 2.026


def test_the_papers_slope_is_the_composite_law() -> None:
    """0.0202 m/s per pixel: five frames at 30 Hz past a wall about 2.03 m away."""
    assert composite_law(CompositeBlur(1.0, 5, PERIOD_S), FOCAL_PX, DISTANCE_M) == pytest.approx(0.0202, rel=2e-3)


def test_both_laws_agree_about_one_motion() -> None:
    speed = 1.3
    displacement = speed * PERIOD_S / metres_per_pixel(FOCAL_PX, DISTANCE_M)
    exposure = ExposureBlur(displacement * exposure_ratio(EXPOSURE_S, PERIOD_S), EXPOSURE_S)
    composite = CompositeBlur(5 * displacement, 5, PERIOD_S)
    assert exposure_law(exposure, FOCAL_PX, DISTANCE_M) == pytest.approx(speed)
    assert composite_law(composite, FOCAL_PX, DISTANCE_M) == pytest.approx(speed)
    assert composite.displacement_px == pytest.approx(displacement)
    assert exposure.displacement_px(PERIOD_S) == pytest.approx(displacement)


def test_the_laws_cannot_be_mixed() -> None:
    with pytest.raises(TypeError, match="composite_law"):
        exposure_law(CompositeBlur(10.0, 5, PERIOD_S), FOCAL_PX, DISTANCE_M)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="exposure_law"):
        composite_law(ExposureBlur(10.0, EXPOSURE_S), FOCAL_PX, DISTANCE_M)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        exposure_law(10.0, FOCAL_PX, DISTANCE_M)  # type: ignore[arg-type]


def test_a_type_checker_refuses_to_mix_the_laws(tmp_path: Path) -> None:
    """GIVEN each law with its own length, the other's and a bare number THEN mypy passes the first line only."""
    source = tmp_path / "mix.py"
    source.write_text(
        "from axialnav.models.camera import CompositeBlur, ExposureBlur, composite_law, exposure_law\n"
        "exposure_law(ExposureBlur(3.0, 0.01), 600.0, 2.0); composite_law(CompositeBlur(50.0, 5, 0.1), 600.0, 2.0)\n"
        "exposure_law(CompositeBlur(50.0, 5, 0.1), 600.0, 2.0)\n"
        "composite_law(ExposureBlur(3.0, 0.01), 600.0, 2.0)\n"
        "exposure_law(3.0, 600.0, 2.0)\n"
        "composite_law(50.0, 600.0, 2.0)\n"
    )
    root = Path(__file__).parents[2]
    options = ["--cache-dir", os.devnull, "--config-file", os.devnull, "--follow-imports", "skip"]
    command = [sys.executable, "-m", "mypy", *options, "axialnav/models/camera.py", str(source)]
    printed = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False).stdout
    said = [line.partition("mix.py:")[2] for line in printed.splitlines() if "mix.py:" in line]
    assert [int(line.split(":")[0]) for line in said] == [3, 4, 5, 6]
    assert all("incompatible type" in line for line in said)


@pytest.mark.parametrize("length", [-1.0, float("nan"), float("inf")])
def test_impossible_lengths_are_refused(length: float) -> None:
    with pytest.raises(ValueError, match="blur length"):
        ExposureBlur(length, EXPOSURE_S)
    with pytest.raises(ValueError, match="blur length"):
        CompositeBlur(length, 5, PERIOD_S)


def test_impossible_cameras_are_refused() -> None:
    with pytest.raises(ValueError, match="exposure_s"):
        ExposureBlur(1.0, 0.0)
    with pytest.raises(ValueError, match="at least 2 frames"):
        CompositeBlur(1.0, 1, PERIOD_S)
    with pytest.raises(ValueError, match="positive"):
        metres_per_pixel(FOCAL_PX, 0.0)
    with pytest.raises(ValueError, match="period"):
        exposure_ratio(0.05, PERIOD_S)
    with pytest.raises(ValueError, match="3 numbers"):
        pinhole_pixels(np.zeros(1), np.zeros(1), (1.0, 1.0, 0.0, 0.0), (0.1, 0.2, 0.3))


def test_distortion_is_opencvs() -> None:
    rng, intrinsics = np.random.default_rng(1), (335.4, 336.1, 129.9, 99.2)
    coefficients = (-0.14, 0.09, -3e-4, 2e-4, 0.01)
    x, y = rng.uniform(-0.4, 0.4, (2, 200))
    points = np.stack([x, y, np.ones_like(x)], axis=1)
    fu, fv, cu, cv = intrinsics
    matrix = np.array([[fu, 0.0, cu], [0.0, fv, cv], [0.0, 0.0, 1.0]])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(coefficients))
    np.testing.assert_allclose(np.stack(pinhole_pixels(x, y, intrinsics, coefficients), 1), expected[:, 0], atol=1e-9)
    u, v = pinhole_pixels(x, y, intrinsics)
    back = undistorted_grid(u, v, intrinsics)
    np.testing.assert_allclose(back, (x, y), atol=1e-12)
