"""Round bodies of equal cells around the axis, pressed for a contact of so many cells on its half width.

They are 40 half widths of four cells large and guided at their sides: half spaces to 0.1 %.
"""

from __future__ import annotations

import numpy as np

from fenics_contact import Body, BodyMesh, ContactPair, RigidPlane, Scene, Support, Surface, TotalForce
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.study.scenes.nested_box import mirrored, nested_box, nested_half
from fenics_contact.theory import contact_modulus, hertz_line, hertz_point

YOUNG, POISSON, RADIUS, SIZE, CELL = 1000.0, 0.3, 1000.0, 40.0, 0.25


def round_body(dim: int, side: float, cell: float, axis: float = 0.0) -> BodyMesh:
    """The upper (side 1) or the lower body, of cells of one size up to 1.5 from the origin."""
    count = round(1.5 / cell)
    mesh = (nested_half if dim == 2 else nested_box)(count * cell, SIZE, count)
    mesh = mesh if side > 0.0 else mirrored(mesh)
    place, height = mesh.points[:, :-1], mesh.points[:, -1]
    lift = side * ((place - axis) ** 2).sum(axis=1) / (2.0 * RADIUS) * (1.0 - np.abs(height) / SIZE)
    return mesh.moved(np.column_stack([place, height + lift]))


def pressed(
    dim: int, cells: float, ratio: float | None = None, axis: float = 0.0, discretisation: str = "best"
) -> tuple[Scene, float]:
    """Return two bodies, or one on a rigid plane, a quarter of them in space, and the peak pressure of Hertz.

    Args:
        dim: Dimension.
        cells: Cells on the half width of the contact.
        ratio: Cells of the lower body, the master, over those of the upper one; None: a rigid plane.
        axis: How far from a node the axis of the upper body is, [length].
        discretisation: That of the pair.
    """
    rigid = ratio is None
    modulus = contact_modulus(YOUNG, POISSON, np.inf if rigid else YOUNG, POISSON)
    width, curvature = cells * CELL, (1.0 if rigid else 2.0) / RADIUS
    if dim == 2:
        force = np.pi * modulus * curvature * width**2 / 4.0
        line = hertz_line(force, curvature, modulus)
        found, peak = line.half_width, line.peak_pressure
    else:
        force = 4.0 * modulus * curvature * width**3 / 3.0
        point = hertz_point(force, (curvature, curvature), modulus)
        (found, _), peak, force = point.semi_axes, point.peak_pressure, force / 4.0
    assert abs(found / width - 1.0) < 1e-9
    material = (PlaneStrain if dim == 2 else IsotropicElasticity)(YOUNG, POISSON)
    meshes = {"upper": round_body(dim, 1.0, CELL, axis)}
    if ratio is not None:
        meshes["lower"] = round_body(dim, -1.0, ratio * CELL)
    low, high = ("y0", "y1") if dim == 2 else ("z0", "z1")
    along = np.where(np.eye(dim, dtype=bool), 0.0, None)
    guides = [(f"{'xy'[k]}{end}", tuple(along[k])) for k in range(dim - 1) for end in (0, 1)]
    floor = RigidPlane((0.0,) * dim, (0.0,) * (dim - 1) + (1.0,))
    supports = [Support(name, *guide) for name in meshes for guide in guides]
    return Scene(
        {name: Body(mesh, material) for name, mesh in meshes.items()},
        supports if rigid else [*supports, Support("lower", low, tuple(along[-1]))],
        [TotalForce("upper", high, (0.0,) * (dim - 1) + (-force,))],
        [
            ContactPair(
                Surface("upper", low),
                floor if rigid else Surface("lower", high),
                discretisation=discretisation,  # type: ignore[arg-type]
            )
        ],
    ), peak
