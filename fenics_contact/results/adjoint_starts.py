"""What adjoints start from beside the multiplier of their state: the rest of the one before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fenics_contact.feti.carried import carried_over
from fenics_contact.feti.torn import TornSystem

#: Name of the start among the arrays of a checkpoint.
STORED = "adjoint_start"


class NoAdjointStart:
    """The start of the first adjoint of an objective: the multiplier of its state alone."""

    def direction(self) -> np.ndarray | None:
        """Return what is added to that, owned: nothing."""

    def at(self, torn: TornSystem) -> NoAdjointStart:
        """Return the same for the state of another system. Collective."""
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
        torn: The system on whose rows it is.
    """

    rest: np.ndarray
    torn: TornSystem

    def direction(self) -> np.ndarray:
        """Return the rest."""
        return self.rest

    @classmethod
    def of(cls, torn: TornSystem, own: np.ndarray, multiplier: np.ndarray) -> AdjointStart:
        """Return what an adjoint adds to the multiplier of its own state, both owned. Collective."""
        along, square = torn.decomposition.comm.allreduce(np.array([own @ multiplier, own @ own]))
        return cls(multiplier - (along / square if square > 0.0 else 0.0) * own, torn)

    def at(self, torn: TornSystem) -> AdjointStart:
        """Return the same on the rows of another system. Collective."""
        if torn is self.torn:
            return self
        return AdjointStart(carried_over(self.torn, self.rest, torn), torn)

    def stored(self) -> dict[str, np.ndarray]:
        """Return it on all rows in their order, replicated. Collective."""
        numbering = self.torn.numbering
        return {STORED: numbering.gather(self.rest, np.arange(numbering.total))}


def restored(arrays: Mapping[str, np.ndarray], torn: TornSystem) -> NoAdjointStart:
    """Return what was stored with the state of a system."""
    if STORED not in arrays:
        return NoAdjointStart()
    return AdjointStart(arrays[STORED][torn.numbering.owned], torn)
