"""Nodes of a slave that alone may touch its master."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.pairs import PairPart
from fenics_contact._surfaces.facets import FacetedSurface


def may_touch(bodies: Mapping[str, Body], pair: PairPart, slave: FacetedSurface) -> np.ndarray:
    """Return which nodes of the slave of a pair may touch its master, shape (len(slave.nodes),)."""
    if not pair.single_nodes:
        return np.ones(len(slave.nodes), dtype=bool)
    return np.isin(slave.nodes, bodies[pair.slave.body].mesh.node_sets[pair.single_nodes])
