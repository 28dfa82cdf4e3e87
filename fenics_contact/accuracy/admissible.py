"""An admissible multiplier near a computed one: within its cone and in equilibrium."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.accuracy.nearest import evening, nearest
from fenics_contact.linalg import ROUNDING
from fenics_contact.qp import (
    CoarseSpace,
    ContactLayout,
    DualProblem,
    FeasibleSet,
    Marks,
    Vector,
    contact_step,
    face_basis,
    global_max,
)

#: Imbalance above this fraction of all forces, at which duality gives no bound.
UNBALANCED = 1e-9
#: Rounds of alternating projections on the cone and on equilibrium.
ROUNDS = 100
#: A round that leaves more than this fraction of the imbalance makes no progress.
PROGRESS = 0.9
#: A slip bound larger than any force.
ENDLESS = 1e300


@dataclass(frozen=True, eq=False)
class Statuses:
    """Statuses of contact at a multiplier, and the rows that are free for them.

    Attributes:
        problem: The dual problem.
        closed: Closed contacts, shape (n_contact,), owned.
        stick: Sticking discs, shape (n_friction,), owned.
        slip: Discs on the circle, shape (n_friction,), owned; the others are pinned (Ψ = 0).
        directions: Multiplier whose friction forces give the directions, owned.
    """

    problem: DualProblem
    closed: Marks
    stick: Marks
    slip: Marks
    directions: Vector

    @cached_property
    def free(self) -> sp.csr_matrix:
        """Basis of the rows whose multipliers are free and in which r should vanish, shape (size, n_face)."""
        return basis(self.problem.layout, self.closed, self.stick, self.slip, self.directions)

    @cached_property
    def coarse(self) -> CoarseSpace:
        """Equilibrium on the free rows only, in scaled multipliers. Collective on first use."""
        return self.problem.scaled_problem.coarse.restricted(self.free)

    def spaces(self) -> Iterator[tuple[sp.csr_matrix, CoarseSpace]]:
        """Bases of rows with their equilibrium: of the free rows, of all closed contacts, of all."""
        yield self.free, self.coarse
        layout, coarse = self.problem.layout, self.problem.scaled_problem.coarse
        nowhere = np.zeros_like(self.slip)
        pressing = basis(layout, self.closed, self.stick | self.slip, nowhere, self.directions)
        yield pressing, coarse.restricted(pressing)
        yield sp.identity(layout.size, format="csr"), coarse

    def settled(self, residual: Vector) -> Vector:
        """Return r without the rigid motions that fit it best on the free rows. Collective."""
        scaled = self.free.T @ (evening(self.problem) * residual)
        return residual - self.problem.coarse.transpose(self.coarse.coefficients(scaled))


@dataclass(frozen=True, eq=False)
class Admissible:
    """An admissible multiplier of a Tresca problem.

    Attributes:
        multiplier: λ with λ_N ≥ 0, ‖τ‖ ≤ Ψ and G λ = e, owned.
        statuses: Statuses of contact.
        slip_bound: Ψ of the Tresca problem, shape (n_friction,), owned. It is the given one unless that
            follows the normal forces of a solution and no multiplier within it balances the load: at a load
            that friction only just resists this depends on the solver's tolerance. It is then raised to the
            computed forces.
        unbalanced: The remaining G λ − e, measured in multipliers, relative to ‖λ‖.
    """

    multiplier: Vector
    statuses: Statuses
    slip_bound: Vector
    unbalanced: float


def admissible(
    problem: DualProblem, slip_bound: Vector, follows: Marks, multiplier: Vector, residual: Vector
) -> Admissible:
    """Compute an admissible multiplier near a given one. Collective; no product.

    Where the map w = λ − ρ r of the solver indicates open contact, the normal force is set to zero, where it
    indicates slip, friction is set on its circle: a deficit there costs energy of first order, as gap and
    slip are not small. Elsewhere λ is projected on the cone.

    Args:
        problem: The dual problem.
        slip_bound: Ψ, shape (n_friction,), owned.
        follows: Discs whose slip bound follows the normal force, shape (n_friction,), owned. That of the
            others is given and not raised.
        multiplier: λ, owned.
        residual: r = F λ − d − Gᵀα, owned.
    """
    layout = problem.layout
    trial = multiplier - contact_step(layout, problem.diagonal) * residual
    wanted = trial[layout.tangential]
    length = np.linalg.norm(wanted, axis=1)
    slip = (slip_bound > 0.0) & (length >= slip_bound)
    start = np.array(multiplier)
    start[layout.normal[trial[layout.normal] <= 0.0]] = 0.0
    start[layout.tangential[slip]] = (slip_bound[slip] / length[slip])[:, None] * wanted[slip]
    stick = (slip_bound > 0.0) & ~slip
    statuses = Statuses(problem, trial[layout.normal] > 0.0, stick, slip, start)
    feasible = FeasibleSet(layout, slip_bound)
    balanced, left = _balanced(statuses, feasible, start)
    if left > ROUNDING:
        balanced, left = _balanced_by_nearest(problem, feasible, start)
    if left > UNBALANCED and global_max(problem.comm, float(follows.any())):
        endless = FeasibleSet(layout, np.where(follows, ENDLESS, slip_bound))
        balanced, left = _balanced(statuses, endless, start)
        raised = np.maximum(slip_bound, np.linalg.norm(balanced[layout.tangential], axis=1))
        slip_bound = np.where(follows, raised, slip_bound)
    return Admissible(balanced, statuses, slip_bound, left)


def _balanced_by_nearest(problem: DualProblem, feasible: FeasibleSet, start: Vector) -> tuple[Vector, float]:
    """Return the nearest multiplier of the cone in equilibrium, and the remaining G λ − e. Collective.

    Slower than `_balanced` and without its preferences, but it finds a multiplier whenever there is one:
    alternating projections stagnate before they reach a narrow set.
    """
    closest = nearest(problem, feasible, start, ROUNDING * _forces(problem, start))
    return closest, _unbalanced(problem, closest)


def _balanced(statuses: Statuses, feasible: FeasibleSet, start: Vector) -> tuple[Vector, float]:
    """Return a multiplier of the cone in equilibrium, and the remaining G λ − e. Collective.

    The shortest change of the free multipliers restores equilibrium or, where these do not suffice, of all
    closed ones, or of all; the result is projected on the cone again. Neighbouring contact forces take part:
    gluing forces alone would carry the difference through the bodies, which bends thin ones. Forces across
    open gaps come last, as each costs its gap in energy.
    """
    problem, point = statuses.problem, feasible.project(start)
    left = _unbalanced(problem, point)
    for rows, coarse in statuses.spaces():
        for _ in range(ROUNDS):
            if left <= ROUNDING:
                return point, left
            lacking = rows @ coarse.transpose(coarse.solve(problem.coarse.residual(point)))
            point = feasible.project(point - evening(problem) * lacking)
            before, left = left, _unbalanced(problem, point)
            if left > PROGRESS * before:
                break
    return point, left


def basis(
    layout: ContactLayout, closed: Marks, stick: Marks, turning: Marks, multiplier: Vector
) -> sp.csr_matrix:
    """Return Z of a face, see `fenics_contact.qp.face.face_basis`, by the directions of friction forces.

    Args:
        layout: Positions of the multipliers.
        closed: Contacts whose normal row is in it, shape (n_contact,).
        stick: Discs of which both rows are in it, shape (n_friction,).
        turning: Discs of which the direction across the friction force is in it, shape (n_friction,).
        multiplier: Multiplier with the friction forces, owned.
    """
    tau = multiplier[layout.tangential]
    length = np.linalg.norm(tau, axis=1, keepdims=True)
    direction = np.divide(tau, length, out=np.zeros_like(tau), where=length > 0.0)
    return face_basis(layout, closed, stick, turning, direction)


def _unbalanced(problem: DualProblem, multiplier: Vector) -> float:
    size = _forces(problem, multiplier)
    left = problem.coarse.norm(problem.coarse.residual(multiplier))
    return left / size if size > 0.0 else 0.0


def _forces(problem: DualProblem, multiplier: Vector) -> float:
    """Return the norm of all forces, [force]. Collective."""
    return max(problem.norm(multiplier), problem.coarse.norm(problem.coarse.load))
