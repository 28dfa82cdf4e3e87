"""The equilibrium of a design, started from a neighbour and, where that fails, from nothing."""

from __future__ import annotations

import logging
from functools import partial

from fenics_contact.contact import AnyState, ContactProblem
from fenics_contact.errors import (
    ConvergenceError,
    InfeasibleError,
    InvalidDesignError,
    InvalidInputError,
    safe_log,
)
from fenics_contact.scene import Scene

logger = logging.getLogger(__name__)


def design_state(
    contact: ContactProblem,
    scene: Scene,
    start: AnyState | None,
    tolerance: float,
    *,
    slip_from: AnyState | None = None,
) -> AnyState:
    """Compute the equilibrium of a design, whose surfaces may overlap before they are loaded. Collective.

    Args:
        scene: The scene in the shape of the design.
        start: State of a neighbouring design, or None for the first one.
        slip_from: State of the same design after the last load step, or None.
    """
    if scene.is_nonlinear and slip_from is not None:
        raise InvalidInputError(
            "designs of bodies that deform much have one load step, got a state before it: leave out LoadPath"
        )
    solve = partial(
        contact.solve, scene, slip_from=slip_from, tolerance=tolerance, sensitivity=True, overlap=True
    )
    try:
        return solve(start=start)
    except InfeasibleError as error:
        raise InvalidDesignError(f"the design has no equilibrium: {error}") from error
    except ConvergenceError as error:
        if start is None:
            raise
        safe_log(logger.warning, "a warm start failed, a cold one follows: %s", error)
    try:
        return solve(start=None)
    except (ConvergenceError, InfeasibleError) as error:
        raise InvalidDesignError(f"no equilibrium of the design was found: {error}") from error
