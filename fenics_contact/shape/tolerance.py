"""How accurately the states of a design problem are solved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.contact import ContactProblem
from fenics_contact.errors import InvalidInputError

#: Tolerance of a second attempt relative to the first: at most and at least.
_TIGHTER = (0.3, 1e-3)


@dataclass(frozen=True)
class AdaptiveTolerance:
    """The tolerance follows the optimiser's requests; a single evaluation uses the tightest.

    A state is solved to the relative error that its subgradient may have, or to the tolerance that earlier
    designs suggest for the value. Then the adjoint yields the error of the value; where it is too large, the
    solve is continued. The value of a design is corrected by that error, so that the remainder is of second
    order.

    Attributes:
        loosest: Largest relative residual of a state.
        tightest: Smallest one.
    """

    loosest: float = 1e-3
    tightest: float = 1e-9

    def __post_init__(self) -> None:
        """Reject empty ranges."""
        if not 0.0 < self.tightest <= self.loosest < 1.0:
            raise InvalidInputError(
                f"tolerances need 0 < tightest <= loosest < 1, got {self.tightest:g} and {self.loosest:g}: "
                "try AdaptiveTolerance(loosest=1e-3, tightest=1e-9)"
            )

    def first(self, value: float, subgradient: float, error_by_tolerance: float) -> float:
        """Return the tolerance to begin with.

        Args:
            value: Largest error of the objective.
            subgradient: Largest relative error of the subgradient.
            error_by_tolerance: Last ratio of the objective's error to the tolerance; 0 if unknown.
        """
        guess = 0.5 * value / error_by_tolerance if error_by_tolerance > 0.0 else np.inf
        return self._clipped(min(subgradient, guess))

    def next(self, tolerance: float, error: float, value: float) -> float:
        """Return the tolerance after one with which the error was too large."""
        most, least = _TIGHTER
        return self._clipped(tolerance * min(most, max(least, 0.3 * value / error)))

    def _clipped(self, tolerance: float) -> float:
        return float(np.clip(tolerance, self.tightest, self.loosest))


def tightest_of(contact: ContactProblem, given: float | AdaptiveTolerance | None) -> float:
    """Return the smallest tolerance of states. Collective."""
    if isinstance(given, AdaptiveTolerance):
        return given.tightest
    return contact.number() if given is None else float(given)
