"""The ring of a chain link in gmsh: a transfinite section swept through six pieces."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from fenics_contact.gallery.ring import LinkShape
from fenics_contact.mesh_io import gmsh_model

_HEXAHEDRON, _QUADRILATERAL = 5, 3


def mesh_ring(shape: LinkShape) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Mesh the ring with hexahedra that are uniform on each piece.

    The geometry has six volumes with the physical name "volume"; the inner side of the crown at the origin is
    named "contact", that of the far crown "grip". Surfaces are read back by these names.

    Args:
        shape: The link.

    Returns:
        Coordinates, (n_nodes, 3); cells, (n_cells, 8); facets by name, (n_facets, 4); all in gmsh's order.
    """
    with gmsh_model("fenics_contact chain link") as gmsh:
        _build_ring(gmsh, shape)
        gmsh.model.mesh.generate(3)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        row = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
        row[tags.astype(np.int64)] = np.arange(tags.size)
        groups = {
            gmsh.model.getPhysicalName(dim, tag): (dim, tag) for dim, tag in gmsh.model.getPhysicalGroups()
        }
        cells = row[_elements(gmsh, *groups.pop("volume"), _HEXAHEDRON)]
        facets = {name: row[_elements(gmsh, *group, _QUADRILATERAL)] for name, group in groups.items()}
    return coordinates.reshape(-1, 3), cells, facets


def _elements(gmsh: ModuleType, dim: int, tag: int, kind: int) -> np.ndarray:
    """Node tags of the elements of one kind in a physical group, (n, 8 | 4)."""
    per_element = 8 if kind == _HEXAHEDRON else 4
    entities = gmsh.model.getEntitiesForPhysicalGroup(dim, tag)
    nodes = [gmsh.model.mesh.getElementsByType(kind, int(entity))[1] for entity in entities]
    return np.concatenate(nodes).astype(np.int64).reshape(-1, per_element)


def _build_ring(gmsh: ModuleType, shape: LinkShape) -> None:
    """Sweep the section from the foot of the contact crown once around and name the volume and surfaces."""
    geo, spacing = gmsh.model.geo, shape.spacing
    near, far = -shape.inner_radius, -shape.inner_radius - shape.straight

    def turn(face: int, centre: float) -> list[tuple[int, int]]:
        return list(
            geo.revolve(
                [(2, face)], centre, 0, 0, 0, -1, 0, np.pi / 2, numElements=[spacing.quarter], recombine=True
            )
        )

    def leg(face: int, length: float) -> list[tuple[int, int]]:
        return list(geo.extrude([(2, face)], length, 0, 0, numElements=[spacing.leg], recombine=True))

    face = _build_section(gmsh, shape)
    volumes, inner = [], []
    for sweep, argument in (
        (turn, near),
        (turn, near),
        (leg, -shape.straight),
        (turn, far),
        (turn, far),
        (leg, shape.straight),
    ):
        (_, face), (_, volume), (_, side), *_ = sweep(face, argument)
        volumes.append(volume)
        inner.append(side)
    geo.removeAllDuplicates()  # closes the ring: the last face is the first one
    geo.synchronize()
    for dim, tags, name in ((3, volumes, "volume"), (2, inner[:2], "contact"), (2, inner[3:5], "grip")):
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)


def _build_section(gmsh: ModuleType, shape: LinkShape) -> int:
    """Build the section at the foot of the contact crown (direction a is -z there) and return its tag.

    The first curve is the one on the ring's inside.
    """
    geo, section = gmsh.model.geo, shape.section
    c_a, c_b = section.corner
    beyond_a = section.crown_radius - section.thickness / 2.0
    beyond_b = section.flank_radius - section.width / 2.0

    def point(a: float, b: float) -> int:
        return int(geo.addPoint(-shape.inner_radius, b, -shape.centre_radius - a))

    corners = [point(-c_a, -c_b), point(-c_a, c_b), point(c_a, c_b), point(c_a, -c_b)]
    centres = [point(beyond_a, 0.0), point(0.0, -beyond_b), point(-beyond_a, 0.0), point(0.0, beyond_b)]
    arcs = [geo.addCircleArc(corners[k], centres[k], corners[(k + 1) % 4]) for k in range(4)]
    for k, arc in enumerate(arcs):
        geo.mesh.setTransfiniteCurve(arc, (shape.n_a if k % 2 else shape.n_b) + 1)
    face = geo.addPlaneSurface([geo.addCurveLoop(arcs)])
    geo.mesh.setTransfiniteSurface(face)
    geo.mesh.setRecombine(2, face)
    return int(face)
