"""Corners and edges of bodies, where a surface has no normal of its own."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from fenics_contact._kinematics.measure import Measure
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface, nodal_areas
from fenics_contact._surfaces.projection import Projection, project
from fenics_contact._surfaces.true_surface import is_crease, joints_of
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import boundary_faces, vector_areas
from fenics_contact.mesh.linear_facets import linear_facets

_KNOWN: WeakKeyDictionary[BodyMesh, dict[tuple[str, bytes], np.ndarray]] = WeakKeyDictionary()
"""Which nodes of surfaces of meshes are sharp, shared with reshaped meshes."""

#: Creases count from this angle on, in degrees: half of it is how far a mean normal may be off.
SHARP = 2.0


def sharp_nodes(mesh: BodyMesh, name: str, cuts: np.ndarray) -> np.ndarray:
    """Return which nodes of a surface, ascending, lie on corners or edges of the body, shape (n,).

    Facets of the body beside the surface count, too: a surface may end at an edge, see `is_crease`. It is
    that of the mesh before any design moved it. `cuts`: which nodes lie on sides where the body goes on, such
    as planes of symmetry.
    """
    known = _KNOWN.setdefault(mesh.origin, {})
    key = name, cuts.tobytes()
    if key not in known:
        known[key] = _sharp(mesh.origin, np.unique(mesh.origin.linear.surfaces[name]), cuts)
    return known[key]


def facing_area(mesh: BodyMesh, name: str, measure: Measure, share: float = 0.05) -> np.ndarray:
    """Return the area of each node of a surface, ascending, that is enough to face a master, shape (n,).

    It is that of the mesh before any design moved it. `share`: fraction of the node's area on the smallest
    facet around it.
    """
    mesh = mesh.origin
    facets = linear_facets(mesh.linear.surfaces[name], mesh.dim).rows
    least = np.full(mesh.n_nodes, np.inf)
    np.minimum.at(least, facets, nodal_areas(mesh.points, facets, measure))
    return share * least[np.unique(facets)]


def _sharp(mesh: BodyMesh, nodes: np.ndarray, cuts: np.ndarray) -> np.ndarray:
    cells = mesh.linear.cells
    marked = np.zeros(mesh.n_nodes, dtype=bool)
    marked[nodes] = True
    if not mesh.hanging:
        # All cells at a node are among these, so that no face with a node of the surface seems to be outside.
        cells = cells[marked[cells].any(axis=1)]
    faces, _ = boundary_faces(cells, mesh.dim, mesh.hanging)
    faces = faces[marked[faces].any(axis=1) & ~cuts[faces].all(axis=1).any(axis=1)]
    surface = faceted_surface(mesh.points, linear_facets(faces, mesh.dim).rows)
    joints = joints_of(surface)
    creases = joints.corners[is_crease(surface, joints) & (joints.angle > np.radians(SHARP)), 0]
    return np.isin(nodes, surface.nodes[surface.facets.ravel()[creases]])


def corners_over(
    surface: FacetedSurface, sharp: np.ndarray, other: FacetedSurface, flat: float = 15.0
) -> tuple[np.ndarray, Projection]:
    """Return sharp nodes that touch another surface as corners do, and where they lie over it.

    Where a face beside a corner lies flat on the other surface, nodes of that find it. `flat`: angle up to
    which a face lies flat, in degrees. Facets of round bodies, whose joints may look like edges where cells
    are large, are not steeper there.
    """
    hit = project(surface.points[sharp], surface.normals[sharp], other)
    cosine = float(np.cos(np.radians(flat)))
    hit = hit.part(~_lie_flat(surface, sharp[hit.point], hit.normal, cosine))
    return sharp[hit.point], hit


def _lie_flat(surface: FacetedSurface, node: np.ndarray, normal: np.ndarray, cosine: float) -> np.ndarray:
    """Return which nodes of a surface have a facet that lies flat on the other one, shape (n,)."""
    areas = vector_areas(surface.points, surface.facets)
    areas = areas / np.maximum(np.linalg.norm(areas, axis=1), np.finfo(float).tiny)[:, None]
    place = np.full(len(surface.nodes), -1)
    place[node] = np.arange(len(node))
    facet, corner = np.nonzero(place[surface.facets] >= 0)
    at = place[surface.facets[facet, corner]]
    flat = np.zeros(len(node), dtype=bool)
    np.logical_or.at(flat, at, np.einsum("nd,nd->n", areas[facet], normal[at]) <= -cosine)
    return flat
