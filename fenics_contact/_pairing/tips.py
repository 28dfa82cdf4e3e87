"""Tips on an axis of revolution: ends of quadratic edges that carry a point although no area belongs to them.

A uniform pressure makes no force at the end of a quadratic edge on the axis, and where surfaces touch around
it, the other nodes carry all. Where the gap opens from the axis at once, as under a cone or a ball of few
cells, the end touches first, and alone.
"""

from __future__ import annotations

import numpy as np

from fenics_contact._pairing.masters import Master
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._surfaces.facets import FacetedSurface

#: Sine of the angle, about 2°, by which a gap must open.
OPENING = 0.035


def carrying(pair: ContactPair, slave: FacetedSurface, master: Master) -> np.ndarray:
    """Return which nodes of the undeformed slave of a pair may carry a point, shape (len(slave.nodes),)."""
    areas, (end, middle) = slave.areas > 0.0, slave.discs
    if not len(end) or pair.closure is not None or pair.fluid is not None:  # these act by area
        return areas
    places = slave.points[middle]
    across, away = master.normals_at(places, slave.normals[middle]), places - slave.points[end]
    opening = np.einsum("nd,nd->n", away, across) / np.linalg.norm(away, axis=1)
    areas[end[opening > OPENING]] = True
    return areas
