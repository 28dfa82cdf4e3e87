"""How far a configuration is from equilibrium, relative to its forces and displacements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.feti import TornSystem
from fenics_contact.qp import Residuals, Vector, global_max, global_sum

#: Forces below this fraction of those that would strain bodies by their displacement are none.
FORCE_FLOOR = 1e-4
#: Rounding of strains and of positions, relative to one and to the size of a body.
ROUNDED = 4.0 * float(np.finfo(float).eps)


def beyond(values: Vector, rounding: float | Vector) -> Vector:
    """Return how far values, of either sign, are beyond rounding."""
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - rounding, 0.0))


@dataclass(frozen=True, eq=False)
class Sizes:
    """What is out of balance or open, and the forces with which it is compared.

    Attributes:
        natural: λ − P(λ − ρ r), owned, [force].
        unbalanced: Forces out of balance, torn, shape (torn_size,), [force].
        internal: Internal forces, torn, [force].
        bound: Bᵀλ, torn, [force].
        external: Loads, torn, [force].
        lacking: c − B u, owned, [length].
        displacement: u of this rank, torn, shape (torn_size,), [length].
        largest: A norm that displacements have had on the way, with which small ones are compared, [length].
    """

    natural: Vector
    unbalanced: Vector
    internal: Vector
    bound: Vector
    external: Vector
    lacking: Vector
    displacement: Vector
    largest: float

    def residuals(self, torn: TornSystem, violation: float, stiff: float) -> Residuals:
        """Return the relative residuals: forces out of balance as `coarse`. Collective.

        Args:
            torn: The system.
            violation: Largest violation of a bound or disc by this rank's multipliers, [force].
            stiff: Largest entry of the tangents' diagonals, [force / length].
        """
        comm, contact = torn.numbering.comm, torn.numbering.owned >= torn.n_equality
        forces = self.unbalanced, self.internal, self.bound, self.external
        lengths = self.displacement, self.lacking[~contact], torn.right[~contact]
        squares = (x @ x for x in (*forces, *lengths, self.natural[contact]))
        *sums, count = global_sum(comm, *squares, len(self.displacement))
        unbalanced, internal, bound, load, moved, open_, given, natural = np.sqrt(sums)
        moved = max(moved, given, self.largest)
        floor = FORCE_FLOOR * stiff * moved / np.sqrt(count)
        # Before anything acts, what is to act is all there is: a tool in a body at rest is no equilibrium.
        force = max(min(internal, bound) if internal > 0 else bound, load, floor) or max(natural, unbalanced)
        violation = global_max(comm, violation)
        ratio = 1.0 / force if force > 0.0 else 0.0
        return Residuals(
            natural * ratio,
            open_ / moved if moved > 0.0 else 0.0,
            unbalanced * ratio,
            violation * ratio,
            force,
            moved,
        )
