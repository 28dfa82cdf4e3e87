"""Chain links that just touch, and chains of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fenics_contact._base.checks import check_numbers
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.blocks import require_room, split_hexahedra, structured_cells
from fenics_contact.gallery.ring import (
    LinkShape,
    SweptSection,
    crown_facets,
    crown_indices,
    crown_shapes,
    drawn_together,
    stations,
)
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.chart import Chart
from fenics_contact.mesh.faces import orient
from fenics_contact.shapes.parametric import tensor_grid


@displayed
@dataclass(frozen=True, eq=False)
class DesignSurface:
    """Nodes of a surface that a design may move, with smooth coordinates on it.

    Attributes:
        nodes: Node numbers in the body's mesh, (n,) int64; s runs slowest.
        parameters: Surface coordinates (s, t) in [0, 1], (n, 2), of a curve in the plane s alone, (n, 1). On
            the crown of a link s runs along the ring over the contact crown's half turn, t across the wire
            over its inner arc; both proportional to arc length.
        directions: Unit normals of the smooth surface at these nodes, out of the body, (n, dim).
        counts: Number of nodes along s and t, or along s; their product is n, but where local refinement has
            left no grid: then the number of different s and t.
    """

    nodes: np.ndarray
    parameters: np.ndarray
    directions: np.ndarray
    counts: tuple[int, ...]


@displayed
@dataclass(frozen=True, eq=False)
class Link:
    """A chain link for a scene.

    Attributes:
        shape: Its proportions.
        mesh: The mesh with surfaces "contact" (inner side of the contact crown) and "grip" (inner side of the
            far crown, for the chain's next link), pieces of tori, and grid index (around, a, b).
        crown: The contact surface as a design surface.
    """

    shape: LinkShape
    mesh: BodyMesh
    crown: DesignSurface

    def placed(self, rotation: np.ndarray, translation: np.ndarray) -> Link:
        """Return the link moved rigidly.

        Args:
            rotation: Proper rotation matrix, (3, 3), about the origin, applied first.
            translation: Displacement, (3,).

        Returns:
            The link at its new place; design directions rotate with it.
        """
        mesh = self.mesh.placed(rotation, translation)
        return replace(
            self, mesh=mesh, crown=replace(self.crown, directions=self.crown.directions @ rotation.T)
        )


def chain_link(shape: LinkShape | None = None) -> Link:
    """Build a chain link.

    The ring lies in the x-z plane, the middle of the contact crown's inner side at the origin and the link on
    the -x side of its contact crown, see `Link`. The same shape gives bitwise the same mesh.

    Args:
        shape: Proportions and mesh size; `LinkShape()` unless given.

    Raises:
        InvalidInputError: If the shape cannot be meshed without inverted cells.
    """
    shape = LinkShape() if shape is None else shape
    counts = shape.n_around, shape.n_a, shape.n_b
    require_room(*counts)
    cells, grid = structured_cells(counts, closed=True)
    surfaces = {
        name: orient(cells, crown_facets(shape, far)) for name, far in (("contact", False), ("grip", True))
    }
    lattice = tensor_grid([np.arange(shape.n_around), np.arange(shape.n_a + 1), np.arange(shape.n_b + 1)])
    chart = Chart(SweptSection(shape), lattice, period=shape.n_around)
    mesh = BodyMesh(chart.points(), cells, surfaces, grid, shapes=crown_shapes(shape), chart=chart)
    if shape.cell == "tetrahedron":
        mesh = split_hexahedra(mesh, _mirrored(grid, shape))
    return Link(shape, mesh, _crown(shape))


def _mirrored(grid: np.ndarray, shape: LinkShape) -> np.ndarray:
    """Choose diagonals that make the tetrahedra as symmetric as the link and cut its obtuse corners in two.

    Every hexahedron's diagonal runs from the outside of the section to its middle, and along the ring from
    the contact crown's middle to the far crown's.
    """
    from_middle = (grid[:, 0] - shape.n_around // 16) % shape.n_around
    upper = 2 * grid[:, 1:] + 1 > [shape.n_a, shape.n_b]
    return np.column_stack([from_middle >= shape.n_around // 2, upper])


def _crown(shape: LinkShape) -> DesignSurface:
    around, spacing = crown_indices(shape), shape.spacing
    counts = (around.size, shape.n_b + 1)
    along, wire = (
        drawn_together(np.linspace(-1.0, 1.0, count), strength)
        for count, strength in zip(counts, (spacing.along, spacing.across), strict=True)
    )
    _, outward = stations(shape, around)
    _, normals = shape.section.inner_arc(wire)
    across = np.array([0.0, 1.0, 0.0])
    directions = normals[None, :, :1] * outward[:, None] + normals[None, :, 1:] * across
    s, t = np.meshgrid(0.5 + 0.5 * along, 0.5 + 0.5 * wire, indexing="ij")
    nodes = around[:, None] * (shape.n_a + 1) * (shape.n_b + 1) + np.arange(shape.n_b + 1)
    parameters = np.column_stack([s.ravel(), t.ravel()])
    return DesignSurface(nodes.ravel(), parameters, directions.reshape(-1, 3), counts)


PULL_AXIS = np.array([1.0, 0.0, 0.0])
"""Direction in which link 2 is pulled, away from link 1."""

_TURN = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""Rotation by 180 degrees about the diagonal of y and z: reverses the pull axis and swaps the other two."""


@dataclass(frozen=True, eq=False)
class TwoLinks:
    """Two links in contact.

    Attributes:
        first: The link to be held at its "grip"; on the -x side, ring in the x-z plane.
        second: The link to be pulled along +x at its "grip"; on the +x side, ring in the x-y plane.
    """

    first: Link
    second: Link


def two_links(
    shape: LinkShape | None = None,
    other: LinkShape | None = None,
    *,
    gap: float = 0.0,
) -> TwoLinks:
    """Build two interlocked links, the second rotated by 90 degrees about the pull axis.

    Near their contact, link 1 is concave along its ring (radius R) and convex across (radius r) and link 2
    the same, rotated. The gap between them is, with y and z across the pull axis,

        g = gap + y² (1/r1 - 1/R2) / 2 + z² (1/r2 - 1/R1) / 2,

    so they touch at a single point only if r1 < R2 and r2 < R1: the middles of the crowns, at the origin. The
    flat facets of their meshes may slightly overlap there or be separated: contact uses the smooth crowns,
    whose shapes the meshes carry.

    Args:
        shape: Link 1; `LinkShape()` unless given.
        other: Link 2; as link 1 unless given.
        gap: Clearance of the smooth crowns along the pull axis, not below zero.

    Raises:
        InvalidInputError: If the links do not fit into each other, cannot touch at one spot, or would
            penetrate.
    """
    shape = LinkShape() if shape is None else shape
    other = shape if other is None else other
    check_fit(shape, other)
    check_gap(gap)
    first = chain_link(shape)
    second = first if other == shape else chain_link(other)
    return TwoLinks(first, second.placed(_TURN, -gap * PULL_AXIS))


def check_gap(gap: float) -> None:
    """Reject an invalid clearance."""
    check_numbers(gap=gap)
    if gap < 0.0:
        raise InvalidInputError(f"gap must not be negative, got {gap}: loaded links would overlap")


def check_fit(first: LinkShape, second: LinkShape, names: tuple[str, str] = ("link 1", "link 2")) -> None:
    """Reject links that cannot be interlocked or would not touch at a single point."""
    for wire, ring, one, two in ((first, second, *names), (second, first, *names[::-1])):
        if wire.width >= 2.0 * ring.inner_radius or wire.thickness >= ring.opening:
            raise InvalidInputError(
                f"the wire of {one} must pass through the opening of {two}, got {wire.width:g} x "
                f"{wire.thickness:g} for {2.0 * ring.inner_radius:g} x {ring.opening:g}: thin the wire"
            )
        radius = wire.section.crown_radius
        if radius >= ring.inner_radius:
            raise InvalidInputError(
                f"inner_radius of {two} must exceed the radius across the wire of {one}, got "
                f"{ring.inner_radius:.6g} and {radius:.6g}: enlarge it, or take roundness closer to 1"
            )


_QUARTER_TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation about the pull axis."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Links in contact, one after the other along +x.

    Attributes:
        links: The first, third, ... ring lies in the x-z plane, the others in the x-y plane. The
            "contact" surface of each touches the "grip" of the next; the first is to be held at its "grip",
            the last to be pulled at its "contact".
    """

    links: tuple[Link, ...]

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Numbers of the links that touch."""
        return tuple((k, k + 1) for k in range(len(self.links) - 1))


def chain(shapes: Sequence[LinkShape], *, gap: float = 0.0) -> Chain:
    """Build a straight chain of links.

    Neighbours are placed as by `two_links`: each touches the one before at one point.

    Args:
        shapes: The links in their order; equal shapes are meshed once.
        gap: Clearance between neighbours' smooth crowns along the chain, not below zero.

    Raises:
        InvalidInputError: If there are fewer than two links, or neighbours do not fit into each other,
            cannot touch at one spot or would penetrate.

    Example:
        >>> five = chain([LinkShape(n_around=24, n_a=2, n_b=6)] * 5)
        >>> len(five.links), len(five.pairs)
        (5, 4)
    """
    if len(shapes) < 2:
        raise InvalidInputError(f"a chain needs two or more links, got {len(shapes)}: give all shapes")
    for number, (one, other) in enumerate(pairwise(shapes), 1):
        check_fit(one, other, (f"link {number}", f"link {number + 1}"))
    longest = max(shapes, key=lambda shape: shape.n_around)
    require_room(len(shapes) * longest.n_around, longest.n_a, longest.n_b)
    check_gap(gap)
    built = {shape: chain_link(shape) for shape in dict.fromkeys(shapes)}
    links, pole = [built[shapes[0]]], 0.0
    for number, shape in enumerate(shapes[1:], 1):
        pole += shape.opening - gap
        turn = _QUARTER_TURN if number % 2 else np.eye(3)
        links.append(built[shape].placed(turn, pole * PULL_AXIS))
    return Chain(tuple(links))
