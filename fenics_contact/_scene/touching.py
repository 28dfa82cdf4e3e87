"""Nodes of a slave that alone may touch its master."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh


def check_touching(mesh: BodyMesh, pair: ContactPair) -> None:
    """Reject nodes that may touch without a node set of the slave's mesh, or off the slave surface."""
    if pair.nodes is None or pair.nodes not in mesh.node_sets:
        raise InvalidInputError(
            f"ContactPair.nodes names node set {pair.nodes!r} of body {pair.slave.body!r}, which has "
            f"{sorted(mesh.node_sets)}: use one of them"
        )
    away = ~np.isin(mesh.node_sets[pair.nodes], mesh.surfaces[pair.slave.name])
    if away.any():
        raise InvalidInputError(
            f"nodes of {pair.place} that may touch must lie on its slave surface, {int(away.sum())} of "
            f"{len(away)} of {pair.nodes!r} do not: name a slave surface that has them all"
        )


def may_touch(bodies: Mapping[str, Body], pair: ContactPair | AnyTie, slave: FacetedSurface) -> np.ndarray:
    """Return which nodes of the slave of a pair may touch its master, shape (len(slave.nodes),)."""
    if not isinstance(pair, ContactPair) or pair.nodes is None:
        return np.ones(len(slave.nodes), dtype=bool)
    return np.isin(slave.nodes, bodies[pair.slave.body].mesh.node_sets[pair.nodes])
