"""The adjoint of a state and the derivative by its nodes, of small and of large deformations."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.progress import PhaseTimer
from fenics_contact._large_deformations.moving_contact import MovedContact
from fenics_contact._large_deformations.tangent_step import tangent_adjoint
from fenics_contact._scene.local_axes import free_part
from fenics_contact.design.adjoint import (
    Adjoint,
    LinearisedFace,
    NoAdjointError,
    StateError,
    growth_of,
    state_error,
)
from fenics_contact.design.contact_derivatives import (
    PairedFields,
    add_areas,
    bound_sensitivity,
    bounds_by_area,
    bounds_by_place,
    closures_by_area,
    contact_by_shape,
    ties_by_shape,
)
from fenics_contact.design.couplings import solve_coupled
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.load_derivatives import work_by_shape
from fenics_contact.design.objective import Partials
from fenics_contact.errors import ConvergenceError, InvalidInputError, together
from fenics_contact.feti.averages import nodal_mean_at, nodal_mean_transposed, nodal_sum
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.krylov import Stop
from fenics_contact.results.deformed_state import DeformedState
from fenics_contact.results.linear_state import as_linear
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from fenics_contact._pairing.sliding.points import SlidingPoints


def _moved_contact(state: State) -> MovedContact | None:
    """Return the contact of a state whose bodies deform much, None of others."""
    contact = state.equilibrium.evaluation.contact if isinstance(state, DeformedState) else None
    return contact if isinstance(contact, MovedContact) else None


def by_true_areas(state: State, by_area: np.ndarray) -> dict[str, np.ndarray]:
    """Return partial derivatives of an objective, by their names in `Partials`. Collective.

    Areas of the undeformed slave change with the shape alone. Those of a deformed one change with the places
    x = X + u of its nodes, by mortar also with the master's: with the displacement and the shape alike.
    """
    moved = _moved_contact(state)
    if moved is None:
        return {"by_area": by_area}
    torn, points = state.torn, moved.points
    by_now, by_before, by_met = points.areas(torn.scene).pulled_back(by_area)
    by_places = points.met_areas_pulled_back(by_met)
    for index in range(len(torn.scene.contacts)):
        add_areas(by_places, torn, index, by_now, points.coordinates)
    every, axes = np.arange(len(by_places)), torn.decomposition.axes
    free = free_part(by_places, every, ~np.isnan(moved.prescribed), axes)
    first = torn.decomposition.comm.rank == 0
    return {
        "by_displacement": nodal_mean_transposed(torn.decomposition, every, free),
        "by_shape": by_places if first else np.zeros_like(by_places),
        "by_area": by_before,
    }


def forces_by_places(state: State, pair: int, along: np.ndarray) -> dict[str, np.ndarray]:
    """Return derivatives of a pair's force on its slave at fixed multipliers, by `Partials`. Collective.

    Directions of the forces on undeformed bodies are fixed; those on moved ones turn with the surfaces.
    `along`: direction of the force, shape (components,).
    """
    moved = _moved_contact(state)
    if moved is None:
        return {}
    torn, points = state.torn, moved.points
    mine = points.points.pair == pair
    normal, friction = (
        np.where(mine.reshape(-1, *(1,) * (each.ndim - 1)), each, 0.0)
        for each in moved.at_points(state.solution.multiplier)
    )
    field = np.zeros((torn.decomposition.tearing.n_nodes, torn.components))
    field[np.unique(points.points.slave[mine])] = along
    by_places = _by_turning(points, (normal, friction), np.zeros(len(normal)), field.ravel())
    every = np.arange(len(field))
    free = free_part(
        by_places.reshape(field.shape), every, ~np.isnan(moved.prescribed), torn.decomposition.axes
    )
    return {"by_displacement": nodal_mean_transposed(torn.decomposition, every, free)}


def _by_turning(
    points: SlidingPoints, forces: tuple[np.ndarray, np.ndarray], by_gap: np.ndarray, w: np.ndarray
) -> np.ndarray:
    """Return −wᵀ ∂(Bᵀλ)/∂x and ζᵀ ∂g/∂x of normal gaps by the places of all nodes."""
    normal, friction = np.maximum(forces[0], 0.0), forces[1]
    turning, rubbing = points.stiffness(normal), points.friction_stiffness(friction)
    by_nodes = -turning.assembled() @ w - rubbing.right @ (rubbing.left.T @ w) + points.gap_rows.T @ by_gap
    return np.asarray(by_nodes + points.means_pulled_back(normal, friction, by_gap, w))


def solve_deformed_adjoint(
    state: DeformedState,
    partials: Partials,
    linearised: LinearisedFace,
    *,
    tolerance: float = 1e-9,
    max_iterations: int = 500,
) -> Adjoint:
    """Solve the transpose of the linearised equations at a deformed state. Collective.

    Its tangents are factored once more at the state itself, with the stiffness of forces that turn with their
    surfaces; the columns of the face's two bases are swapped.
    """
    require_differentiable(state)
    evaluation, torn = state.equilibrium.evaluation, state.torn
    exact = evaluation.linearised(PhaseTimer(), state.equilibrium.linearisation)
    system, tangent = exact.system, exact.problem(evaluation)
    face = replace(linearised.face, layout=tangent.problem.layout)
    growth = torn.law.growth(state.rows.multiplier)
    coupling = growth_of(face, linearised.growing, growth)
    by_multiplier = np.concatenate([partials.by_multiplier, np.zeros(exact.further.count)])
    right = system.jump(system.inverse(partials.by_displacement)) - by_multiplier
    load = np.asarray(tangent.problem.comm.allreduce(system.kernel.resultants(partials.by_displacement)))
    found = tangent_adjoint(tangent, face, coupling, right, load, tolerance, max_iterations)
    if found is None:
        raise NoAdjointError.of_loose_body()
    if found.stop is not Stop.CONVERGED:
        # Of a load outside the range of a singular operator rounding decides which of both is found.
        singular = found.stop in (Stop.NO_CURVATURE, Stop.STAGNATION)
        raise (NoAdjointError if singular else ConvergenceError)(
            f"the adjoint needs a relative residual below {tolerance:.1e}, not reached by {found.products} "
            f"products ({found.stop.value}): loosen the tolerance"
        )
    moved = system.inverse(partials.by_displacement - system.force(found.multiplier))
    multiplier = found.multiplier[: len(partials.by_multiplier)]
    return Adjoint(moved + system.kernel @ found.motions, multiplier, found.motions, found.products)


def require_differentiable(state: DeformedState) -> None:
    """Reject free rigid surfaces, fluid on other masters, and friction that needs more than the start."""
    torn, contact = state.torn, state.equilibrium.evaluation.contact
    if free := state.equilibrium.evaluation.load.free_tools:
        raise InvalidInputError(
            "derivatives of nonlinear scenes need rigid tools and surfaces whose whole motion is prescribed, "
            f"but that of {sorted(free)} has free components: prescribe what State.rigid_motions() reports"
        )
    for pair in torn.scene.contacts:
        if pair.fluids and not all(torn.scene.bodies[side.body].deforms_much for side in pair.surfaces):
            raise InvalidInputError(
                "derivatives with fluid need masters of materials for large deformations, that of "
                f"{pair.place} is of another: give it NeoHooke"
            )
    if len(torn.frictional) == 0:
        return
    if state.since > 0.0:
        raise InvalidInputError(
            "derivatives with friction need slip since the start of the load step, here it begins at "
            f"{state.since:.3g} of it: leave out finer_history=True, or prescribe less"
        )
    if isinstance(contact, MovedContact) and state.begun is None:
        raise InvalidInputError(
            "derivatives of large deformations with friction need the start of the load step, this state was "
            "read from a checkpoint, which does not keep it: solve the scene again"
        )


def deformed_contact_by_shape(
    state: DeformedState, fields: PairedFields, by_bound: np.ndarray, by_area: np.ndarray | float
) -> np.ndarray:
    """Return the derivative by the geometry of contact, replicated, shape (n_nodes, dim). Collective.

    Everything depends on places x = X + u alone, so that moving a node of the undeformed body acts as its
    displacement does: through −wᵀ ∂(Bᵀλ)/∂x and ζᵀ ∂(c − B u)/∂x. Only slip depends on its start, too, and
    areas and friction coefficients are those of the undeformed body.
    """
    torn, contact = state.torn, state.equilibrium.evaluation.contact
    result = np.zeros((torn.decomposition.tearing.n_nodes, torn.components))
    if not isinstance(contact, MovedContact) or contact.points.points.count == 0:
        return result
    points = contact.points
    (normal, friction), (by_gap, by_slip) = (contact.at_points(each) for each in fields.multipliers)
    w = _on_surfaces(torn, points, fields.displacements[0])
    by_nodes = _by_turning(points, (normal, friction), by_gap, w)
    if by_slip.any() and isinstance(state.begun, MovedContact):
        start = state.begun.points
        rows = points.slip_rows(start.material_points()) + points.slip_by_start(start)
        by_nodes -= rows.T @ by_slip.ravel()
    result += by_nodes.reshape(result.shape)
    pressed = contact.acting.pulled_back(state.torn_displacement, fields.displacements[0])
    result += nodal_sum(torn.decomposition, pressed)
    by_area = bounds_by_area(torn, normal, by_bound) + by_area
    with together(torn.decomposition.comm):
        np.add.at(result, torn.points.slave, bounds_by_place(torn, normal, by_bound))
    for index in range(len(torn.scene.contacts)):
        add_areas(result, torn, index, by_area)
    return result


def _on_surfaces(torn: TornSystem, points: SlidingPoints, field: np.ndarray) -> np.ndarray:
    """Return a torn field at the nodes of contact surfaces, zero at others, by dof. Collective."""
    nodes = points.moving_nodes
    values = np.zeros((torn.decomposition.tearing.n_nodes, torn.components))
    values[nodes] = nodal_mean_at(torn.decomposition, field, nodes)
    return values.ravel()


def adjoint_of(
    state: State,
    partials: Partials,
    linearised: LinearisedFace,
    tolerance: float,
    start: np.ndarray | None = None,
) -> tuple[Adjoint, StateError, Partials]:
    """Solve the adjoint of a state and weigh its residuals with it. Collective.

    `start`: of `solve_adjoint`, not used for deformed states.
    """
    if isinstance(state, DeformedState):
        adjoint = solve_deformed_adjoint(state, partials, linearised, tolerance=tolerance)
        unbalanced = -adjoint.displacement @ state.equilibrium.evaluation.unbalanced
        shares = np.array([state.torn.numbering.comm.allreduce(float(unbalanced))])
        return adjoint, state_error(state, partials, linearised, adjoint, shares), partials
    linear = as_linear(state, "the adjoint and its error")
    adjoint, partials = solve_coupled(linear, partials, linearised, tolerance=tolerance, start=start)
    shares = adjoint.motions * linear.dual.problem.coarse.residual(linear.solution.multiplier)
    return adjoint, state_error(state, partials, linearised, adjoint, shares), partials


def by_nodes(
    state: State, adjoint: Adjoint, partials: Partials, linearised: LinearisedFace, forms: ShapeForms
) -> np.ndarray:
    """Sum the objective's own derivative, −wᵀ δ(f_int − f) and the share of contacts and ties. Collective."""
    torn, u, w = state.torn, state.torn_displacement, adjoint.displacement
    work = work_by_shape(forms, torn, u, w)
    multipliers = state.solution.multiplier, adjoint.multiplier - partials.by_jump
    fields = PairedFields(multipliers, (w, u), partials.by_sliding)
    by_bound = bound_sensitivity(state.torn, partials.by_multiplier, w, linearised)
    by_area = partials.by_area + closures_by_area(torn, state.solution.multiplier, adjoint.multiplier)
    if isinstance(state, DeformedState):
        rows = deformed_contact_by_shape(state, fields, by_bound, by_area)
    else:
        rows = contact_by_shape(torn, fields, by_bound, by_area)
    rows = rows + ties_by_shape(torn, fields)
    return np.asarray(torn.decomposition.comm.allreduce(partials.by_shape - work)) + rows
