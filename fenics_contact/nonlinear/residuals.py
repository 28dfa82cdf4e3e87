"""How far a configuration is from equilibrium, relative to its forces and displacements."""

from __future__ import annotations

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


def relative_residuals(
    torn: TornSystem,
    natural: Vector,
    violation: float,
    forces: tuple[Vector, Vector, Vector, Vector],
    constraint_residual: Vector,
    displacement: Vector,
    largest: float,
    stiff: float,
) -> Residuals:
    """Return the relative residuals of a configuration: forces out of balance as `coarse`. Collective.

    Args:
        torn: The system.
        natural: λ − P(λ − ρ r), owned, [force].
        violation: Largest violation of a bound or disc by this rank's multipliers, [force].
        forces: Out of balance, internal, Bᵀλ, loads; each torn, shape (torn_size,), [force].
        constraint_residual: c − B u, owned, [length].
        displacement: u of this rank, torn, shape (torn_size,), [length].
        largest: A norm that displacements have had on the way, with which small ones are compared, [length].
        stiff: Largest entry of the tangents' diagonals, [force / length].
    """
    comm, contact = torn.numbering.comm, torn.numbering.owned >= torn.n_equality
    lengths = displacement, constraint_residual[~contact], torn.right[~contact]
    squares = (x @ x for x in (*forces, *lengths, natural[contact]))
    *sums, count = global_sum(comm, *squares, len(displacement))
    unbalanced, internal, bound, load, moved, open_, given, wrong = np.sqrt(sums)
    moved = max(moved, given, largest)
    floor = FORCE_FLOOR * stiff * moved / np.sqrt(count)
    # Before anything acts, what is to act is all there is: a tool in a body at rest is no equilibrium.
    force = max(min(internal, bound) if internal > 0 else bound, load, floor) or max(unbalanced, wrong)
    ratio = 1.0 / force if force > 0.0 else 0.0
    return Residuals(
        wrong * ratio,
        open_ / moved if moved > 0.0 else 0.0,
        unbalanced * ratio,
        global_max(comm, violation) * ratio,
        force,
        moved,
    )
