"""Whether bounds and friction can balance the load at all: depends on G, e and the cone only, not on F."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import InfeasibleError
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector, global_max, global_sum

#: A thin plate clamped at one edge needs forces as many times the load as its length is times its thickness.
LARGEST_FORCE = 1e7


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An admissible multiplier in equilibrium, or the rigid motion that proves there is none.

    Attributes:
        multiplier: An admissible multiplier, owned; in equilibrium up to `error`.
        error: ‖Gᵀ(G Gᵀ)⁻¹(G λ − e)‖ relative to that of e.
        motion: Coefficients of a rigid motion on which the load does work and which no admissible
            multiplier resists, shape (m,); None unless that is proven.
    """

    multiplier: Vector
    error: float
    motion: Vector | None


def find_equilibrium(
    problem: DualProblem, *, tolerance: float = 1e-4, max_iterations: int = 2000
) -> Equilibrium:
    """Compute an admissible multiplier that balances the load, without any F-product. Collective.

    Minimises ½‖Q z − λ₀‖² over the admissible set by accelerated projected gradients, Q = I − P. At
    distance g = Q z − λ₀ with optimality error s = z − P_Λ(z − g), any equilibrium y satisfies ‖g‖² ≤ ‖s‖(‖y
    − z‖ + ‖g‖). Once that would need a force 10⁷ times the load's, none exists.

    Args:
        problem: Coarse space, layout and law are used: Tresca's bounds or Coulomb's cones.
        tolerance: Relative error of equilibrium at which a multiplier is accepted.
        max_iterations: Number of cheap iterations after which to stop undecided.
    """
    coarse, law = problem.coarse, problem.law
    target = coarse.particular()
    size = coarse.norm(coarse.load)
    z = law.admit(target)
    momentum, weight = z, 1.0
    for _ in range(max_iterations):
        resultant = coarse.solve(coarse.residual(momentum))
        gradient = coarse.transpose(resultant)
        following = law.admit(momentum - gradient)
        step = momentum - following
        distance, error, turn = np.array(
            global_sum(problem.comm, gradient @ gradient, step @ step, step @ (following - z))
        )
        if distance <= (tolerance * size) ** 2:
            return Equilibrium(momentum, float(np.sqrt(distance)) / (size or 1.0), None)
        if distance > np.sqrt(error) * (LARGEST_FORCE * size + np.sqrt(distance)):
            return Equilibrium(following, float(np.sqrt(distance)) / size, resultant)
        weight, previous = (1.0, 1.0) if turn > 0.0 else (0.5 + np.sqrt(0.25 + weight**2), weight)
        momentum = following + (previous - 1.0) / weight * (following - z) * (turn <= 0.0)
        z = following
    return Equilibrium(z, float(np.sqrt(distance)) / size, None)


def require_equilibrium(problem: DualProblem) -> Equilibrium:
    """Return an admissible multiplier near equilibrium, or reject the problem. Collective.

    Raises:
        InfeasibleError: It is proven that none exists.
    """
    equilibrium = find_equilibrium(problem)
    if equilibrium.motion is not None:
        size = np.abs(equilibrium.motion)
        rows = np.flatnonzero(size > 0.1 * size.max())
        raise InfeasibleError(
            "contact and friction need to balance the load, but no admissible multiplier comes closer than "
            f"{100 * equilibrium.error:.3g} % of it: the rigid motions in rows {rows.tolist()} of e are not "
            "held; add a support, turn the load into the contact or raise the friction"
        )
    return equilibrium


def may_grip(problem: DualProblem, multiplier: Vector) -> bool:
    """Return whether friction may press bodies together that no load acts on; no product. Collective.

    Without friction that grows with the normal force, forces without a load are unique. With it they may
    remain, as in a wedge or a taper, unless it is proven that no admissible ones balance each other, those of
    a block on its floor for one.

    Args:
        problem: Coarse space, layout and law are used; its load e is taken to be zero.
        multiplier: Forces of the last load, owned; only the sum of the normal ones counts.
    """
    coarse, layout, comm = problem.coarse, problem.layout, problem.comm
    if global_max(comm, float(problem.law.growth.max(initial=0.0))) == 0.0:
        return False
    rows, normal = layout.normal, multiplier[layout.normal]
    squares, count, pressed = global_sum(
        comm, coarse.matrix.power(2).sum(), len(rows), np.maximum(normal, 0.0).sum()
    )
    if pressed == 0.0:
        return False
    # One more equation, of the size of the others: the sum of the normal forces is what it was.
    weight = float(np.sqrt(squares / count)) or 1.0
    entries = (np.full(len(rows), weight), (np.zeros(len(rows), dtype=np.int64), rows))
    total = sp.csr_matrix(entries, shape=(1, layout.size))
    load = np.append(np.zeros(coarse.m), weight * pressed)
    gripping = CoarseSpace(comm, sp.vstack([coarse.matrix, total]), load)
    # Where the sum is the resultant on one body, the equations contradict each other.
    if np.abs(gripping.unresisted()).max() > 1e-8 * load[-1]:
        return False
    return find_equilibrium(replace(problem, coarse=gripping)).motion is None
