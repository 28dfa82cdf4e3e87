"""An upper bound of the algebraic error from duality: an admissible multiplier and displacement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.accuracy.admissible import UNBALANCED, Admissible, admissible
from fenics_contact.accuracy.lifted import ROUNDING, Lifted, lift
from fenics_contact.feti import DirectSolution, DirectSystem, DualSystem
from fenics_contact.qp import DualProblem, DualSolution, Vector, global_max, global_sum

#: A multiplier that moves by less, relatively, is what it was.
UNMOVED = 1e-14
#: Friction this near to its bound, relatively, is on it.
ON_CIRCLE = 1e-13


@dataclass(frozen=True, eq=False)
class Certificate:
    """Bounds of the algebraic error of a state in energy norm, [√(force · length)].

    Attributes:
        bound: Upper bound of ‖u − u⋆‖ and of the same for the displacement that fields show; infinite where
            no admissible pair was found.
        moved: The part of it by which the multiplier was moved to be admissible.
        gap: J(v) − θ(λ) of the admissible pair, [force · length].
        known: The admissible multiplier and its statuses.
        error: Estimate of how far the state's multiplier is from the solution, owned, [force].
    """

    bound: float
    moved: float
    gap: float
    known: Admissible
    error: Vector


def certify(system: DualSystem, solution: DualSolution) -> Certificate:
    """Bound the algebraic error of a solution. Collective; at most one product and two applications of S.

    With an admissible multiplier λ (λ_N ≥ 0, ‖τ‖ ≤ Ψ, G λ = e), u = K⁺(f − Bᵀλ) + R α, and a displacement
    v = u + w that no row forbids, at given slip bounds

        J(v) − θ(λ) = ½ wᵀK w + Σ λ_N (c − B v)_N + Σ (Ψ‖s‖ − τ·s),   s the slip of v,

    a sum of parts none of which is negative, and J(v) − θ(λ) ≥ ½‖v − u⋆‖² + ½‖u − u⋆‖² in energy norm,
    u⋆ being the solution. So u⋆ is in the ball around the middle u + ½w of radius ½√(4 gap − ‖w‖²), and no
    displacement x is farther from it than ‖x − u − ½w‖ + ½√(4 gap − ‖w‖²). The bound is that of the farther
    one of two: of u, and of what fields show, in which copies of nodes agree (`DualSystem.conforming`). What
    moved the multiplier of the solution into the cone, δ, counts with its own energy δᵀF δ.

    The way w is that of the preconditioner, and the bound is as close as this is good: mostly within a factor
    of two of the error, for nearly incompressible bodies, thin plates and stiff bodies on soft ones of one of
    ten to thirty.

    The bound is for Tresca's problem with the slip bounds of the solution. Where these are given, that is the
    problem; and it is infinite where no multiplier within them balances the load. Where they follow the
    normal forces it is not the bound of the distance to the solution of Coulomb's law, see `friction_error`
    for the rest; and where these bounds are too small for the load, Tresca's problem has no solution and they
    are raised, see `Admissible`.

    It holds to rounding: energies and products are those of double precision, rows that are closed to 1e-9
    of what was open count as closed, and so does a load that is balanced to 1e-9.

    Args:
        system: The dual system.
        solution: A solution of its problem, of any accuracy.

    References:
        W. Prager, J. L. Synge, Approximations in elasticity based on the concept of function space, Quart.
        Appl. Math. 5 (1947). S. Repin, A posteriori estimates for partial differential equations, de Gruyter
        2008, chapter 3.
    """
    problem, residual, moved = system.problem, solution.residual, 0.0
    follows = system.torn.friction_coefficient[system.owned_discs()] > 0.0
    known = admissible(problem, solution.slip_bound, follows, solution.multiplier, residual)
    change = known.multiplier - solution.multiplier
    if problem.norm(change) > UNMOVED * problem.norm(solution.multiplier):
        product = system.apply(change)
        moved = float(np.sqrt(max(problem.dot(change, product), 0.0)))
        residual = known.statuses.settled(residual + product)
    lifted = lift(system, known, residual, _cancelled(problem, solution))
    rest = _pressed(problem, known, lifted.residual) + _rubbed(problem, known, lifted.residual)
    gap = 0.5 * lifted.energy + rest
    radius = 0.5 * float(np.sqrt(lifted.energy + 4.0 * rest))
    bound = max(_distances(system, solution, lifted)) + radius + moved
    if lifted.left > ROUNDING or known.unbalanced > UNBALANCED:
        bound = np.inf
    return Certificate(bound, moved, gap, known, change + lifted.multiplier)


def _distances(system: DualSystem, solution: DualSolution, lifted: Lifted) -> tuple[float, float]:
    """Return how far from u + ½w the found displacement is, and the one that fields show. Collective."""
    energy, _ = system.inverse.energy(system.sewn(solution.residual) - 0.5 * lifted.displacement)
    shown = float(np.sqrt(global_sum(system.problem.comm, energy)[0]))
    return 0.5 * float(np.sqrt(lifted.energy)), shown


def direct_error(system: DirectSystem, solution: DirectSolution) -> float:
    """Return the energy norm of what a factorisation left unsolved, √(rᵀK⁻¹r), [√(force · length)]."""
    return float(np.sqrt(max(system.energy_of_residual(solution.displacement), 0.0)))


def _cancelled(problem: DualProblem, solution: DualSolution) -> float:
    """Return the size of the displacements that cancel in r. Collective."""
    moved = np.abs(solution.product - problem.rhs).max(initial=0.0)
    return global_max(problem.comm, max(moved, np.abs(problem.rhs).max(initial=0.0)))


def _pressed(problem: DualProblem, known: Admissible, residual: Vector) -> float:
    """Return Σ λ_N gap, the work of normal forces that act across a gap. Collective."""
    normal = problem.layout.normal
    return float(global_sum(problem.comm, known.multiplier[normal] @ np.maximum(residual[normal], 0.0))[0])


def _rubbed(problem: DualProblem, known: Admissible, residual: Vector) -> float:
    """Return Σ Ψ‖s‖ − τ·s, what friction forces fall short of. Collective.

    As (Ψ − ‖τ‖)‖s‖ + ½‖τ‖‖s‖‖ŝ − τ̂‖², in which nothing cancels where force and slip have one direction.
    """
    tau, slid = known.multiplier[problem.layout.tangential], -residual[problem.layout.tangential]
    force, way = np.linalg.norm(tau, axis=1), np.linalg.norm(slid, axis=1)
    short = known.slip_bound - force
    short[short <= ON_CIRCLE * known.slip_bound] = 0.0
    turned = slid / np.where(way > 0.0, way, 1.0)[:, None] - tau / np.where(force > 0.0, force, 1.0)[:, None]
    lost = way * (short + 0.5 * force * np.einsum("ia,ia->i", turned, turned))
    return float(global_sum(problem.comm, lost.sum())[0])
