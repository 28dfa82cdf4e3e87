"""Surfaces of sectors that go on around an axis: normals at their sides are those of the whole."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._surfaces.facets import FacetedSurface, Relief, faceted_surface
from fenics_contact._surfaces.true_surface import is_flat, reconstructed
from fenics_contact.mesh.faces import computed_rounding


@dataclass(frozen=True, eq=False)
class Neighbour:
    """How a sector goes on behind one of its sides.

    `points`: coordinates of all nodes of the body in the neighbour, where the others meet these.
    """

    here: np.ndarray
    there: np.ndarray
    points: np.ndarray


def continued(
    surface: FacetedSurface, neighbours: tuple[Neighbour, ...], *, order: int | None
) -> FacetedSurface:
    """Return a surface with the normals and the relief that it has as a part of the whole.

    Where the nodes of both sides do not lie on each other it stays as it is. `order`: of the polynomials
    through the nodes, see `reconstructed`; None: the facets alone.
    """
    nodes, count = surface.nodes, len(surface.nodes)
    points, facets, marks = [surface.points], [surface.facets], [surface.mirrored]
    for neighbour in neighbours:
        own, other = (np.flatnonzero(np.isin(nodes, side)) for side in (neighbour.here, neighbour.there))
        image = neighbour.points[nodes]
        if not len(own) or len(own) != len(other):
            return surface
        away, partner = cKDTree(image[other]).query(surface.points[own])
        if away.max() > computed_rounding(surface.points) or len(np.unique(partner)) < len(own):
            return surface
        number = count * len(points) + np.arange(count)
        number[other[partner]] = own
        points.append(image)
        facets.append(number[surface.facets])
        marks.append(surface.mirrored)
    every = np.concatenate(facets)
    whole = faceted_surface(np.concatenate(points), every, np.concatenate(marks), surface.planes)
    if order is None:
        return replace(surface, averaged=whole.averaged[:count], mirrored=whole.mirrored[:count])
    raised = reconstructed(whole, order)
    result = replace(surface, averaged=whole.averaged[:count], mirrored=whole.mirrored[:count], relief=None)
    if is_flat(raised) or raised.relief is None:
        return result
    relief, own_facets = raised.relief, len(surface.facets)
    return replace(
        result,
        relief=Relief(
            relief.normals[:count], relief.corners[:own_facets], relief.rest[:own_facets], relief.flattened
        ),
    )
