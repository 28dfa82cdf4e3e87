"""Whole round bodies, solid or hollow: discs and rings, balls and hollow balls, cylinders and tubes.

A square or box of cells in the middle is surrounded by a shell whose layers end on the true surface, as in
the half bodies of Hertz; hollow bodies are the shell alone, between two true surfaces.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from fenics_contact._base.checks import check_count, check_grading, check_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.blocks import SIDES, extrude, graded, require_room, structured_cells
from fenics_contact.gallery.hertz import RoundFrame, mirrored_ticks
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.shapes.parametric import tensor_grid
from fenics_contact.shapes.simple import Circle, Cylinder, Sphere


def disc(
    radius: float, n: int, *, hole: float = 0.0, layers: int | None = None, grading: float = 0.0
) -> BodyMesh:
    """Mesh a disc about the origin, or a ring; surfaces outer, its quarters x0, x1, y0, y1, and inner.

    Args:
        radius: Radius, [length].
        n: Cells along an eighth of the circumference.
        hole: Radius of a round hole in the middle, [length]; 0 for a solid disc.
        layers: Cells through the shell around the square in the middle, of a ring from the hole to the rim;
            by default about as thick as they are long.
        grading: Logarithm of the ratio of the largest to the smallest cell on the way to the four places of
            the rim on the axes, and to the rim; 0 for uniform.

    Returns:
        Quadrilaterals with surfaces "outer" (the whole rim), "x0", "x1", "y0", "y1" (the quarters of it that
        face along −x, x, −y and y) and, of a ring, "inner" (the hole), with their true shapes. No grid.

    Raises:
        InvalidInputError: If a radius, a count or the grading cannot be used.

    Example:
        >>> ring = disc(10.0, 4, hole=7.0)
        >>> ring.cell_type, sorted(ring.surfaces)
        ('quadrilateral', ['inner', 'outer', 'x0', 'x1', 'y0', 'y1'])
    """
    return _round(partial(Circle, (0.0, 0.0)), radius, hole, n, layers, grading)


def ball(
    radius: float, n: int, *, hole: float = 0.0, layers: int | None = None, grading: float = 0.0
) -> BodyMesh:
    """Mesh a ball about the origin, or a hollow one; surfaces outer, its sixths x0 to z1, and inner.

    Args:
        radius: Radius, [length].
        n: Cells along 45 degrees, from a pole to the edge of a sixth.
        hole: Radius of the hollow in the middle, [length]; 0 for a solid ball.
        layers: Cells through the shell around the box in the middle, of a hollow ball through its wall; by
            default about as thick as they are long.
        grading: Logarithm of the ratio of the largest to the smallest cell on the way to the six poles on the
            axes, and to the surface; 0 for uniform.

    Returns:
        Hexahedra with surfaces "outer" (the whole sphere), "x0", "x1", "y0", "y1", "z0", "z1" (the sixths of
        it that face along −x, ..., z) and, of a hollow ball, "inner", with their true shapes. No grid.

    Raises:
        InvalidInputError: If a radius, a count or the grading cannot be used.

    Example:
        >>> sorted(ball(1.0, 3).surfaces)
        ['outer', 'x0', 'x1', 'y0', 'y1', 'z0', 'z1']
    """
    return _round(partial(Sphere, (0.0, 0.0, 0.0)), radius, hole, n, layers, grading)


def cylinder(
    radius: float,
    length: float,
    n: int,
    n_length: int,
    *,
    hole: float = 0.0,
    layers: int | None = None,
    grading: float = 0.0,
) -> BodyMesh:
    """Mesh a cylinder along z, or a tube; surfaces outer, its quarters x0, x1, y0, y1, bottom, top and inner.

    Args:
        radius: Radius, [length].
        length: The body reaches from z = 0 to z = length, [length].
        n: Cells along an eighth of the circumference.
        n_length: Cells along the axis, of equal length.
        hole: Radius of a round hole along the axis, [length]; 0 for a solid cylinder.
        layers: As for `disc`.
        grading: As for `disc`.

    Returns:
        Hexahedra with the surfaces of `disc`, and the ends "bottom" and "top". No grid.

    Raises:
        InvalidInputError: If a size, a count or the grading cannot be used.

    Example:
        >>> tube = cylinder(10.0, 30.0, 4, 6, hole=7.0)
        >>> tube.shapes["inner"].radius
        7.0
    """
    section = disc(radius, n, hole=hole, layers=layers, grading=grading)
    check_count(n_length, "n_length")
    check_numbers(length=length)
    if not 0.0 < length < np.inf:
        raise InvalidInputError(f"length must be positive, got {length}: give the size along the axis")
    axis = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    require_room(section.n_cells, n_length, 1)
    shapes = {
        name: Cylinder(*axis, hole if name == "inner" else radius, name == "inner") for name in section.shapes
    }
    return extrude(section, np.linspace(0.0, length, n_length + 1)).with_shapes(shapes)


def _round(
    shape: Callable[[float, bool], Sphere],
    radius: float,
    hole: float,
    n: int,
    layers: int | None,
    grading: float,
) -> BodyMesh:
    """Return a round body; `shape`: its true surface from a radius, and whether that is a hole's."""
    dim = shape(1.0, False).dim
    ticks = _checked_ticks(radius, hole, n, grading)
    layers = _layers(radius, hole, n) if layers is None else layers
    check_count(layers, "layers")
    require_room(layers if hole else layers + n, 4 * dim * n, *(2 * n,) * (dim - 2))
    facets, sides = _box_skin(2 * n, dim)
    skin, local = np.unique(facets, return_inverse=True)
    local = local.reshape(facets.shape)
    places, frame = tensor_grid([ticks] * dim), RoundFrame(radius, (), dim)
    outer = frame.sphere(places[skin])
    inner = outer * (hole / radius) if hole else frame.core(places[skin])
    share = 1.0 - graded(layers, grading)[::-1, None, None]  # thinnest layers outside; 1 on the surface
    shell = (1.0 - share) * inner + share * outer
    if hole:
        points, core = shell.reshape(-1, dim), np.zeros((0, 2**dim), dtype=np.int64)
        rows = np.arange(len(points)).reshape(-1, len(skin))
    else:
        points = np.concatenate([frame.core(places), shell[1:].reshape(-1, dim)])
        core = structured_cells((2 * n,) * dim)[0]
        rows = np.vstack([skin, np.arange(len(places), len(points)).reshape(-1, len(skin))])
    # An edge has the body on its left, so the shell on its right.
    low, high = rows[:-1, local], rows[1:, local]
    around = np.concatenate([low[..., ::-1], high] if dim == 2 else [low, high], axis=-1)
    cells, rim = np.concatenate([core, around.reshape(-1, 2**dim)]), rows[-1][local]
    surfaces = {"outer": rim, **{side: rim[sides == k] for k, side in enumerate(SIDES[: 2 * dim])}}
    if hole:
        surfaces["inner"] = rows[0][local][:, ::-1]
    shapes = {name: shape(radius, False) if name != "inner" else shape(hole, True) for name in surfaces}
    return BodyMesh(points, cells, surfaces, shapes=shapes)


def _box_skin(n: int, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the outer facets of a lattice of n cells along each axis, by its nodes, and their sides."""
    nodes, facets = np.arange((n + 1) ** dim).reshape((n + 1,) * dim), []
    for axis in range(dim):
        for end in (0, -1):
            face = nodes.take(end, axis)
            quads = [face[:-1], face[1:]] if dim == 2 else [
                face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]
            ]  # fmt: skip
            found = np.stack(quads, axis=-1).reshape(-1, 2 ** (dim - 1))
            outward = (axis % 2 == 0) == (end == -1)  # of the cross product of the other axes
            facets.append(found if outward else found[:, ::-1])
    return np.concatenate(facets), np.repeat(np.arange(2 * dim), n ** (dim - 1))


def _layers(radius: float, hole: float, n: int) -> int:
    """Return how many layers make the cells of a shell about as thick as they are long."""
    if not hole:
        return n
    long = np.pi / 4 * 0.5 * (radius + hole) / n
    return max(1, round(min((radius - hole) / long, 1e6)))


def _checked_ticks(radius: float, hole: float, n: int, grading: float) -> np.ndarray:
    """Return the ends of cells from −1 to 1, if the arguments can be used."""
    check_count(n, "n", 2)
    check_numbers(radius=radius, hole=hole)
    check_grading(grading)
    if not 0.0 <= hole < radius < np.inf:
        raise InvalidInputError(
            f"0 <= hole < radius is needed, got radius {radius} and hole {hole}: give hole=0 for a solid body"
        )
    return mirrored_ticks(n, grading)
