"""The body of Hertz's line contact in two dimensions: a half disc on the line y = 0."""

from __future__ import annotations

import numpy as np

from fenics_contact.gallery.hemisphere import half_cylinder
from fenics_contact.mesh import BodyMesh, boundary_faces
from fenics_contact.surface_shapes import Circle


def half_disc(radius: float, n: int, *, symmetry: str = "x", grading: float = 3.0) -> BodyMesh:
    """Mesh the lower half of a disc that rests on the line y = 0 at the origin.

    It is the end of a `half_cylinder`, which has the same cells.

    Args:
        radius: Radius, [length]; the flat top lies at y = radius.
        n: Cells from the point of contact to the edge of the contact surface, and through the shell.
        symmetry: "x" keeps x >= 0, "" keeps all.
        grading: Logarithm of the ratio of the largest to the smallest cell on the way to the point of
            contact; 0 for uniform.

    Returns:
        Quadrilaterals with surfaces "contact" (the arc up to 45 degrees from the point of contact), "side"
        (the rest of it), "top", and "x0" on the plane of symmetry. No grid.

    Raises:
        InvalidInputError: If the radius, a count, the grading or the symmetry cannot be used.
    """
    solid = half_cylinder(radius, radius, n, symmetry=symmetry, grading=grading)
    nodes, local = np.unique(solid.surfaces["y0"], return_inverse=True)
    cells = local.reshape(-1, 4)  # their outward normal, -y, makes x and z a right-handed pair
    edges, _ = boundary_faces(cells, dim=2)
    surfaces = {}
    for name in ("contact", "side", "top", "x0"):
        if name in solid.surfaces:
            inside = np.isin(nodes, solid.surfaces[name])
            surfaces[name] = edges[inside[edges].all(axis=1)]
    disc = Circle((0.0, radius), radius)
    shapes = {name: disc for name in ("contact", "side")}
    return BodyMesh(solid.points[nodes][:, [0, 2]], cells, surfaces, shapes=shapes)
