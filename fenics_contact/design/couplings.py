"""Adjoint of states in which parts of the contact law follow the solution: friction and wear by slip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fenics_contact.design.adjoint import Adjoint, Coupling, LinearisedFace, solve_adjoint
from fenics_contact.design.objective import Partials
from fenics_contact.errors import ConvergenceError
from fenics_contact.results.linear_state import LinearState


def couplings_of(state: LinearState, linearised: LinearisedFace) -> list[Coupling]:
    """Return those that a scene calls for. Collective."""
    found: list[Coupling] = []
    if any(pair.slip_table is not None for pair in state.scene.contacts):
        from fenics_contact.design.slip_friction import SlipFriction

        found.append(SlipFriction.of(state, linearised))
    if state.scene.wears:
        from fenics_contact.design.wear_derivatives import WearBySlip

        found.append(WearBySlip.of(state))
    return found


def solve_coupled(
    state: LinearState,
    partials: Partials,
    linearised: LinearisedFace,
    *,
    tolerance: float,
    start: np.ndarray | None = None,
    max_adjoints: int = 100,
) -> tuple[Adjoint, Partials]:
    """Solve the adjoint of a state and of the parts of its law that agree with its slips. Collective.

    The adjoint is linear in the objective: what `Coupling.read` returns is y = b + M y, which GMRES solves at
    the cost of an adjoint for each product. Returns the adjoint, and the derivatives of the objective with
    those through all parts.
    """
    couplings, spent, sizes = couplings_of(state, linearised), 0, list[int]()
    nothing = replace(Partials.of(state, 0.0), by_shape=0.0 * partials.by_shape)

    def following(own: Partials, y: np.ndarray) -> Partials:
        for coupling, part in zip(couplings, np.split(y, np.cumsum(sizes)[:-1]), strict=True):
            own = coupling.following(own, part)
        return own

    def solved(own: Partials, begin: np.ndarray | None = None) -> tuple[Adjoint, np.ndarray]:
        nonlocal spent
        adjoint = solve_adjoint(state, own, linearised, tolerance=tolerance, start=begin)
        spent += adjoint.iterations
        parts = [coupling.read(own, adjoint) for coupling in couplings]
        sizes[:] = map(len, parts)
        return adjoint, np.concatenate([np.zeros(0), *parts])

    for coupling in couplings:
        partials = coupling.begun(partials)
    adjoint, right = solved(partials, start)
    if np.any(right):
        y = _smallest_residual(lambda y: y - solved(following(nothing, y))[1], right, tolerance, max_adjoints)
        partials = following(partials, y)
        adjoint, _ = solved(partials, start)
    for coupling in couplings:
        partials = coupling.ended(partials, adjoint)
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
        f"the adjoint of friction or wear by slip needs a relative residual below {tolerance:.1e}, reached "
        f"{reached / size:.1e} with {most} adjoints: let the coefficient change over a longer slip, or let a "
        "load step have fewer cycles"
    )
