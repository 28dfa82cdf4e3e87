"""The friction law of each contact point."""

from __future__ import annotations

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.errors import together
from fenics_contact.fingerprint import described, require_alike
from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.scene import Coulomb, Scene, Tresca


def friction_data(
    scene: Scene, points: ContactPoints, comm: MPI.Comm
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the friction data of each contact point. Collective on ``comm``.

    Returns:
        Whether it has friction, shape (n,); its Coulomb coefficient (zero under Tresca), shape (n,); its
        Tresca bound as a nodal force (zero under Coulomb), shape (n,), [force].

    Raises:
        InvalidInputError: If friction given as a function is negative somewhere, no number, or not the same
            on all ranks.
        UserCodeError: If such a function raises.
    """
    has, coefficient, bound = np.zeros(points.count, dtype=bool), *np.zeros((2, points.count))
    places = scene.points[points.slave]
    with together(comm):
        for number, pair in enumerate(scene.contacts):
            mine = np.flatnonzero(points.pair == number)
            has[mine] = pair.has_friction
            if isinstance(pair.friction, Coulomb):
                coefficient[mine] = pair.friction_at(places[mine])
            elif isinstance(pair.friction, Tresca):
                bound[mine] = pair.friction_at(places[mine]) * points.area[mine]
    if comm.size > 1 and any(pair.friction_varies for pair in scene.contacts):
        values = np.stack([coefficient, bound])
        require_alike(comm, described(values, "friction given as functions of position"))
    return has, coefficient, bound
