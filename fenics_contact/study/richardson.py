"""The limit of a sequence of meshes, if it converges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

#: Rates between which a sequence counts as converging: beyond them an extrapolated value is meaningless.
RATES = (0.45, 6.0)
#: Relative changes below this are rounding.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Extrapolation:
    """The limit of f(h) = f₀ + C hᵖ through the three finest meshes.

    Attributes:
        value: f₀; that of the finest mesh where it could not be extrapolated.
        rate: p, None if there is none.
        refused: Why nothing was extrapolated; empty if it was.
    """

    value: float
    rate: float | None
    refused: str = ""


def extrapolate(spacing: Sequence[float], values: Sequence[float]) -> Extrapolation:
    """Extrapolate to h = 0 by Richardson's rule with the measured rate.

    Args:
        spacing: Mesh sizes, falling, (n,).
        values: Values on them, (n,).

    References:
        P. J. Roache, Quantification of uncertainty in computational fluid dynamics, Annu. Rev. Fluid Mech.
        29 (1997), section on unequal refinement.
    """
    h, f = np.asarray(spacing, dtype=np.float64), np.asarray(values, dtype=np.float64)
    finest = float(f[-1])
    if len(h) < 3:
        return Extrapolation(finest, None, f"three meshes are needed, there are {len(h)}")
    (h1, h2, h3), (f1, f2, f3) = h[-3:], f[-3:]
    before, after = f1 - f2, f2 - f3
    if max(abs(before), abs(after)) <= ROUNDING * abs(finest):
        return Extrapolation(finest, None, "the meshes give the same")
    if before * after <= 0.0:
        return Extrapolation(finest, None, "it does not converge monotonically on the three finest meshes")

    def excess(p: float) -> float:
        return float((h1**p - h2**p) / (h2**p - h3**p) - before / after)

    if excess(RATES[0]) > 0.0:
        return Extrapolation(finest, None, "the changes from mesh to mesh do not fall")
    if excess(RATES[1]) < 0.0:
        return Extrapolation(finest, None, "the changes fall too fast to be a power of the mesh size yet")
    rate = float(brentq(excess, *RATES))
    return Extrapolation(float(f3 - after * h3**rate / (h2**rate - h3**rate)), rate)


def measured_rate(spacing: Sequence[float], errors: Sequence[float]) -> float | None:
    """Return the slope of errors over mesh sizes in logarithms, fitted to the three finest meshes.

    Args:
        spacing: Mesh sizes, falling, (n,).
        errors: Errors on them, positive, (n,).
    """
    h, e = np.asarray(spacing, dtype=np.float64)[-3:], np.asarray(errors, dtype=np.float64)[-3:]
    if len(h) < 2 or not np.all(e > 0.0):
        return None
    return float(np.polyfit(np.log(h), np.log(e), 1)[0])
