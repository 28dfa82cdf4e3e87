"""Friction coefficients that depend on the slip: solved again until coefficients and slips agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._base.display import counted
from fenics_contact._equilibrium.passes import Passes, Solve
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State


def coefficients(torn: TornSystem, slip: np.ndarray) -> np.ndarray:
    """Return μ of the frictional points at slips of all points, shape (n, dim − 1); others keep theirs."""
    result, way = torn.friction_coefficient.copy(), np.linalg.norm(slip, axis=1)[torn.frictional]
    pairs = torn.points.pair[torn.frictional]
    for number, pair in enumerate(torn.scene.contacts):
        if pair.slip_table is not None:
            result[pairs == number] = pair.slip_table.at(way[pairs == number])
    return result


def with_coefficients(torn: TornSystem, coefficient: np.ndarray) -> TornSystem:
    """Return a system with other friction coefficients of its frictional points."""
    strengths = torn.strengths
    if strengths is not None:
        strengths = replace(strengths, coefficient=coefficient)
    return replace(torn, friction_coefficient=coefficient, strengths=strengths)


def consistent(
    solve: Solve,
    torn: TornSystem,
    known: State | None,
    before: State | None,
    tolerance: float,
    *,
    max_passes: int = 100,
) -> LinearState:
    """Return the state whose friction coefficients are those of its slips. Collective.

    Every pass is one solution at given coefficients, of whose change the next takes over a part θ: all of it
    at first, then what the last two changes r ask for, θ ← −θ r₀·(r₁ − r₀) / ‖r₁ − r₀‖². It is less than one
    where they alternate, as friction that rises steeply makes them, and more where they only get smaller.
    Where friction falls faster with the slip than bodies are stiff, changes grow in one direction: θ = 1
    follows them to where it falls no more. There may be several states, or none.

    `tolerance`: largest change of a slip bound relative to the largest.

    Raises:
        ConvergenceError: If they do not agree; carries the history of all passes.

    References:
        U. Küttler, W. A. Wall, Fixed-point fluid–structure interaction solvers with dynamic relaxation,
        Comput. Mech. 43 (2008) 61–72.
    """
    slip = np.zeros((torn.points.count, torn.components - 1))
    if before is not None and before.contact.total_slip.shape == slip.shape:
        slip = before.contact.total_slip
    mu, part, last = coefficients(torn, slip), 1.0, np.zeros(0)
    passes = Passes(solve, known)
    while passes.count < max_passes:
        state = passes.run(with_coefficients(torn, mu))
        contact = state.contact
        target = coefficients(torn, contact.total_slip)
        pressed = contact.normal_force[torn.frictional]
        size = float((np.maximum(mu, target) * pressed).max(initial=0.0))
        missing = (target - mu) * pressed
        change = float(np.abs(missing).max(initial=0.0)) / (size or 1.0)
        passes.remark(f"slip pass {passes.count}: slip bounds changed by {change:.1e}")
        if change <= tolerance:
            return passes.answer(state)
        if len(last):
            turn = missing - last
            part *= -float(last @ turn) / (float(turn @ turn) or 1.0)
            part = part if part > 0.0 else 1.0
        mu, last = np.maximum(mu + part * (target - mu), 0.0), missing
    raise ConvergenceError(
        "friction coefficients must agree with the slips, but after "
        f"{counted(passes.count, 'pass', 'passes')} "
        f"slip bounds still change by {change:.1e} of the largest: friction that falls with the slip faster "
        "than bodies are stiff has several states or none, as in stick-slip; take smaller load steps, drive "
        "the bodies by displacements, or let the coefficient fall over a longer slip",
        passes.history,
    )
