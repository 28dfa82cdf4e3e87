"""How load steps depend on the one before: slip is measured from where it left the contact points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.shape.objective import Partials


def require_from_rest(state: State) -> None:
    """Check that friction of a state does not depend on other states."""
    if state.contact.slip_before[state.torn.frictional].any():
        raise InvalidInputError(
            "a state alone can be differentiated if it is a single load step from rest, got one with slip of "
            "earlier steps, which depends on the design, too: use LoadPath"
        )


def with_later_steps(state: State, own: Partials, by_position: np.ndarray) -> Partials:
    """Return the derivatives of a step's objective with what all later steps add. Collective.

    Args:
        by_position: Derivative of the objectives of all later steps by the relative tangential displacement
            after this step, owned, zero in all other rows, shape (n_owned,).
    """
    columns = state.torn.free.columns
    moved = -np.asarray(state.torn.decomposition.comm.allreduce(columns.T @ by_position))
    return replace(
        own,
        by_displacement=own.by_displacement + state.torn.force(by_position),
        by_jump=own.by_jump + by_position,
        by_motion=moved if own.by_motion is None else own.by_motion + moved,
    )


def by_slip_origin(state: State, own: Partials, adjoint_multiplier: np.ndarray) -> np.ndarray:
    """Return the derivative by the positions from which a step's slip is measured, owned, (n_owned,).

    The slip B u − c enters the contact law with the adjoint's multiplier ζ and the step's own objective; the
    origin is c: the derivative is ζ − ∂J/∂(B u − c) in tangential rows.

    Args:
        own: Derivatives of the step's own objective, without those of later steps.
    """
    torn = state.torn
    tangential = torn.numbering.owned >= torn.n_equality + torn.points.count
    return np.where(tangential, adjoint_multiplier - own.by_jump, 0.0)
