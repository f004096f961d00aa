"""Whether the frames fit one smooth motion: residual positions of the frames, and pairs that do not belong together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.extra import extra_step
from axialnav.estimators.integrity import middle
from axialnav.estimators.joint import WINDOW_VARIANCE, Fit
from axialnav.estimators.positions import free_positions, motion_basis
from axialnav.estimators.spectrum import pair_frames

Array = NDArray[np.float64]
SURE_BEND, SHORT_BEND_PX, TELLING_FRAMES = 14.0, 0.15, 5
CHI2_OFFSET, CHI2_PER_DOF = 16.0, 3.5  # about 1e-5 for one to six degrees of freedom
UNEVEN_SHARE, UNEVEN_PX = 0.03, 0.02
MIN_PAIR_SHARE = 0.3
SURE_PAIR = 4.0
DROP_LIKE_BEND = 0.5


@dataclass(frozen=True)
class Residual:
    """Positions of single frames that the motion does not explain.

    Parameters
    ----------
    chi2
        Size in units of their noise, squared and summed [-].
    dof
        Degrees of freedom; 0 where the motion explains any position.
    rms_px
        Root mean square per degree of freedom [px].
    """

    chi2: float
    dof: int
    rms_px: float

    @property
    def significant(self) -> bool:
        """Whether noise alone would hardly do this."""
        return self.dof > 0 and self.chi2 > CHI2_OFFSET + CHI2_PER_DOF * self.dof


def bend_significance(fit: Fit) -> float:
    """An acceleration in units of its standard deviation, squared [-]: score test at a fit without one, else Wald's."""
    frames = fit.score.shape[1]
    if frames < 3:
        return 0.0
    basis = motion_basis(frames, True)
    if len(fit.motion) == 2:
        J = basis.T @ fit.information.sum(axis=0) @ basis
        return float(fit.motion[1] ** 2 * (J[1, 1] - J[0, 1] ** 2 / J[0, 0])) / WINDOW_VARIANCE
    chi2 = _chi2(fit, np.ascontiguousarray(basis[:, :1]), np.ascontiguousarray(basis[:, 1:]))[0]
    return max(chi2, 0.0) / WINDOW_VARIANCE


def short_bend(fit: Fit) -> Array | None:
    """Where a fit with an acceleration begins, (2,), by the score test's step; None if that is long or proves little.

    With too few frames to tell an acceleration from a missing frame it proves nothing.
    """
    frames = fit.score.shape[1]
    basis = motion_basis(frames, True)
    bend = float(_chi2(fit, np.ascontiguousarray(basis[:, :1]), np.ascontiguousarray(basis[:, 1:]))[1][0])
    return np.array([float(fit.motion[0]), bend]) if frames >= TELLING_FRAMES and abs(bend) < SHORT_BEND_PX else None


def _chi2(fit: Fit, known: Array, extra: Array) -> tuple[float, Array]:
    step = np.zeros(extra.shape[1])
    return extra_step(fit.score, fit.information, np.ones(len(fit.score)), known, extra, step), step


def residual(fit: Fit) -> Residual:
    """One Gauss-Newton step with every frame free: what is left beside the motion."""
    frames, fitted = fit.score.shape[1], len(fit.motion)
    dof = frames - 1 - fitted
    if dof < 1:
        return Residual(0.0, 0, 0.0)
    chi2, step = _chi2(fit, motion_basis(frames, fitted == 2), free_positions(frames, fitted))
    if chi2 < 0.0:
        return Residual(np.inf, dof, np.inf)
    return Residual(chi2 / WINDOW_VARIANCE, dof, float(np.sqrt(step @ step / dof)))


def uneven(fit: Fit, left: Residual) -> bool:
    """Whether the residual positions are those of a dropped or repeated frame rather than of a shaking camera."""
    if left.dof == 0 and len(fit.motion) == 2:
        return bool(abs(fit.motion[1]) > DROP_LIKE_BEND * abs(fit.motion[0]))
    return left.significant and left.rms_px > UNEVEN_SHARE * abs(float(fit.motion[0])) + UNEVEN_PX


def shake_variance(left: Residual, frames: int) -> float:
    """Variance that residual positions add to the displacement, ``12 s^2 / (N (N^2 - 1))`` [px^2]."""
    return 12.0 * left.rms_px**2 / (frames * (frames**2 - 1)) if left.significant else 0.0


def stranger(fit: Fit, rows: Array, omega: Array) -> bool:
    """Whether a pair of neighbouring frames has almost nothing in common although the others have.

    Asked twice: of all detail, and of fine detail, the curvature of the likelihood.  Coarse detail hardly changes over
    the few pixels by which a frame is off that follows a missing one.  ``rows`` (c,) are the rows behind the sums of
    all strips in use, ``omega`` (f,) the frequencies [rad/px].
    """
    frames = fit.score.shape[1]
    if frames < 3:
        return False
    coarse, information = fit.coherence.sum(axis=0).tolist(), fit.information.sum(axis=0).tolist()
    pairs = [(p, i) for p, (i, j) in enumerate(pair_frames(frames).tolist()) if j == i + 1]
    missing = _missing([coarse[p] for p, _ in pairs]), _missing([-0.5 * information[i][i + 1] for _, i in pairs])
    if not any(missing):
        return False
    total = fit.texture + fit.noise
    variance = 0.5 * WINDOW_VARIANCE * (rows @ ((fit.weight * total) ** 2 + (fit.weight * fit.texture) ** 2))
    sigma = np.sqrt(variance.sum()), np.sqrt(omega**4 @ variance)
    return any(lack > SURE_PAIR * float(own) for lack, own in zip(missing, sigma, strict=True))


def _missing(shared: list[float]) -> float:
    """How much less than usual the least is of what neighbouring frames share (n - 1,); 0 unless far less."""
    usual, least = middle(shared), min(shared)
    return usual - least if least < MIN_PAIR_SHARE * usual else 0.0
