"""Sensitivity of states of large deformations: the transpose of Newton's last tangent, its right sides."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.contact import DeformedState
from fenics_contact.errors import ConvergenceError, InvalidInputError, together
from fenics_contact.feti import TornSystem, nodal_mean_at
from fenics_contact.nonlinear import tangent_adjoint
from fenics_contact.qp import Stop
from fenics_contact.shape.adjoint import NOT_HELD, Adjoint
from fenics_contact.shape.contact_derivative import add_areas
from fenics_contact.shape.friction_derivative import bounds_by_area, bounds_by_place
from fenics_contact.shape.linearised_face import LinearisedFace, growth_of
from fenics_contact.shape.objective import Partials
from fenics_contact.shape.point_motions import PairedFields
from fenics_contact.timing import PhaseTimer

if TYPE_CHECKING:
    from fenics_contact.pairing import SlidingPoints


def solve_deformed_adjoint(
    state: DeformedState,
    partials: Partials,
    linearised: LinearisedFace,
    *,
    tolerance: float = 1e-9,
    max_iterations: int = 500,
) -> Adjoint:
    """Solve the transpose of the linearised equations at a deformed state. Collective.

    Its tangents are factored once more at the state itself, with the stiffness of forces that turn with
    their surfaces; the columns of the face's two bases are swapped.
    """
    _require_whole_step(state)
    evaluation, torn = state.equilibrium.evaluation, state.torn
    exact = evaluation.linearised(PhaseTimer(), state.equilibrium.linearisation)
    system, tangent = exact.system, exact.problem(evaluation)
    face = replace(linearised.face, layout=tangent.problem.layout)
    coupling = growth_of(face, linearised.growing, torn.friction_coefficient[torn.owned_discs])
    by_multiplier = np.concatenate([partials.by_multiplier, np.zeros(exact.further.count)])
    right = system.jump(system.inverse(partials.by_displacement)) - by_multiplier
    load = np.asarray(tangent.problem.comm.allreduce(system.kernel.T @ partials.by_displacement))
    found = tangent_adjoint(tangent, face, coupling, right, load, tolerance, max_iterations)
    if found is None:
        raise ConvergenceError(NOT_HELD)
    if found.stop is not Stop.CONVERGED:
        raise ConvergenceError(
            f"the adjoint of the deformed state needs a relative residual below {tolerance:.1e}, not reached "
            f"after {found.products} products ({found.stop.value}): loosen the tolerance"
        )
    moved = system.inverse(partials.by_displacement - system.force(found.multiplier))
    multiplier = found.multiplier[: len(partials.by_multiplier)]
    return Adjoint(moved + system.kernel @ found.motions, multiplier, found.motions, found.products)


def _require_whole_step(state: DeformedState) -> None:
    """Reject friction whose derivative needs more than the start of the load step."""
    torn, points = state.torn, state.equilibrium.evaluation.contact.points
    if len(torn.frictional) == 0:
        return
    if state.since > 0.0:
        raise InvalidInputError(
            "derivatives of nonlinear scenes with friction need slip that is one step from the start of the "
            f"load step, here it begins at {state.since:.3g} of it: leave out finer_history=True, or "
            "prescribe less where bodies snap"
        )
    if points is not None and state.begun is None:
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
    points = contact.points
    result = np.zeros((torn.decomposition.tearing.n_nodes, torn.dim))
    if points is None or points.points.count == 0:
        return result
    (normal, friction), (by_gap, by_slip) = (contact.at_points(each) for each in fields.multipliers)
    w = _on_surfaces(torn, points, fields.displacements[0])
    turning, rubbing = points.stiffness(np.maximum(normal, 0.0)), points.friction_stiffness(friction)
    by_nodes = -turning.assembled() @ w - rubbing.right @ (rubbing.left.T @ w) + points.gap_rows.T @ by_gap
    by_nodes += points.means_pulled_back(np.maximum(normal, 0.0), friction, by_gap, w)
    if by_slip.any() and state.begun is not None and (start := state.begun.points) is not None:
        rows = points.slip_rows(start.material_points()) + points.slip_by_start(start)
        by_nodes -= rows.T @ by_slip.ravel()
    result += by_nodes.reshape(result.shape)
    by_area = bounds_by_area(torn, by_bound) + by_area
    with together(torn.decomposition.comm):
        np.add.at(result, torn.points.slave, bounds_by_place(torn, normal, by_bound))
    for index in range(len(torn.scene.contacts)):
        add_areas(result, torn, index, by_area)
    return result


def _on_surfaces(torn: TornSystem, points: SlidingPoints, field: np.ndarray) -> np.ndarray:
    """Return a torn field at the nodes of contact surfaces, zero at others, by dof. Collective."""
    nodes = points.moving_nodes
    values = np.zeros((torn.decomposition.tearing.n_nodes, torn.dim))
    values[nodes] = nodal_mean_at(torn.decomposition, field, nodes)
    return values.ravel()
