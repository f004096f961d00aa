"""Surfaces of several planes: the side wall of a corridor with corners, the floor before, on and after stairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import Integer
from axialnav.models.ray import distance_along_ray
from axialnav.models.scalar_kernel import kernel

Array = NDArray[np.float64]
FACE_WIDTH = 11  # normal (3), offset, start (3), end (3), roughness
GRAZING = 0.1


@kernel
def nearest_face(
    faces: Array, count: Integer, p_W: Array, R_WB: Array, lever_B: Array, ray_B: Array, work: Array
) -> Integer:
    """Row of ``faces`` that a body-fixed ray meets first between the face's ends, -1 where it meets none.

    faces : (F, 11) normal, offset [m], start and end of its stretch [m], roughness [m]; the first ``count`` count.
    A face reaches from ``start`` to ``end`` along the line between them and without limit across it.
    work : (8,) scratch.
    """
    best, found = np.inf, -1
    for f in range(count):
        face = faces[f]
        if not distance_along_ray(p_W, R_WB, lever_B, ray_B, face[0:3], face[3], work) > GRAZING:
            continue
        distance = work[0]
        if not 0.0 < distance < best:
            continue
        travelled, length = 0.0, 0.0
        for i in range(3):
            met = p_W[i]
            for k in range(3):
                met += R_WB[i, k] * (lever_B[k] + distance * ray_B[k])
            along = face[7 + i] - face[4 + i]
            travelled += (met - face[4 + i]) * along
            length += along * along
        if 0.0 <= travelled <= length:
            best, found = distance, f
    return found
