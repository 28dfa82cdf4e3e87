"""Stop once the mesh, not the solver, limits the accuracy of a state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.accuracy.state_errors import SolverErrors
from fenics_contact.errors import InvalidInputError

#: Fraction of the allowed error that the next tolerance aims at: errors do not fall exactly as residuals do.
MARGIN = 0.5
#: Smallest and largest ratio of one tolerance to the one before.
STEP = (1e-4, 0.3)


@dataclass(frozen=True)
class BalancedTolerance:
    """A tolerance that follows the mesh: the solver's error is at most a share of the discretisation's.

    The scene is solved to ``loosest``. Then the error of the discretisation is estimated, that of the solver
    bounded (`StateErrors`), and if the latter is more than its share, the solver continues to a tolerance
    that follows from the ratio. On a mesh that represents the solution exactly it is ``finest``.

    Displacements, contact pressures and energies are then as accurate as the mesh allows, and so are supports
    and gluing, which are enforced by multipliers. Discontinuous results are not: whether a point at the edge
    of the contact is closed, or sticks, may still change, and with it shape derivatives, which depend on
    these statuses. Where statuses or differences between neighbouring states matter, give a number: 1e-6
    settles nearly all, 1e-8 all that are not weakly active.

    Attributes:
        share: Largest error of the solver, law of friction included, relative to that of the mesh.
        loosest: First and largest tolerance.
        finest: Smallest tolerance.
        rounds: Largest number of times that the tolerance is tightened.

    Raises:
        InvalidInputError: If the share or the tolerances are not positive or in the wrong order.

    Example:
        >>> state = solve_scene(scene, comm, tolerance=BalancedTolerance(share=0.01))  # doctest: +SKIP
    """

    share: float = 0.1
    loosest: float = 1e-3
    finest: float = 1e-10
    rounds: int = 4

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (self.share > 0.0 and 0.0 < self.finest <= self.loosest < 1.0 and self.rounds >= 1):
            raise InvalidInputError(
                "BalancedTolerance needs share > 0, 0 < finest <= loosest < 1 and rounds >= 1, got share "
                f"{self.share:g}, finest {self.finest:g}, loosest {self.loosest:g}, rounds {self.rounds}: "
                "keep the defaults of what you do not mean to change"
            )

    def satisfied(self, errors: SolverErrors, discretisation: float) -> bool:
        """Return whether the solver's errors are within their share of the discretisation's."""
        return errors.together <= self.share * discretisation

    def tightened(self, reached: float, errors: SolverErrors, discretisation: float) -> float:
        """Return the next tolerance.

        Args:
            reached: Largest residual so far.
            errors: The solver's errors.
            discretisation: Estimated error of the mesh, [√(force · length)].
        """
        allowed, have = self.share * discretisation, errors.together
        # For so small an allowed error intermediate tolerances are useless; with an unknown error all are
        # useful.
        if np.isfinite(have) and allowed <= self.finest * have:
            return self.finest
        ratio = MARGIN * allowed / have
        return max(self.finest, reached * min(max(ratio, STEP[0]), STEP[1]))
