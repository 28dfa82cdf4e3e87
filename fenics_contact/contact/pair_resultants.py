"""What contacts and ties transmit: force and moment on the slave of each pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector
from fenics_contact.contact.nodal_forces import NodalForces
from fenics_contact.contact.reactions import centroid
from fenics_contact.contact.resultant import Resultant, Resultants, point_of, resultant
from fenics_contact.display import displayed
from fenics_contact.feti import TornSystem
from fenics_contact.pairing import ContactPoints
from fenics_contact.scene import Surface


@displayed
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


def pair_resultants(
    torn: TornSystem, forces: NodalForces, about: GivenVector | np.ndarray | None
) -> PairResultants:
    """Return force and moment on the slave of every pair, about a point or the centroid of its surface."""
    scene = torn.scene

    def of_pair(points: ContactPoints, force: np.ndarray, number: int, slave: Surface) -> Resultant:
        mine = np.flatnonzero(points.pair == number)
        point = centroid(scene, slave) if about is None else point_of(about, scene.dim)
        return resultant(force[mine], forces.places[points.slave[mine]], point, slave)

    contacts = (of_pair(torn.points, forces.contact, k, pair.slave) for k, pair in enumerate(scene.contacts))
    ties = (of_pair(torn.ties, forces.tie, k, tie.slave) for k, tie in enumerate(scene.ties))
    return PairResultants(Resultants("contact", tuple(contacts)), Resultants("tie", tuple(ties)))
