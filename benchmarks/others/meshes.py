"""Meshes of the published problems."""

from __future__ import annotations

import numpy as np

from fenics_contact import BodyMesh, gallery, readers
from fenics_contact.shapes import Circle


def rounded_punch(size: float) -> BodyMesh:
    """Mesh half the section of a punch of radius 50 and height 100 mm, whose lower edge has the fillet 10."""
    places = ((0, 0), (40, 0), (40, 10), (50, 10), (50, 100), (0, 100))
    with readers.gmsh_model("punch") as gmsh:
        cad = gmsh.model.geo
        corners = [cad.addPoint(x, y, 0, size) for x, y in places]
        flat = cad.addLine(corners[0], corners[1])
        fillet = cad.addCircleArc(corners[1], corners[2], corners[3])
        outside = cad.addLine(corners[3], corners[4])
        top = cad.addLine(corners[4], corners[5])
        axis = cad.addLine(corners[5], corners[0])
        inside = cad.addPlaneSurface([cad.addCurveLoop([flat, fillet, outside, top, axis])])
        cad.synchronize()
        for name, dim, parts in (
            ("punch", 2, [inside]),
            ("contact", 1, [flat, fillet]),
            ("top", 1, [top]),
        ):
            gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, parts), name)
        gmsh.model.mesh.generate(2)
        return readers.from_gmsh_model()["punch"]


def half_ring(inner: float, outer: float, counts: tuple[int, int], grading: float = 0.0) -> BodyMesh:
    """Mesh the right half of a ring around the origin, see `ring_part`."""
    return ring_part((inner, outer), (-np.pi / 2, np.pi / 2), counts, grading)


def ring_part(
    radii: tuple[float, float], angles: tuple[float, float], counts: tuple[int, int], grading: float = 0.0
) -> BodyMesh:
    """Mesh a part of a ring around the origin: surfaces inner, outer, and on the cuts below and above.

    `angles`: from the first axis; `counts`: cells along the radius, and around; `grading`: as of `rectangle`,
    along the radius.
    """
    (inner, outer), (first, last) = radii, angles
    flat = gallery.rectangle((inner, first), (outer, last), counts, grading=(grading, 0.0))
    radius, angle = flat.points.T
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    points[np.isclose(np.abs(angle), np.pi / 2), 0] = 0.0
    named = {"inner": "x0", "outer": "x1", "below": "y0", "above": "y1"}
    surfaces = {name: flat.surfaces[side] for name, side in named.items()}
    shapes = {"inner": Circle((0.0, 0.0), inner, hollow=True), "outer": Circle((0.0, 0.0), outer)}
    return BodyMesh(points, flat.cells, surfaces, shapes=shapes)
