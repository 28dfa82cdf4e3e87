"""The friction law of each contact point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.scene import ContactPair, Coulomb, Tresca


def friction_data(
    pairs: Sequence[ContactPair], points: ContactPoints
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the friction data of each contact point.

    Returns:
        Whether it has friction, shape (n,); its Coulomb coefficient (zero under Tresca), shape (n,); its
        Tresca bound as a nodal force (zero under Coulomb), shape (n,), [force].
    """
    has = np.array([pair.has_friction for pair in pairs], dtype=bool)
    laws = [pair.friction for pair in pairs]
    coefficient = np.array([law.friction_coefficient if isinstance(law, Coulomb) else 0.0 for law in laws])
    traction = np.array([law.traction if isinstance(law, Tresca) else 0.0 for law in laws])
    if len(pairs) == 0:
        return np.zeros(0, dtype=bool), np.zeros(0), np.zeros(0)
    return has[points.pair], coefficient[points.pair], traction[points.pair] * points.area
