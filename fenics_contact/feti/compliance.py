"""The compliance of all rows of a system: constants in rows of equality, and the law of contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fenics_contact.qp.compliance import Compliance


@dataclass(frozen=True, eq=False)
class RowCompliance:
    """C(λ) of this rank's rows.

    Attributes:
        soft: Positions of rows of equality with a compliance among the owned ones, shape (k,).
        constant: That of each of these, C(λ) = C λ, shape (k,), [length / force].
        contact: That of contact rows, see `qp`; None where none has any.
    """

    soft: np.ndarray
    constant: np.ndarray
    contact: Compliance | None

    def added(self, product: np.ndarray, multiplier: np.ndarray) -> np.ndarray:
        """Add C λ in rows of equality to an owned vector, in place, and return it."""
        product[self.soft] += self.constant * multiplier[self.soft]
        return product

    def energies(self, multiplier: np.ndarray) -> tuple[float, float]:
        """Return λᵀC(λ) and Φ(λ), with Φ' = C, of this rank's rows, [force · length]."""
        force = multiplier[self.soft]
        work = float(force @ (self.constant * force))
        if self.contact is None:
            return work, 0.5 * work
        pressing = float(multiplier @ self.contact.given_way(multiplier))
        return work + pressing, 0.5 * work + self.contact.work(multiplier)
