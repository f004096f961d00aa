"""Displacement from power spectra alone: composites and single frames."""

from axialnav.estimators.spectral.composite import fit_composite
from axialnav.estimators.spectral.single import fit_single

__all__ = ["fit_composite", "fit_single"]
