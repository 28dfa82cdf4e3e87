"""Checks and conversions of engineering constants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenics_contact.errors import InvalidInputError


def check_isotropic(young_modulus: float, poisson_ratio: float, thermal_expansion: float | None) -> None:
    """Reject constants for which the strain energy is not positive."""
    if not (np.isfinite(young_modulus) and young_modulus > 0):
        raise InvalidInputError(
            f"young_modulus must be a positive number, got {young_modulus!r}: "
            "give E in force per area, for steel 2.1e5 in N/mm²"
        )
    if not -1 < poisson_ratio < 0.5:
        raise InvalidInputError(
            f"poisson_ratio must lie between -1 and 0.5 (excluded), got {poisson_ratio!r}: "
            "use 0.3 for steel; incompressible bodies need another model"
        )
    if thermal_expansion is not None and not np.isfinite(thermal_expansion):
        raise InvalidInputError(
            f"thermal_expansion must be a finite number or None, got {thermal_expansion!r}: give the "
            "strain per degree, for steel 1.2e-5"
        )


def lame(young_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """Return the first Lamé parameter λ and the shear modulus G, [force / length²]."""
    E, nu = young_modulus, poisson_ratio
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def numbers(name: str, values: Sequence[float], count: int, meaning: str) -> tuple[float, ...]:
    """Return ``count`` finite numbers as floats.

    Raises:
        InvalidInputError: If they are not; ``meaning`` ends the message.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.full(0, np.nan)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise InvalidInputError(f"{name} must be {count} finite numbers, got {values!r}: {meaning}")
    return tuple(float(value) for value in array)
