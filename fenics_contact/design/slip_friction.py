"""Adjoint of states whose friction coefficients are those of their slips."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fenics_contact.design.adjoint import Adjoint, LinearisedFace, solve_adjoint, with_later_steps
from fenics_contact.design.contact_derivatives import bound_sensitivity
from fenics_contact.design.objective import Partials
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.linear_state import LinearState


def solve_following_slip(
    state: LinearState,
    partials: Partials,
    linearised: LinearisedFace,
    *,
    tolerance: float,
    start: np.ndarray | None = None,
    max_adjoints: int = 100,
) -> tuple[Adjoint, Partials]:
    """Solve the adjoint of a state and of the coefficients μ(s) that agree with its slips s. Collective.

    With coefficients held, the adjoint w gives ∂J/∂Ψ of slip bounds. By Ψ = μ(s) λ_N these depend on slips,
    which the objective depends on in turn by y = ∂J/∂Ψ λ_N μ'(s), along the slip. The adjoint is linear in
    the objective: y = b + M y, which GMRES solves at the cost of an adjoint for each product. Returns the
    adjoint, and the derivatives of the objective with those by the slips.
    """
    torn, spent = state.torn, 0
    slope, direction = _slopes(state)
    chosen = np.flatnonzero(slope)
    nothing = replace(
        partials,
        by_displacement=0.0 * partials.by_displacement,
        by_multiplier=0.0 * partials.by_multiplier,
        by_motion=0.0,
        by_area=0.0,
        by_jump=0.0,
    )

    def following(own: Partials, y: np.ndarray) -> Partials:
        by_slip = np.zeros_like(direction)
        by_slip[chosen] = y[:, None] * direction[chosen]
        return with_later_steps(state, own, _on_rows(torn, by_slip)) if len(y) else own

    def solved(own: Partials, begin: np.ndarray | None = None) -> tuple[Adjoint, np.ndarray]:
        nonlocal spent
        adjoint = solve_adjoint(state, own, linearised, tolerance=tolerance, start=begin)
        spent += adjoint.iterations
        by_bound = bound_sensitivity(torn, own.by_multiplier, adjoint.displacement, linearised)
        return adjoint, (slope * by_bound)[chosen]

    adjoint, right = solved(partials, start)
    if np.any(right):
        y = _smallest_residual(lambda y: y - solved(following(nothing, y))[1], right, tolerance, max_adjoints)
        partials = following(partials, y)
        adjoint, _ = solved(partials, start)
    return replace(adjoint, iterations=spent), partials


def _smallest_residual(
    apply: Callable[[np.ndarray], np.ndarray], right: np.ndarray, tolerance: float, most: int
) -> np.ndarray:
    """Solve A y = b by GMRES; products are few and dear, so all are kept."""
    size = reached = float(np.linalg.norm(right))
    ways, images, following = np.zeros((len(right), 0)), np.zeros((len(right), 0)), right
    for _ in range(most):
        for _again in range(2):  # against rounding
            following = following - ways @ (ways.T @ following)
        ways = np.column_stack([ways, following / (np.linalg.norm(following) or 1.0)])
        following = apply(ways[:, -1])
        images = np.column_stack([images, following])
        shares = np.linalg.lstsq(images, right, rcond=None)[0]
        reached = float(np.linalg.norm(right - images @ shares))
        if reached <= tolerance * size:
            return np.asarray(ways @ shares)
    raise ConvergenceError(
        f"the adjoint of friction by slip needs a relative residual below {tolerance:.1e}, reached "
        f"{reached / size:.1e} with {most} adjoints: let the coefficient change over a longer slip"
    )


def _slopes(state: LinearState) -> tuple[np.ndarray, np.ndarray]:
    """Return ∂Ψ/∂s of frictional points, shape (n,), [force / length], and the directions of their slips."""
    torn, contact = state.torn, state.contact
    slip, pressed = contact.total_slip[torn.frictional], contact.normal_force[torn.frictional]
    way, slope = np.linalg.norm(slip, axis=1), np.zeros(len(slip))
    pairs = torn.points.pair[torn.frictional]
    for number, pair in enumerate(torn.scene.contacts):
        if pair.slip_table is not None:
            slope[pairs == number] = pair.slip_table.growth(way[pairs == number])
    slope[torn.groups.slips.strength.limited(pressed)] = 0.0
    slope[way == 0.0] = 0.0
    return slope * pressed, slip / np.where(way > 0.0, way, 1.0)[:, None]


def _on_rows(torn: TornSystem, by_slip: np.ndarray) -> np.ndarray:
    """Return values at frictional points, shape (n, dim − 1), on the owned rows, zero on others."""
    result = np.zeros(len(torn.numbering.owned))
    place = torn.numbering.owned_index(torn.tangential_rows.ravel())
    result[place[place >= 0]] = by_slip.ravel()[place >= 0]
    return result
