"""The ray from a sensor to a plane: what range finders and cameras share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.scalar_kernel import kernel

Array = NDArray[np.float64]


@kernel
def distance_along_ray(
    p_W: Array, R_WB: Array, lever_B: Array, ray_B: Array, normal_W: Array, offset_m: float, out: Array
) -> float:
    r"""Distance from a sensor along a body-fixed ray to the plane ``normal . p = offset``.

    .. math:: Z = \frac{n \cdot (p + R l) - o}{c}, \qquad c = -n \cdot R a

    Returns the cosine ``c`` of the incidence angle; where it is not positive the ray points away from the surface
    and ``out`` holds nothing of use.  ``out`` (8,) receives Z, dZ/dp (3), dZ/dtheta (3, body axes) and dZ/do.

    Source: ray-plane intersection; derivatives with :math:`R \to R\,(I + [\theta]_\times)`.
    """
    n0 = R_WB[0, 0] * normal_W[0] + R_WB[1, 0] * normal_W[1] + R_WB[2, 0] * normal_W[2]
    n1 = R_WB[0, 1] * normal_W[0] + R_WB[1, 1] * normal_W[1] + R_WB[2, 1] * normal_W[2]
    n2 = R_WB[0, 2] * normal_W[0] + R_WB[1, 2] * normal_W[1] + R_WB[2, 2] * normal_W[2]
    cosine = -(n0 * ray_B[0] + n1 * ray_B[1] + n2 * ray_B[2])
    if cosine <= 0.0:
        return float(cosine)
    height = normal_W[0] * p_W[0] + normal_W[1] * p_W[1] + normal_W[2] * p_W[2] - offset_m
    height += n0 * lever_B[0] + n1 * lever_B[1] + n2 * lever_B[2]
    distance = height / cosine
    hit0 = lever_B[0] + distance * ray_B[0]
    hit1 = lever_B[1] + distance * ray_B[1]
    hit2 = lever_B[2] + distance * ray_B[2]
    out[0] = distance
    out[1] = normal_W[0] / cosine
    out[2] = normal_W[1] / cosine
    out[3] = normal_W[2] / cosine
    out[4] = (hit1 * n2 - hit2 * n1) / cosine
    out[5] = (hit2 * n0 - hit0 * n2) / cosine
    out[6] = (hit0 * n1 - hit1 * n0) / cosine
    out[7] = -1.0 / cosine
    return float(cosine)
