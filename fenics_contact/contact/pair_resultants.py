"""What contacts and ties transmit: force and moment on the slave of each pair."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.checks import GivenVector
from fenics_contact.contact.nodal_forces import tie_forces
from fenics_contact.contact.reactions import centroid
from fenics_contact.contact.resultant import Resultant, Resultants, point_of, resultant
from fenics_contact.pairing import ContactPoints
from fenics_contact.scene import Surface

if TYPE_CHECKING:
    from fenics_contact.contact.state import State


@dataclass(frozen=True, eq=False)
class PairResultants:
    """Forces and moments on the slaves of all pairs.

    Attributes:
        contacts: One for each contact pair of the scene, in its order.
        ties: One for each tie of the scene, in its order.
    """

    contacts: Resultants
    ties: Resultants

    def __str__(self) -> str:
        """Return both tables, without that of an empty list."""
        tables = [str(each) for each in (self.contacts, self.ties) if len(each)]
        return "\n".join(tables) or "none"


def pair_resultants(state: State, about: GivenVector | np.ndarray | None) -> PairResultants:
    """Return force and moment on the slave of every contact pair and tie. Collective."""
    scene, torn = state.scene, state.torn
    places = np.concatenate([body.mesh.points for body in scene.bodies.values()])

    def of_pair(points: ContactPoints, force: np.ndarray, number: int, slave: Surface) -> Resultant:
        mine = np.flatnonzero(points.pair == number)
        point = centroid(scene, slave) if about is None else point_of(about, scene.dim)
        return resultant(force[mine], places[points.slave[mine]], point, slave)

    tied = tie_forces(state)
    contacts = (of_pair(torn.points, state.contact.force, k, c.slave) for k, c in enumerate(scene.contacts))
    ties = (of_pair(torn.ties, tied, k, tie.slave) for k, tie in enumerate(scene.ties))
    return PairResultants(Resultants("contact", tuple(contacts)), Resultants("tie", tuple(ties)))
