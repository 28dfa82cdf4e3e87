"""Cycles that a parameter allows, by the constants of a material."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True)
class LifeCurve:
    """P = Σ A_k (2N)^b_k after N cycles, in the unit of the parameter, by constants of tests.

    Attributes:
        terms: A_k > 0 and b_k < 0: (σ_f, b) of Basquin for `Findley`; (σ_f²/E, 2b) and (σ_f ε_f, b + c) of
            Coffin, Manson and Basquin for `SmithWatsonTopper`; (τ_f/G, b) and (γ_f, c) for `FatemiSocie`.

    Raises:
        InvalidInputError: If there is no term, or a constant has the wrong sign.

    Example:
        >>> float(LifeCurve([(1000.0, -0.1)]).cycles(500.0))  # doctest: +SKIP
        512.0
    """

    terms: Sequence[tuple[float, float]]

    def __post_init__(self) -> None:
        """Check the constants."""
        given = np.asarray(self.terms, dtype=float).reshape(-1, 2)
        if not given.size or not np.isfinite(given).all() or not (given * (1.0, -1.0) > 0.0).all():
            raise InvalidInputError(
                f"LifeCurve.terms must be pairs of A > 0 and b < 0, got {self.terms!r}: try (1000.0, -0.1)"
            )

    def cycles(self, parameter: np.ndarray | float) -> np.ndarray:
        """Return N, shape of the parameters; infinite where these are not positive."""
        (size, power), found = np.transpose(self.terms), np.asarray(parameter, dtype=float)
        logs = np.log(np.where(found > 0.0, found, 1.0))[..., None]
        # log P falls with log 2N and is convex: Newton's method comes from where one term alone makes P.
        reversals = ((logs - np.log(size)) / power).max(axis=-1, keepdims=True)
        for _ in range(50):
            parts = size * np.exp(power * reversals - logs)
            total = parts.sum(axis=-1, keepdims=True)
            reversals = reversals - np.log(total) * total / (parts @ power)[..., None]
        return np.where(found > 0.0, 0.5 * np.exp(reversals[..., 0]), np.inf)
