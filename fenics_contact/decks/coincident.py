"""Pairs whose surfaces both hold faces of the same bodies, as preprocessors write them.

They find faces by places: where faces of two bodies coincide, both are in the slave and in the master.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from fenics_contact._scene.pairs import Surface
from fenics_contact._surfaces.facets import share_areas
from fenics_contact.mesh.body_mesh import BodyMesh

#: Slave and master.
Both: TypeAlias = tuple[Surface, Surface]


def between_different(pairs: Sequence[Both], meshes: Mapping[str, BodyMesh]) -> list[Both]:
    """Return pairs without those of a body whose faces are in both surfaces, and one sense of those of two.

    It is that in which the smaller of both surfaces has the larger area: what else is in a surface are faces
    that lie wholly within one of the other body. With equal areas the slave is what has more nodes. Other
    pairs, also of a body with itself, are left as they are.
    """
    twice = {s.body for s, m in pairs if s.body == m.body and _share(meshes[s.body], s.name, m.name)}
    best: dict[frozenset[str], tuple[tuple[float, int], Both]] = {}
    kept = list[Both]()
    for slave, master in pairs:
        bodies = frozenset((slave.body, master.body))
        if not bodies <= twice:
            kept.append((slave, master))
        elif len(bodies) == 2:
            areas = [share_areas(meshes[each.body], each.name).sum() for each in (slave, master)]
            nodes = len(np.unique(meshes[slave.body].surfaces[slave.name]))
            size = float(f"{min(areas):.6g}"), nodes
            known = best.setdefault(bodies, (size, (slave, master)))
            best[bodies] = max(known, (size, (slave, master)), key=lambda each: each[0])
    found = [*kept, *(pair for _, pair in best.values())]
    return found or list(pairs)


def _share(mesh: BodyMesh, one: str, other: str) -> bool:
    """Return whether different surfaces of a mesh have facets in common."""
    if one == other:
        return False
    rows = np.sort(np.vstack([mesh.surfaces[one], mesh.surfaces[other]]), axis=1)
    return len(np.unique(rows, axis=0)) < len(rows)
