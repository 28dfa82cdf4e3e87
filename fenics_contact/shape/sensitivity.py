"""The adjoint of a state and the derivative by its nodes, of small and of large deformations."""

from __future__ import annotations

import numpy as np

from fenics_contact.contact import DeformedState, LinearState, State, as_linear
from fenics_contact.shape.adjoint import Adjoint, solve_adjoint
from fenics_contact.shape.contact_derivative import contact_by_shape
from fenics_contact.shape.forms import ShapeForms
from fenics_contact.shape.friction_derivative import bound_sensitivity
from fenics_contact.shape.linearised_face import LinearisedFace
from fenics_contact.shape.objective import Partials
from fenics_contact.shape.point_motions import PairedFields
from fenics_contact.shape.state_error import StateError, state_error
from fenics_contact.shape.tied_derivative import ties_by_shape
from fenics_contact.shape.work_derivative import work_by_shape


def products_of(state: State) -> int:
    """Return the number of F-products of a state so far; those of a deformed state's adjoint do not count."""
    return state.system.products if isinstance(state, LinearState) else state.solution.products


def adjoint_of(
    state: State,
    partials: Partials,
    linearised: LinearisedFace,
    tolerance: float,
    start: np.ndarray | None = None,
) -> tuple[Adjoint, StateError]:
    """Solve the adjoint of a state and weigh its residuals with it. Collective.

    Args:
        start: Multiplier of a neighbouring adjoint, owned, or None; not used for deformed states.
    """
    if isinstance(state, DeformedState):
        from fenics_contact.shape.deformed_sensitivity import solve_deformed_adjoint

        adjoint = solve_deformed_adjoint(state, partials, linearised, tolerance=tolerance)
        unbalanced = -adjoint.displacement @ state.equilibrium.evaluation.unbalanced
        shares = np.array([state.torn.numbering.comm.allreduce(float(unbalanced))])
        return adjoint, state_error(state, partials, linearised, adjoint, shares)
    linear = as_linear(state, "the adjoint and its error")
    adjoint = solve_adjoint(linear, partials, linearised, tolerance=tolerance, start=start)
    shares = adjoint.motions * linear.dual.problem.coarse.residual(linear.solution.multiplier)
    return adjoint, state_error(state, partials, linearised, adjoint, shares)


def by_nodes(
    state: State, adjoint: Adjoint, partials: Partials, linearised: LinearisedFace, forms: ShapeForms
) -> np.ndarray:
    """Sum the objective's own derivative, −wᵀ δ(f_int − f) and the share of contacts and ties. Collective.

    Returns:
        The derivative by the nodes of all bodies, replicated, shape (n_nodes, dim).
    """
    torn, u, w = state.torn, state.torn_displacement, adjoint.displacement
    work = work_by_shape(forms, torn, u, w)
    fields = PairedFields((state.solution.multiplier, adjoint.multiplier - partials.by_jump), (w, u))
    by_bound = bound_sensitivity(state.torn, partials.by_multiplier, w, linearised)
    if isinstance(state, DeformedState):
        from fenics_contact.shape.deformed_sensitivity import deformed_contact_by_shape

        rows = deformed_contact_by_shape(state, fields, by_bound, partials.by_area)
    else:
        rows = contact_by_shape(torn, fields, by_bound, partials.by_area)
    rows = rows + ties_by_shape(torn, fields)
    return np.asarray(torn.decomposition.comm.allreduce(partials.by_shape - work)) + rows
