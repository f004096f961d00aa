"""Descriptions of sensors: what they refuse, and that the refusal says what is wrong."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from axialnav.models.rig import AnySensor, Flow, Imu, RangeFinder, Surface, Uwb


def transform(rotation, lever=(0.0, 0.0, 0.0)):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, lever
    return tuple(T.ravel().tolist())


def test_rotation_and_lever_arm_are_read_row_by_row() -> None:
    R = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1]).as_matrix()
    imu = Imu(T_BS=transform(R, (0.1, 0.2, 0.3)))
    np.testing.assert_array_equal(imu.rotation_BS, R)
    np.testing.assert_array_equal(imu.lever_arm_m, [0.1, 0.2, 0.3])


def test_what_is_handed_out_cannot_change_the_description() -> None:
    imu = Imu()
    imu.rotation_BS[0, 0] = 9.0
    imu.lever_arm_m[0] = 9.0
    assert imu == Imu()


@pytest.mark.parametrize(
    ("rotation", "hint"),
    [
        (np.diag([1.0, 1.0, -1.0]), "det R is -1"),
        (1.1 * np.eye(3), "differs from the identity by 0.21"),
        (np.zeros((3, 3)), "differs from the identity by 1"),
        (np.eye(3) + np.triu(np.full((3, 3), 0.01), 1), "check rows and signs"),
    ],
    ids=["mirrored", "scaled", "zero", "sheared"],
)
def test_what_is_not_a_rotation_is_refused(rotation, hint: str) -> None:
    with pytest.raises(ValueError, match="right-handed rotation") as refusal:
        Imu(T_BS=transform(rotation))
    assert hint in str(refusal.value)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("place", [0, 3])
def test_numbers_of_a_transform_are_finite(place: int, bad: float) -> None:
    T = np.eye(4).ravel()
    T[place] = bad
    with pytest.raises(ValueError, match=rf"T_BS\.{place} must be a finite number"):
        Imu(T_BS=tuple(T.tolist()))


def test_rounding_in_a_calibration_file_is_accepted() -> None:
    R = np.round(Rotation.from_euler("ZYX", [0.3, -0.2, 0.1]).as_matrix(), 4)
    assert Imu(T_BS=transform(R)).rotation_BS[0, 0] == R[0, 0]


@pytest.mark.parametrize("normal", [(0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 1.0, 0.0), (float("nan"), 0.0, 1.0)])
def test_a_surface_needs_a_unit_normal(normal) -> None:
    with pytest.raises(ValueError, match="must have length 1"):
        Surface(normal=normal)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        ({"kind": "imu", "accel_noise_density": 0.0}, "> 0.0"),
        ({"kind": "imu", "gyro_noise_density": -1e-3}, "> 0.0"),
        ({"kind": "imu", "T_BS": [1.0] * 15}, "length >= 16"),
        ({"kind": "flow", "focal_px": [500.0, 500.0]}, "missing required field `surface`"),
        ({"kind": "flow", "focal_px": [0.0, 500.0], "surface": "floor"}, "> 0.0"),
        ({"kind": "range", "surface": "floor", "range_max_m": 0.0}, "> 0.0"),
        ({"kind": "uwb", "measurement": "aoa"}, "aoa"),
        ({"kind": "uwb", "measurement": "range", "anchors": {"a": [0.0, 1.0]}}, "length 3"),
        ({"kind": "blur", "focal_px": [500.0, 500.0], "surface": "wall", "law": "both"}, "both"),
        ({"kind": "sonar"}, "sonar"),
        ({"kind": "imu", "acel_noise_density": 1.0}, "unknown field `acel_noise_density`"),
    ],
)
def test_a_description_that_cannot_be_used_is_refused(data, complaint: str) -> None:
    with pytest.raises(msgspec.ValidationError) as refusal:
        msgspec.convert(data, AnySensor)
    assert complaint in str(refusal.value)


def test_kinds_choose_the_class() -> None:
    assert isinstance(msgspec.convert({"kind": "range", "surface": "floor"}, AnySensor), RangeFinder)
    assert isinstance(msgspec.convert({"kind": "uwb", "measurement": "tdoa"}, AnySensor), Uwb)
    flow = msgspec.convert({"kind": "flow", "focal_px": [500, 510], "surface": "floor"}, AnySensor)
    assert isinstance(flow, Flow)
    assert flow.focal_px == (500.0, 510.0)
