"""How accurately adjoints are solved, and from what they start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fenics_contact._equilibrium.starts import carried_over
from fenics_contact.design.adjoint import WeakPoints
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State


def adjoint_tolerance(
    tolerance: float,
    weak: WeakPoints,
    *,
    share: float = 10.0,
    most: float = 1e-4,
    sharp: float = 0.1,
) -> float:
    """Return the relative residual of the adjoint of a state with such a tolerance.

    It moves the gradient by about as much as the residual of the state does, and by less than twice itself:
    1e-5 at the default tolerance. Whoever compares gradients with difference quotients needs more accurate
    states, and their adjoints follow. Where points are between two statuses, and gradients of both branches
    are compared, adjoints are a hundred times as accurate. `share`: of the state's tolerance; `most`: no
    adjoint is less accurate; `sharp`: the share where points are between two statuses.
    """
    between_statuses, rounding = weak.contacts + weak.discs > 0, 1e-11
    return max(sharp * tolerance if between_statuses else min(share * tolerance, most), rounding)


#: Name of the start among the arrays of a checkpoint.
STORED = "adjoint_start"


class NoAdjointStart:
    """The start of the first adjoint of an objective: the multiplier of its state alone."""

    def direction(self) -> np.ndarray | None:
        """Return what is added to that, owned: nothing."""

    def at(self, state: State | None) -> NoAdjointStart:
        """Return the same for another state."""
        return self

    def stored(self) -> dict[str, np.ndarray]:
        """Return it as arrays, for a checkpoint. Collective."""
        return {}


@dataclass(frozen=True, eq=False)
class AdjointStart(NoAdjointStart):
    """What the last adjoint of an objective adds to that.

    At a minimum of the energy without slip the adjoint is minus the multiplier of the state, and a multiple
    of this is part of most adjoints. It is known of the next state, too; the rest changes little on the way.

    Attributes:
        rest: Multiplier of the adjoint without its part along that of its state, owned.
        state: The state on whose rows it is.
    """

    rest: np.ndarray
    state: LinearState

    def direction(self) -> np.ndarray:
        """Return the rest."""
        return self.rest

    @classmethod
    def of(cls, state: State, multiplier: np.ndarray) -> NoAdjointStart:
        """Return what the adjoint of a state, owned, adds; nothing where bodies deform much. Collective."""
        if not isinstance(state, LinearState):
            return NoAdjointStart()
        own, comm = state.solution.multiplier, state.torn.decomposition.comm
        along, square = comm.allreduce(np.array([own @ multiplier, own @ own]))
        return cls(multiplier - (along / square if square > 0.0 else 0.0) * own, state)

    def at(self, state: State | None) -> NoAdjointStart:
        """Return the same on the rows of another state. Collective."""
        if state is self.state:
            return self
        if not isinstance(state, LinearState):
            return NoAdjointStart()
        return AdjointStart(carried_over(self.state.torn, self.rest, state.torn), state)

    def stored(self) -> dict[str, np.ndarray]:
        """Return it on all rows in their order, replicated. Collective."""
        numbering = self.state.torn.numbering
        return {STORED: numbering.gather(self.rest, np.arange(numbering.total))}


def restored(arrays: Mapping[str, np.ndarray], state: State | None) -> NoAdjointStart:
    """Return what was stored with the state of a checkpoint."""
    if STORED not in arrays or not isinstance(state, LinearState):
        return NoAdjointStart()
    return AdjointStart(arrays[STORED][state.torn.numbering.owned], state)
