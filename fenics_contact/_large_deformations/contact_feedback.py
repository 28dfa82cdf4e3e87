"""What contact of moved bodies depends on beside displacements, and what acts on its surfaces by that."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact._large_deformations.loading import DeadLoads, Loading
from fenics_contact.qp.reductions import Vector


class OnSurfaces:
    """What acts on surfaces beside multipliers: nothing by default."""

    @property
    def rim(self) -> np.ndarray | bool:
        """Marks of nodes around which its stiffness is not symmetric, shape (n_nodes,)."""
        return False

    def added(self, force: Vector, growth: DeadLoads, displacement: Vector) -> tuple[Vector, DeadLoads]:
        """Return forces of this rank, torn, and their growth, with what acts at a displacement."""
        return force, growth

    def pulled_back(self, displacement: Vector, field: Vector) -> Vector:
        """Return the derivative of its work in a field by places, of this rank, torn, at a displacement."""
        return np.zeros(len(displacement))


NOTHING_ON_SURFACES = OnSurfaces()


class ContactFeedback:
    """What changes contact of moved bodies by equilibria that it depends on: nothing by default."""

    #: What must agree, and what helps where it does not after so many equilibria.
    unsettled = ("contact must agree with its equilibrium", "take smaller load steps")
    most = 50

    def on(self, contact: Any, load: Loading) -> Any:
        """Return contact as the last equilibrium has left it, under a load. Collective."""
        return contact

    def after(self, found: Any, tolerance: float) -> ContactFeedback:
        """Return this if an equilibrium of Newton's method agrees with it, else what does. Collective."""
        return self
