"""An upper bound of the algebraic error from duality: an admissible multiplier and displacement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.accuracy.admissible import UNBALANCED, Admissible, admissible
from fenics_contact.accuracy.lifted import UNLIFTED, Lifted, lift
from fenics_contact.display import displayed
from fenics_contact.feti import DirectSolution, DirectSystem, DualSystem
from fenics_contact.linalg import LAST_PLACES, ROUNDING
from fenics_contact.qp import DualProblem, DualSolution, Vector, global_max, global_sum


@displayed
@dataclass(frozen=True, eq=False)
class Certificate:
    """Bounds of the algebraic error of a state in energy norm, [√(force · length)].

    Attributes:
        bound: Upper bound of ‖u − u⋆‖, also for the continuous displacement of the fields; infinite if no
            admissible pair was found.
        moved: Its part due to making the multiplier admissible.
        gap: J(v) − θ(λ) of the admissible pair, [force · length].
        known: The admissible multiplier and its statuses.
        error: Estimated error of the state's multiplier, owned, [force].
    """

    bound: float
    moved: float
    gap: float
    known: Admissible
    error: Vector


def certify(system: DualSystem, solution: DualSolution) -> Certificate:
    """Bound the algebraic error of a solution. Collective; at most one product and two applications of S.

    With an admissible multiplier λ (λ_N ≥ 0, ‖τ‖ ≤ Ψ, G λ = e), u = K⁺(f − Bᵀλ) + R α, and an admissible
    displacement v = u + w, at given slip bounds

        J(v) − θ(λ) = ½ wᵀK w + Σ λ_N (c − B v)_N + Σ (Ψ‖s‖ − τ·s),   s the slip of v,

    a sum of non-negative terms, and J(v) − θ(λ) ≥ ½‖v − u⋆‖² + ½‖u − u⋆‖² in energy norm, u⋆ being the
    solution. So u⋆ is in the ball around the midpoint u + ½w of radius ½√(4 gap − ‖w‖²), and no displacement
    x is farther from it than ‖x − u − ½w‖ + ½√(4 gap − ‖w‖²). The bound is for the farther of two
    displacements: u, and that of the fields, in which copies of nodes agree (`DualSystem.conforming`). The
    change δ that made the multiplier admissible counts with its own energy δᵀF δ.

    The correction w is that of the preconditioner, whose quality determines the sharpness: mostly a factor of
    two, for nearly incompressible bodies, thin plates and stiff bodies on soft ones ten to thirty.

    The bound is for Tresca's problem with the slip bounds of the solution. Where these are given, that is the
    actual problem; and it is infinite where no multiplier within them balances the load. Where they follow
    the normal forces it does not bound the distance to the solution of Coulomb's law, see `friction_error`
    for the rest; and where they are too small for the load, Tresca's problem has no solution and they are
    raised, see `Admissible`.

    It holds to rounding: energies and products are in double precision, rows that are closed to 1e-9 of their
    initial violation count as closed, and a load that is balanced to 1e-9 as balanced.

    Args:
        system: The dual system.
        solution: A solution of its problem, of any accuracy.

    References:
        W. Prager, J. L. Synge, Approximations in elasticity based on the concept of function space, Quart.
        Appl. Math. 5 (1947). S. Repin, A posteriori estimates for partial differential equations, de Gruyter
        2008, chapter 3.
    """
    problem, residual, moved = system.problem, solution.residual, 0.0
    follows = system.torn.friction_coefficient[system.torn.owned_discs] > 0.0
    known = admissible(problem, solution.slip_bound, follows, solution.multiplier, residual)
    change = known.multiplier - solution.multiplier
    if problem.norm(change) > LAST_PLACES * problem.norm(solution.multiplier):
        product = system.apply(change)
        moved = float(np.sqrt(max(problem.dot(change, product), 0.0)))
        residual = known.statuses.settled(residual + product)
    lifted = lift(system, known, residual, _cancelled(problem, solution))
    rest = _pressed(problem, known, lifted.residual) + _rubbed(problem, known, lifted.residual)
    gap = 0.5 * lifted.energy + rest
    radius = 0.5 * float(np.sqrt(lifted.energy + 4.0 * rest))
    bound = max(_distances(system, solution, lifted)) + radius + moved
    if lifted.left > UNLIFTED or known.unbalanced > UNBALANCED:
        bound = np.inf
    return Certificate(bound, moved, gap, known, change + lifted.multiplier)


def _distances(system: DualSystem, solution: DualSolution, lifted: Lifted) -> tuple[float, float]:
    """Return the distances from u + ½w of the computed displacement and of that of the fields. Collective."""
    energy, _ = system.inverse.energy(system.sewn(solution.residual) - 0.5 * lifted.displacement)
    shown = float(np.sqrt(global_sum(system.problem.comm, energy)[0]))
    return 0.5 * float(np.sqrt(lifted.energy)), shown


def direct_error(system: DirectSystem, solution: DirectSolution) -> float:
    """Return the energy norm of the error of a factorisation, √(rᵀK⁻¹r), [√(force · length)]."""
    return float(np.sqrt(max(system.energy_of_residual(solution.displacement), 0.0)))


def _cancelled(problem: DualProblem, solution: DualSolution) -> float:
    """Return the norm of the displacements that cancel in r. Collective."""
    moved = np.abs(solution.product - problem.rhs).max(initial=0.0)
    return global_max(problem.comm, max(moved, np.abs(problem.rhs).max(initial=0.0)))


def _pressed(problem: DualProblem, known: Admissible, residual: Vector) -> float:
    """Return Σ λ_N gap, the work of normal forces that act across a gap. Collective."""
    normal = problem.layout.normal
    return float(global_sum(problem.comm, known.multiplier[normal] @ np.maximum(residual[normal], 0.0))[0])


def _rubbed(problem: DualProblem, known: Admissible, residual: Vector) -> float:
    """Return Σ Ψ‖s‖ − τ·s, the deficit of the dissipation by friction forces. Collective.

    As (Ψ − ‖τ‖)‖s‖ + ½‖τ‖‖s‖‖ŝ − τ̂‖², which is free of cancellation where force and slip are parallel.
    """
    tau, slid = known.multiplier[problem.layout.tangential], -residual[problem.layout.tangential]
    force, way = np.linalg.norm(tau, axis=1), np.linalg.norm(slid, axis=1)
    short = known.slip_bound - force
    short[short <= ROUNDING * known.slip_bound] = 0.0
    turned = slid / np.where(way > 0.0, way, 1.0)[:, None] - tau / np.where(force > 0.0, force, 1.0)[:, None]
    lost = way * (short + 0.5 * force * np.einsum("ia,ia->i", turned, turned))
    return float(global_sum(problem.comm, lost.sum())[0])
