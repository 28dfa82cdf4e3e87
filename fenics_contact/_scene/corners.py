"""Pairs in which one side touches the other with a corner or an edge: that side is the better slave.

A slave's constraints lie at its nodes, or are means around them. Those of the other side miss a corner that
presses between them, or turn and halve its force.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.parts import SceneParts, sharp_at, surface_of
from fenics_contact._surfaces.corners import corners_over
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import project
from fenics_contact.mesh.faces import computed_rounding


def with_corner_as_slave(scene: SceneParts, pair: ContactPair) -> ContactPair:
    """Return a pair of two bodies, exchanged if its master alone touches first with a corner, and is free."""
    slave, master = pair.slave, pair.master_surface
    if not _touches_with_a_corner(scene, master, slave) or is_held(scene, master):
        return pair
    return pair if _touches_with_a_corner(scene, slave, master) else exchanged(pair)


def exchanged(pair: ContactPair) -> ContactPair:
    """Return a pair of two bodies with the other slave."""
    return replace(pair, slave=pair.master_surface, master=pair.slave)


def is_held(scene: SceneParts, side: Surface) -> bool:
    """Return whether supports hold all nodes of a surface, so that these carry no multipliers."""
    return bool(scene.fixed(side.body)[np.unique(scene.facets(side))].all())


def _touches_with_a_corner(scene: SceneParts, side: Surface, other: Surface) -> bool:
    """Return whether a corner or an edge of a side is nearest to the other one, see `corners_over`."""
    sharp = np.flatnonzero(sharp_at(scene, side))
    if not len(sharp):
        return False
    own, opposite = (surface_of(scene, each, "faceted") for each in (side, other))
    nearest, apart = _least_gap(own, opposite)
    rounding = computed_rounding(own.points)
    sharp = sharp[apart[sharp] <= abs(nearest) + rounding]
    if not len(sharp) or np.isinf(nearest):
        return False
    _, hit = corners_over(own, sharp, opposite)
    return bool(hit.gap.min(initial=np.inf) <= nearest + rounding)


def _least_gap(own: FacetedSurface, other: FacetedSurface, first: int = 100) -> tuple[float, np.ndarray]:
    """Return the least gap of nodes over another surface, infinite if none lies over it, and lower bounds.

    Surfaces may be far from each other in most places: the nodes nearest to facets come first, then those
    that may be nearer than what was found. The bounds are below the distances of all nodes, shape (n,).
    `first`: number of the first nodes.
    """
    corners = other.points[other.facets]
    middle = corners.mean(axis=1)
    # Twice the size of facets: true surfaces are above or below them.
    size = 2.0 * float(np.linalg.norm(corners - middle[:, None], axis=2).max(initial=0.0))
    apart = cKDTree(middle).query(own.points)[0] - size
    within = float(np.sort(apart)[:first][-1])
    while True:
        near = apart <= within
        gap = float(project(own.points[near], own.normals[near], other).gap.min(initial=np.inf))
        if abs(gap) <= within or near.all():
            return gap, apart
        within = abs(gap)
