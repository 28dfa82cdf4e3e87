"""The bodies of a bolted joint, halved at the plane y = 0: plates with a hole, and bolts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact._base.checks import MOST, check_count, check_numbers, check_row
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.blocks import extrude, rectangle_lattice, require_room, structured_cells
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import boundary_faces, merge_duplicate_nodes
from fenics_contact.shapes.simple import Cylinder

CORE = 0.5
"""Half the width of the square in the middle of a round bar over the bar's radius."""


def drilled_plate(
    hole: float,
    half_width: float,
    ends: tuple[float, float],
    heights: ArrayLike,
    n: int,
    *,
    n_radial: int | None = None,
) -> BodyMesh:
    """Mesh half a strip with a round hole at the z-axis.

    Args:
        hole: Radius of the hole, [length].
        half_width: The strip reaches from y = 0 to y = half_width, [length].
        ends: x of both ends, at or beyond the square around the hole, [length].
        heights: z of the planes between layers of cells, ascending, (n_layers + 1,), [length].
        n: Cells along an eighth of the hole.
        n_radial: Cells from the hole to the square around it; n unless given.

    Returns:
        Hexahedra with surfaces "bottom", "top", "hole", the ends "x0" and "x1", the cut "y0" and the side
        "y1". No grid.

    Raises:
        InvalidInputError: If sizes do not fit into each other or a count cannot be used.
    """
    n_radial = n if n_radial is None else n_radial
    check_count(n, "n")
    check_count(n_radial, "n_radial")
    check_numbers(hole=hole, half_width=half_width)
    check_row(ends, "ends", 2)
    left, right = ends
    if not (0 < hole < half_width and left <= -half_width and half_width <= right):
        raise InvalidInputError(
            f"0 < hole < half_width < ends are needed, got {hole}, {half_width} and {tuple(ends)}: correct it"
        )
    circle, square = _half_turn(n)
    parts = [_rings(hole * circle, half_width * square, n_radial)]
    across = half_width * square[: n + 1, 1]
    for near, far in ((half_width, right), (left, -half_width)):
        if far > near:
            count = max(1, round(min(n * (far - near) / half_width, 2 * MOST)))
            check_count(count, "cells as long as wide along the strip")
            strip = rectangle_lattice([np.linspace(near, far, count + 1), across])
            parts.append((strip.points, strip.cells))
    section = _section(
        parts, {"x0": (0, left), "x1": (0, right), "y0": (1, 0.0), "y1": (1, half_width)}, "hole"
    )
    bore = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), hole, hollow=True)
    return extrude(section, heights).with_shapes({"hole": bore})


def bolt(
    shank: float,
    head: float,
    grip: tuple[float, float],
    head_height: float,
    n: int,
    *,
    n_radial: int | None = None,
    layers: tuple[int, int] = (4, 2),
) -> BodyMesh:
    """Mesh half a bolt along z, in one piece; surfaces head, nut, shank, side, top, bottom, y0.

    Args:
        shank: Radius of the shank, [length].
        head: Radius of head and nut, [length].
        grip: z between which the shank is free: what is clamped, [length].
        head_height: Height of head and nut, [length].
        n: Cells along an eighth of the circumference.
        n_radial: Cells from the shank's surface to that of the head; n unless given.
        layers: Cells along the shank, and through head and nut.

    Returns:
        Hexahedra with surfaces "head" and "nut" (which press on what is clamped), "shank" and the rest of the
        "side", the ends "top" and "bottom" and the cut "y0". Regions "shank" (between head and nut) and
        "ends". No grid.

    Raises:
        InvalidInputError: If sizes do not fit into each other or a count cannot be used.
    """
    n_radial = n if n_radial is None else n_radial
    check_row(layers, "layers", 2)
    check_row(grip, "grip", 2)
    check_numbers(shank=shank, head=head, head_height=head_height)
    for count, name in ((n, "n"), (n_radial, "n_radial"), (layers[0], "layers[0]"), (layers[1], "layers[1]")):
        check_count(count, name)
    if not (0 < shank < head and grip[0] < grip[1] and head_height > 0):
        raise InvalidInputError(
            f"0 < shank < head, an ascending grip and head_height > 0 are needed, got {shank}, {head}, "
            f"{tuple(grip)} and {head_height}: correct the sizes"
        )
    along = np.linspace(*grip, layers[0] + 1)
    above = grip[1] + np.linspace(0, head_height, layers[1] + 1)[1:]
    below = grip[0] - np.linspace(0, head_height, layers[1] + 1)[:0:-1]
    section = _round_section((shank, head), n, n_radial)
    wide = np.isin(np.arange(section.n_cells), section.regions["wide"])
    in_grip = np.repeat([False, True, False], [layers[1], layers[0], layers[1]])
    swept = extrude(section, np.concatenate([below, along, above]), present=~(in_grip[:, None] & wide))
    middle = swept.points[swept.cells][:, :, 2].mean(axis=1)
    between = (middle > grip[0]) & (middle < grip[1])
    regions = {"shank": np.flatnonzero(between), "ends": np.flatnonzero(~between)}
    bars = {"shank": shank, "side": head}
    shapes = {name: Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), radius) for name, radius in bars.items()}
    surfaces = _bolt_surfaces(swept, shank, grip)
    return BodyMesh(swept.points, swept.cells, surfaces, None, regions, shapes=shapes)


def _bolt_surfaces(swept: BodyMesh, shank: float, grip: tuple[float, float]) -> dict[str, np.ndarray]:
    """Separate bearing faces of head and nut from the ends of the bolt, and the shank from their sides."""
    faces, _ = boundary_faces(swept.cells)
    x, y, z = np.moveaxis(swept.points[faces], -1, 0)
    size = np.ptp(swept.points)
    flat = np.ptp(z, axis=1) < 1e-9 * size
    cut = (y < 1e-9 * size).all(axis=1)
    low, high = z.mean(axis=1) < grip[0] - 1e-9 * size, z.mean(axis=1) > grip[1] + 1e-9 * size
    inner = (np.hypot(x, y) < shank * (1 + 1e-9)).all(axis=1)
    chosen = {
        "head": flat & (np.abs(z.mean(axis=1) - grip[1]) < 1e-9 * size),
        "nut": flat & (np.abs(z.mean(axis=1) - grip[0]) < 1e-9 * size),
        "top": flat & high,
        "bottom": flat & low,
        "y0": cut,
        "shank": ~flat & ~cut & inner,
        "side": ~flat & ~cut & ~inner,
    }
    return {name: faces[mask] for name, mask in chosen.items()}


def _round_section(radii: tuple[float, float], n: int, n_radial: int) -> BodyMesh:
    """Half a disc in quadrilaterals with a circle of the smaller radius; region "wide" lies outside it."""
    small, large = radii
    circle, square = _half_turn(n)
    upper = square[: n + 1, 1]
    ticks = CORE * small * np.concatenate([-upper[:0:-1], upper])
    core = rectangle_lattice([ticks, CORE * small * upper])
    inner = _rings(CORE * small * square, small * circle, max(2, n // 2))
    outer = _rings(small * circle, large * circle, n_radial)
    section = _section([(core.points, core.cells), inner, outer], {"y0": (1, 0.0)}, "side")
    last = np.arange(section.n_cells - outer[1].shape[0], section.n_cells)
    regions = {"wide": last, "narrow": np.arange(last[0])}
    return BodyMesh(section.points, section.cells, section.surfaces, None, regions)


def _half_turn(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points at equal angles from 0 to π on the unit circle and on the square around it, (4 n + 1, 2)."""
    angle = np.linspace(0, np.pi, 4 * n + 1)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    square = np.round(circle / np.abs(circle).max(axis=1, keepdims=True), 14)
    circle[-1, 1] = square[-1, 1] = 0.0
    return circle, square


def _rings(inner: np.ndarray, outer: np.ndarray, layers: int) -> tuple[np.ndarray, np.ndarray]:
    """Quadrilaterals between two curves with equally many points, counter-clockwise."""
    require_room(layers, len(inner) - 1)
    share = np.linspace(0, 1, layers + 1)[:, None, None]
    points = ((1 - share) * inner + share * outer).reshape(-1, 2)
    return points, structured_cells((layers, len(inner) - 1))[0]


def _section(
    parts: list[tuple[np.ndarray, np.ndarray]], sides: dict[str, tuple[int, float]], rest: str
) -> BodyMesh:
    """Join parts whose borders have the same points and name straight sides by coordinate and value."""
    offset = np.cumsum([0, *(len(points) for points, _ in parts)])
    cells = np.concatenate([cells + start for (_, cells), start in zip(parts, offset, strict=False)])
    points, cells, _ = merge_duplicate_nodes(np.concatenate([points for points, _ in parts]), cells)
    edges, _ = boundary_faces(cells, dim=2)
    left = np.ones(len(edges), dtype=bool)
    surfaces = {}
    for name, (axis, value) in sides.items():
        on_side = (np.abs(points[edges][..., axis] - value) < 1e-9 * np.ptp(points)).all(axis=1)
        surfaces[name], left = edges[on_side], left & ~on_side
    return BodyMesh(points, cells, {**surfaces, rest: edges[left]})
