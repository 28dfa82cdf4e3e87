"""Where Newton's method starts in a load step: where bodies are, or where their supports take them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fenics_contact.errors import ConvergenceError
from fenics_contact.feti import TornSystem
from fenics_contact.nonlinear.equations import Configuration, Evaluation
from fenics_contact.qp import Vector, global_max, global_sum

#: Friction short of its bound by less than this part of the largest one counts as slipping.
SLIDING = 1e-2
#: Relative residual where supports take bodies above which they are pressed rather than drawn.
PRESSED = 0.5


def starts(
    evaluated: Callable[[Configuration], Evaluation], at: Configuration, moved: Vector | None
) -> tuple[Evaluation, Configuration | None]:
    """Return the equations where Newton's method starts, and where else if its first step fails. Collective.

    Bodies that touch nothing, there as here, start where their supports take them as rigid ones. So do bodies
    that slide: with their forces, on surfaces that are found where they come to lie, they are in equilibrium
    but for what lies under them. Where points stick or are pressed, the tangent knows better where bodies go.

    Args:
        evaluated: Evaluates the equations at a configuration.
        at: Where bodies are.
        moved: The displacement to which supports take them, torn, shape (torn_size,); None without any.
    """
    meeting = at.meeting
    touching = meeting is not None and _acts(meeting.torn, at.multiplier)
    if moved is None or (meeting is not None and touching and not _slides(meeting.torn, at.multiplier)):
        return evaluated(at), None
    try:
        there = evaluated(replace(at, displacement=moved))
    except ConvergenceError:
        return evaluated(at), None
    if touching:
        return (there, at) if there.residuals.worst < PRESSED else (evaluated(at), None)
    if _acts(there.torn, there.law.feasible(there.at.multiplier).project(-there.lacking)):
        return evaluated(at), None
    return there, None


def _acts(torn: TornSystem, forces: Vector) -> bool:
    """Return whether any row of contact has a force. Collective."""
    touching = torn.numbering.owned >= torn.n_equality
    return global_sum(torn.numbering.comm, np.count_nonzero(forces[touching]))[0] > 0.0


def _slides(torn: TornSystem, multiplier: Vector) -> bool:
    """Return whether all friction is at its bound. Collective."""
    comm, bound = torn.numbering.comm, torn.law.bound(multiplier)
    friction = np.linalg.norm(multiplier[torn.layout.tangential], axis=1)
    largest = global_max(comm, float(bound.max(initial=0.0)))
    return global_max(comm, float((bound - friction).max(initial=0.0))) <= SLIDING * largest
