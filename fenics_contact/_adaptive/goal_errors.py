"""The error of a quantity of a state: by mesh, geometry, solver and friction law, with the adjoint's weights.

With the adjoint w, ζ of the quantity J at a state, linearised with its statuses of contact, stick and slip,

    J(u) − J_h(u_h) ≈ a(u − u_h, w − w_h) − ½ J''(u − u_h, u − u_h) + ∫ ζ (c − B u_h) + J_h(p) − J_h(p_h).

The first two are sums over cells of ∫ C (G u_h − ∇u_h) : (G w_h − ∇w_h), with gradients G recovered from both
fields, and of half of the same of u_h alone for energies, J'' = a; of other quantities J'' is left out. The
third is what contact misses between nodes, the last that a nodal force is a mean of the pressure around its
node. Where the boundary is curved, facets miss a part of the body and its loads (`boundary_errors`). What
remains is of higher order where solutions are smooth, but for two things. The rim of a contact between curved
bodies lies somewhere between two nodes, which adds an error of the same order that changes its sign from mesh
to mesh. And at singular corners, where a recovered gradient misses a part of the error, the first term is
about 0.6 of what it should be.

References:
    R. Becker, R. Rannacher, An optimal control approach to a posteriori error estimation in finite element
    methods, Acta Numer. 10 (2001) 1-102. J. T. Oden, S. Prudhomme, Goal-oriented error estimation and
    adaptivity for the finite element method, Comput. Math. Appl. 41 (2001) 735-756.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch
from typing import ClassVar

import numpy as np

from fenics_contact._accuracy.discretisation import ErrorProducts, OfCells
from fenics_contact._adaptive.boundary_errors import EnergyShares, between_facets
from fenics_contact._adaptive.contact_residuals import between_nodes, of_pressures
from fenics_contact._adaptive.deformed_parts import DeformedParts
from fenics_contact._adaptive.estimates import ErrorEstimate
from fenics_contact._adaptive.state_parts import LinearParts, StateParts
from fenics_contact._base.display import tabled
from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import Task
from fenics_contact._base.threads import one_thread
from fenics_contact.design.adjoint import Adjoint, LinearisedFace, NoAdjointError, WeakChoice, linearise_face
from fenics_contact.design.contact_derivatives import bound_sensitivity
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.objective import (
    Objective,
    Partials,
    WeightedSum,
    finite_partials,
    finite_value,
    guarded_user_call,
)
from fenics_contact.design.objectives import (
    LargestPressure,
    PressureNorm,
    points_of,
)
from fenics_contact.design.sensitivity import adjoint_of
from fenics_contact.errors import InvalidInputError, collectively
from fenics_contact.results.deformed_state import DeformedState
from fenics_contact.results.state import State, comm_of


@singledispatch
def parts_of(state: State) -> StateParts:
    """Return what errors of quantities of a state are made of: in small strain."""
    return LinearParts(state)


@parts_of.register
def _(state: DeformedState) -> StateParts:
    return DeformedParts(state)


@tabled
@dataclass(frozen=True, eq=False)
class GoalError(ErrorEstimate):
    """Estimated parts of J − J_h, the exact value of a quantity less that of a state, in its unit.

    All are estimates with a sign, none is a bound; see `ErrorEstimate` for the others.

    Attributes:
        friction: By slip bounds of the solver that are not those of its normal forces, to first order.
    """

    PARTS: ClassVar = (*ErrorEstimate.PARTS, "friction")

    friction: float


def _comm_of(state: State, *_: object, **__: object) -> MPI.Comm:
    return comm_of(state)


@collectively("goal_error", _comm_of)
def goal_error(
    state: State,
    objective: Objective,
    *,
    choice: WeakChoice = WeakChoice.RELEASED,
    tolerance: float = 1e-4,
) -> GoalError:
    """Estimate the error of a quantity of a state by its adjoint. Collective.

    Costs one adjoint, about as many products as a step of the solver, and the recovery of two gradients.

    The adjoint of the largest pressure is that of `PressureNorm` with an exponent such that three nodes
    count, or nine in space: that of a single node is not resolved by the mesh. Along motions that nothing
    resists (`State.unheld`) a quantity is that of bodies which stay on average over their volume. What
    earlier load steps add to the error is not included.

    Where materials are nonlinear the adjoint is that of the tangent at the end of the load step, and products
    of errors have the tangent moduli of each cell there: the estimate is of first order. Histories of
    materials and friction count from the start of that step, which is taken as it is.

    Args:
        state: The equilibrium, of small or of large deformations.
        objective: The quantity; one that has no adjoint gives the reason as its ``without_adjoint``.
        choice: Branch of weakly active points.
        tolerance: Relative residual of the adjoint.

    Raises:
        InvalidInputError: If the state has no multipliers (see `LinearState.dual`), or the quantity is zero
            and nothing that loads the bodies reaches it.
        ConvergenceError: If the adjoint needs more iterations; not where some body can slide on the face of
            the state, or nodes of several pairs stick on each, see ``without_adjoint``.

    Example:
        >>> error = goal_error(state, LargestPressure())  # doctest: +SKIP
        >>> print(error)  # doctest: +SKIP
        >>> cells = error.by_cell("block")  # doctest: +SKIP
    """
    comm = comm_of(state)
    with Task("error of a quantity"), one_thread(comm):
        # No node moves: derivatives by the shape are neither compiled nor evaluated.
        forms = ShapeForms.at_rest(state.torn)
        with guarded_user_call(comm):
            value = finite_value(objective.value(state, forms))
        parts = parts_of(state)
        with guarded_user_call(comm):
            if why := parts.without_adjoint or getattr(objective, "without_adjoint", ""):
                return _without_adjoint(parts, value, why)
            smooth = smoothed(objective, state, forms)
            partials = finite_partials(smooth.partials(state, forms))
        partials = parts.at_rest(partials)
        linearised = linearise_face(state, choice)
        try:
            adjoint, of_solver, partials = adjoint_of(state, partials, linearised, tolerance)
        except NoAdjointError as error:
            _require_reached(state, objective, (value,), partials, 0.01 * tolerance)
            return _without_adjoint(parts, value, str(error))
        # J'' is that multiple of a; zero where it is not known.
        energies = getattr(smooth, "energies", (0.0, 0.0))
        weight = energies[0]
        inside, shares = _in_cells(state, parts.products(adjoint.displacement), weight)
        # Adjoint forces of energies are multiples of the pressure, which vanishes at the rim of a contact.
        between = between_nodes(state, adjoint.multiplier, 0.0 if weight else 0.5, parts.faced)
        others = between, of_pressures(state, partials)
        bound = _sum(comm, shares) + float(np.abs(others).sum())
        _require_reached(state, objective, (value, bound), partials, 0.01 * tolerance)
        own = EnergyShares(*energies)
        boundary, curved = between_facets(state, adjoint.displacement, own, parts.change_of_work())
        shares = _joined(shares, curved)
        bound += _sum(comm, curved)
        geometry = parts.by_gaps(adjoint) + boundary
        friction = _by_friction(state, partials, adjoint, linearised)
    return GoalError(
        value, inside + sum(others), bound, geometry, of_solver.correction, "", comm, _sizes(state), shares,
        friction,
    )  # fmt: skip


def value_of(state: State, objective: Objective) -> float:
    """Return a quantity of a state; no node moves. Collective."""
    with guarded_user_call(comm_of(state)):
        return finite_value(objective.value(state, ShapeForms.at_rest(state.torn)))


def smoothed(objective: Objective, state: State, forms: ShapeForms, spots: int = 3) -> Objective:
    """Return an objective with the same value at a state, whose adjoint the mesh resolves. Collective.

    `spots`: how many nodes along each direction the norm that replaces a largest pressure depends on.
    """
    if isinstance(objective, WeightedSum):
        return WeightedSum(tuple((weight, smoothed(each, state, forms)) for weight, each in objective.terms))
    if not isinstance(objective, LargestPressure):
        return objective
    highest = objective.value(state, forms)
    ratio = state.contact.pressure[points_of(state, "LargestPressure", objective.pair)] / highest
    wanted, p = spots ** (state.scene.dim - 1), 100.0
    # Nodes count by p^(P − 1); so many equal ones would have the same sums of these and of their squares.
    while p > 2.0 and (ratio ** (p - 1.0)).sum() ** 2 < wanted * (ratio ** (2.0 * p - 2.0)).sum():
        p = max(2.0, 0.9 * p)
    norm = PressureNorm(objective.pair, p=p)
    return (highest / norm.value(state, forms)) * norm


def _joined(shares: OfCells, others: OfCells) -> OfCells:
    """Return sums of shares; the others are of some bodies and all their cells, or none of them."""
    added = {
        name: (cells, shares[name][1] + values) for name, (cells, values) in others.items() if len(cells)
    }
    return {**shares, **added}


def _in_cells(state: State, products: ErrorProducts, weight: float) -> tuple[float, OfCells]:
    """Return Σ ∫ C e : f − ½ k ∫ C e : e over all cells, and the share of each. Collective."""
    shares, total = {}, 0.0
    for name, (cells, own) in products.first.items():
        other, product = products.second[name][1], products.product[name][1]
        total += float((product - 0.5 * weight * own).sum())
        shares[name] = cells, np.sqrt(own * other) + 0.5 * abs(weight) * own
    return float(comm_of(state).allreduce(total)), shares


def _sum(comm: MPI.Comm, shares: OfCells) -> float:
    return float(comm.allreduce(sum(float(values.sum()) for _, values in shares.values())))


def _sizes(state: State) -> dict[str, int]:
    return {name: body.mesh.n_cells for name, body in state.scene.bodies.items()}


def _require_reached(
    state: State, objective: Objective, found: tuple[float, ...], partials: Partials, least: float
) -> None:
    """Reject a quantity that is zero with all its parts, and has no error. Collective.

    `found`: the quantity, and its error if no parts cancel where it is known; `least`: what is small relative
    to the sizes of the displacements and forces on which it depends.
    """
    comm, fields = comm_of(state), (state.torn_displacement, state.rows.multiplier)
    largest = [comm.allreduce(float(np.abs(x).max(initial=0.0)), op=MPI.MAX) for x in fields]
    slopes = (partials.by_displacement, partials.by_multiplier)
    sums = [comm.allreduce(float(np.abs(x).sum())) for x in slopes]
    if max(map(abs, found)) <= least * float(np.dot(largest, sums)):
        raise InvalidInputError(
            f"a quantity needs loads that reach it, but {objective!r} is zero on this mesh: choose another "
            "place or direction, or a finer mesh if surfaces touch on that one"
        )


def _by_friction(state: State, partials: Partials, adjoint: Adjoint, linearised: LinearisedFace) -> float:
    """Return the effect of slip bounds that follow the normal forces instead of the solver's. Collective."""
    torn, rows = state.torn, state.rows
    by_bound = bound_sensitivity(torn, partials.by_multiplier, adjoint.displacement, linearised)
    missed = torn.law.bound(rows.multiplier) - rows.slip_bound
    return float(comm_of(state).allreduce(float(by_bound[torn.owned_discs] @ missed)))


def _without_adjoint(parts: StateParts, value: float, why: str) -> GoalError:
    """Return unknown parts, and what says of each cell that it is too large."""
    state, nan = parts.state, float("nan")
    return GoalError(
        value, nan, nan, nan, nan, why, comm_of(state), _sizes(state), parts.indicators(), nan
    )  # fmt: skip
