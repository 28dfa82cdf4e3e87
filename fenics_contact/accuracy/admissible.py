"""An admissible multiplier near a computed one: within its cone and in equilibrium."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.accuracy.nearest import evening, nearest
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

#: Forces out of balance below this share of all forces are rounding.
ROUNDING = 1e-13
#: More out of balance than this share of all forces, and duality bounds nothing.
UNBALANCED = 1e-9
#: Rounds of projections on the cone and on equilibrium, one after the other.
ROUNDS = 100
#: A round that leaves more than this share of what was out of balance leads nowhere.
PROGRESS = 0.9
#: A slip bound beyond every force.
ENDLESS = 1e300


@dataclass(frozen=True, eq=False)
class Statuses:
    """What contact does at a multiplier, and which rows are free for it.

    Attributes:
        problem: The dual problem.
        closed: Contacts that press, shape (n_contact,), owned.
        stick: Discs that stick, shape (n_friction,), owned.
        slip: Discs on the circle, shape (n_friction,), owned; the others are pinned (Ψ = 0).
        directions: Multiplier that gives the directions of friction forces, owned.
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
        """Equilibrium by the free rows alone, in scaled multipliers. Collective on first use."""
        return self.problem.scaled_problem.coarse.restricted(self.free)

    def spaces(self) -> Iterator[tuple[sp.csr_matrix, CoarseSpace]]:
        """Bases of rows with their equilibrium: of the free rows, of all contacts that press, of all."""
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
    """A multiplier that a Tresca problem admits.

    Attributes:
        multiplier: λ with λ_N ≥ 0, ‖τ‖ ≤ Ψ and G λ = e, owned.
        statuses: What contact does.
        slip_bound: Ψ of the Tresca problem, shape (n_friction,), owned. It is the given one except where this
            follows the normal forces of a solution and no multiplier within it balances the load: at a load
            that all friction just resists the solver's tolerance decides about that. It then is raised to the
            forces that were found.
        unbalanced: What is left of G λ − e, measured in multipliers, relative to ‖λ‖.
    """

    multiplier: Vector
    statuses: Statuses
    slip_bound: Vector
    unbalanced: float


def admissible(
    problem: DualProblem, slip_bound: Vector, follows: Marks, multiplier: Vector, residual: Vector
) -> Admissible:
    """Find an admissible multiplier near a computed one. Collective; no product.

    Where the map w = λ − ρ r of the solver says open, the normal force is set to zero, where it says slip,
    friction is set on its circle: what is missing there costs energy of first order, as gap and slip are not
    small. Elsewhere λ is projected on the cone.

    Args:
        problem: The dual problem.
        slip_bound: Ψ, shape (n_friction,), owned.
        follows: Discs whose slip bound follows the normal force, shape (n_friction,), owned. That of the
            others is given and never raised.
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
    found, left = _balanced(statuses, feasible, start)
    if left > ROUNDING:
        found, left = _balanced_by_nearest(problem, feasible, start)
    if left > UNBALANCED and global_max(problem.comm, float(follows.any())):
        endless = FeasibleSet(layout, np.where(follows, ENDLESS, slip_bound))
        found, left = _balanced(statuses, endless, start)
        raised = np.maximum(slip_bound, np.linalg.norm(found[layout.tangential], axis=1))
        slip_bound = np.where(follows, raised, slip_bound)
    return Admissible(found, statuses, slip_bound, left)


def _balanced_by_nearest(problem: DualProblem, feasible: FeasibleSet, start: Vector) -> tuple[Vector, float]:
    """Return the nearest multiplier of the cone in equilibrium, and how much is left of G λ − e. Collective.

    Slower than `_balanced` and without its preferences, but it finds a multiplier wherever there is one:
    projections in turns come to rest before they reach a narrow set.
    """
    found = nearest(problem, feasible, start, ROUNDING * _forces(problem, start))
    return found, _unbalanced(problem, found)


def _balanced(statuses: Statuses, feasible: FeasibleSet, start: Vector) -> tuple[Vector, float]:
    """Return a multiplier of the cone in equilibrium, and how much is left of G λ − e. Collective.

    The shortest change of the free multipliers balances, or where these do not suffice, of all that press, or
    of all; what then leaves the cone is projected again. Contact forces next to those that were moved take
    part: gluing forces alone would carry the difference through the bodies, which bends thin ones. Forces
    across open gaps come last, as each costs its gap in energy.
    """
    problem, found = statuses.problem, feasible.project(start)
    left = _unbalanced(problem, found)
    for rows, coarse in statuses.spaces():
        for _ in range(ROUNDS):
            if left <= ROUNDING:
                return found, left
            lacking = rows @ coarse.transpose(coarse.solve(problem.coarse.residual(found)))
            found = feasible.project(found - evening(problem) * lacking)
            before, left = left, _unbalanced(problem, found)
            if left > PROGRESS * before:
                break
    return found, left


def basis(
    layout: ContactLayout, closed: Marks, stick: Marks, turning: Marks, multiplier: Vector
) -> sp.csr_matrix:
    """Return Z of a face, see `fenics_contact.qp.face.face_basis`, by the directions of friction forces.

    Args:
        layout: Positions of the multipliers.
        closed: Contacts whose normal row is in it, shape (n_contact,).
        stick: Discs of which both rows are in it, shape (n_friction,).
        turning: Discs of which the direction across the friction force is in it, shape (n_friction,).
        multiplier: Gives the friction forces, owned.
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
    """Return the size of all forces, [force]. Collective."""
    return max(problem.norm(multiplier), problem.coarse.norm(problem.coarse.load))
