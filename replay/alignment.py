"""Rigid alignment of two point tracks whose world frames are unrelated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RigidMotion:
    """``p_reference = R p + t``: rotation (3, 3) and translation (3,) [m]."""

    rotation: Array
    translation_m: Array

    def points(self, position_m: Array) -> Array:
        """Positions (n, 3) in the reference frame [m]."""
        moved: Array = position_m @ self.rotation.T + self.translation_m
        return moved

    def vectors(self, vector: Array) -> Array:
        """Velocities or other free vectors (n, 3) in the reference frame."""
        turned: Array = vector @ self.rotation.T
        return turned

    def covariances(self, covariance: Array) -> Array:
        """Covariances (n, 3, 3) in the reference frame."""
        turned: Array = self.rotation @ covariance @ self.rotation.T
        return turned


IDENTITY = RigidMotion(np.eye(3), np.zeros(3))


def rigid_alignment(position_m: Array, reference_m: Array) -> RigidMotion:
    """Rotation and translation, without scale, that bring ``position_m`` closest to ``reference_m``.

    Least squares over all pairs by the singular value decomposition of their cross-covariance, reflections excluded
    (S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991, eq. 40-42
    with c = 1).  Along a straight line the turn about that line is not determined; any of them is returned.

    position_m, reference_m : (n, 3) paired, n >= 1.
    """
    mean, reference_mean = position_m.mean(axis=0), reference_m.mean(axis=0)
    cross = (reference_m - reference_mean).T @ (position_m - mean)
    left, _, right = np.linalg.svd(cross)
    sign = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(left @ right)))])
    rotation = left @ sign @ right
    return RigidMotion(rotation, reference_mean - rotation @ mean)
