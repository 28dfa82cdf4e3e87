"""Proportions of a chain link and the lattice that its section sweeps along the stadium-shaped ring.

The ring lies in the x-z plane. Its contact crown is the half circle on the +x side, with the middle of the
inner surface (the pole) at the origin; the far crown lies on the -x side. Lattice directions: around the ring
(in the contact crown from -z to +z), a from the inner to the outer side of the section, b along +y. They are
right-handed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import check_count, check_grading, check_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.ring_spacing import Spacing, drawn_together, strength_for
from fenics_contact.gallery.section import WireSection
from fenics_contact.gallery.structured import check_cell_type
from fenics_contact.surface_shapes import Torus

#: Largest ratio of two sizes of a link: gmsh does not mesh others.
ALIKE = 1000
#: Smallest roundness of its section, below which gmsh treats its arcs as straight lines.
FLATTEST = 1e-6


@dataclass(frozen=True, kw_only=True)
class LinkShape:
    """Proportions and mesh size of one chain link.

    The defaults are those of a short-link chain, in mm: wire of 16, pitch of 48 (three times the wire), inner
    width of 22.

    Attributes:
        inner_radius: Radius of the inner side of the crowns, half the inner width of the link, [length].
        straight: Length of the straight legs, [length]; the pitch is ``straight + 2 * inner_radius``.
        thickness: Size of the wire in the plane of the ring, [length].
        width: Size of the wire across the plane of the ring, [length].
        roundness: 1 for a round wire, less for a flatter one. See `WireSection`; 0.9 keeps corner cells sound
            and the crown 1.13 times flatter than a disc.
        n_around: Cells around the ring, a multiple of 6 (four quarter turns and two legs) and at least 12.
        n_a: Cells through the thickness.
        n_b: Cells across the width.
        grading: Logarithm of the ratio of the largest to the smallest cell along the crowns, whose cells
            shrink towards the contacts of links; 0 for uniform. Across the wire and through its thickness
            they shrink to the size that they have there along the ring. The number of cells is unchanged,
            also around the ring: some are moved from the legs to the crowns. 2.1 puts eight cells of the
            default shape, in both directions, across the circle of 2.95 mm radius in which links of steel
            touch under 80 kN (uniform: 2 along the ring).
        cell: ``"hexahedron"`` or ``"tetrahedron"``.
    """

    inner_radius: float = 11.0
    straight: float = 26.0
    thickness: float = 16.0
    width: float = 16.0
    roundness: float = 0.9
    n_around: int = 48
    n_a: int = 8
    n_b: int = 20
    grading: float = 0.0
    cell: str = "hexahedron"

    def __post_init__(self) -> None:
        """Reject sizes that do not form a ring."""
        given = {name: getattr(self, name) for name in ("inner_radius", "straight", "thickness", "width")}
        check_numbers(**given)
        for name in ("inner_radius", "straight"):
            if getattr(self, name) <= 0.0:
                raise InvalidInputError(
                    f"{name} must be positive, got {getattr(self, name)}: a link has two half circles and "
                    "two legs"
                )
        check_count(self.n_around, "n_around", 12)
        if self.n_around % 6:
            raise InvalidInputError(
                "n_around must be a multiple of 6 (four quarter turns and two legs with equally many "
                f"cells), got {self.n_around}: take {6 * max(2, round(self.n_around / 6))}"
            )
        check_count(self.n_a, "n_a")
        check_count(self.n_b, "n_b", 2)
        check_cell_type(self.cell)
        check_grading(self.grading)
        _ = self.section
        sizes = [float(size) for size in given.values()]
        if max(sizes) > ALIKE * min(sizes):
            raise InvalidInputError(
                f"inner_radius, straight, thickness and width must differ by less than a factor of {ALIKE}, "
                f"got {sizes}: give them in one unit of length"
            )
        if self.roundness < FLATTEST:
            raise InvalidInputError(
                f"roundness must be at least {FLATTEST:g}, got {self.roundness}: 0.01 is a square to the eye"
            )

    @property
    def section(self) -> WireSection:
        """The wire's cross-section."""
        return WireSection(self.thickness, self.width, self.roundness)

    @property
    def spacing(self) -> Spacing:
        """Spacing of the nodes along the three directions of the lattice."""
        return _spacing(self)

    @property
    def centre_radius(self) -> float:
        """Radius of the wire's centre line in the crowns."""
        return self.inner_radius + self.thickness / 2.0

    @property
    def opening(self) -> float:
        """Inner length of the link (the chain's pitch)."""
        return self.straight + 2.0 * self.inner_radius

    @property
    def volume(self) -> float:
        """Volume of the smooth link, section times length of the centre line (Pappus)."""
        return self.section.area * (2.0 * np.pi * self.centre_radius + 2.0 * self.straight)


def _spacing(shape: LinkShape) -> Spacing:
    """Choose the spacing for a link's `grading`.

    Cells are moved from the legs to graded crowns such that the cells on both sides of their border are most
    similar along the centre line.

    Args:
        shape: The link.

    Returns:
        The spacing; without grading a sixth of the ring for every quarter turn and leg.
    """
    n = shape.n_around // 6
    if shape.grading == 0.0:
        return Spacing(n, n)
    along = float(np.arccosh(np.exp(shape.grading)))
    quarters = np.arange(n, (3 * n + 1) // 2)
    legs = 3 * n - 2 * quarters
    last = 1.0 - np.sinh(along * (1.0 - 1.0 / quarters)) / np.sinh(along)  # part of the quarter turn
    last = np.pi / 2.0 * shape.centre_radius * last
    best = int(np.argmin(np.abs(np.log(last * legs / shape.straight))))
    quarter, leg = int(quarters[best]), int(legs[best])
    section = shape.section
    smallest = np.pi / 2.0 * shape.inner_radius / quarter * along / np.sinh(along)
    across = strength_for(smallest * shape.n_b / (2.0 * section.crown_radius * section.half_angle))
    through = strength_for(smallest * shape.n_a / shape.thickness)
    return Spacing(quarter, leg, along, across, through)


def crown_start(shape: LinkShape) -> int:
    """Index around the ring of the first node of the contact crown, counted back from the crown's middle.

    The middle of the contact crown has the index ``n_around // 16``: half a subdomain when the ring is cut
    into eight, so that no cut across the ring meets the contact of links.
    """
    return shape.n_around // 16 - shape.spacing.quarter


def stations(shape: LinkShape, spacing: Spacing | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Place the section around the ring.

    Args:
        shape: The link.
        spacing: Of the nodes; the link's own unless given.

    Returns:
        Points of the wire's centre line, (n_around, 3), and the unit direction a of the section there,
        (n_around, 3).
    """
    spacing = shape.spacing if spacing is None else spacing
    turning, n_leg = 2 * spacing.quarter, spacing.leg
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, turning + 1)
    half_turn = drawn_together(angles, 0.0, spacing.along)[:-1]
    leg = np.linspace(0.0, shape.straight, n_leg, endpoint=False)
    # Crown, leg, far crown, leg: direction a rotates in the crowns only, the centre moves along the legs
    # only.
    turn = np.concatenate([half_turn, np.full(n_leg, np.pi / 2.0)])
    turn = np.concatenate([turn, turn + np.pi])
    moved = np.concatenate([np.zeros(turning), leg, np.full(turning, shape.straight), shape.straight - leg])
    centre = np.zeros((shape.n_around, 3))
    centre[:, 0] = -shape.inner_radius - moved
    outward = np.column_stack([np.cos(turn), np.zeros(shape.n_around), np.sin(turn)])
    line = centre + shape.centre_radius * outward
    start = crown_start(shape)
    return np.roll(line, start, axis=0), np.roll(outward, start, axis=0)


def ring_lattice(shape: LinkShape, spacing: Spacing | None = None) -> np.ndarray:
    """Sweep the section's lattice around the ring.

    Args:
        shape: The link.
        spacing: Of the nodes; the link's own unless given.

    Returns:
        Points, (n_around, n_a + 1, n_b + 1, 3).
    """
    spacing = shape.spacing if spacing is None else spacing
    line, outward = stations(shape, spacing)
    section = shape.section.lattice(shape.n_a, shape.n_b, spacing.through, spacing.across)
    across = np.array([0.0, 1.0, 0.0])
    return np.asarray(
        line[:, None, None] + section[..., :1] * outward[:, None, None] + section[..., 1:] * across
    )


def crown_indices(shape: LinkShape) -> np.ndarray:
    """Indices around the ring of the contact crown's nodes, from -z to +z; (n_crown + 1,)."""
    return (crown_start(shape) + np.arange(2 * shape.spacing.quarter + 1)) % shape.n_around


def crown_shapes(shape: LinkShape) -> dict[str, Torus]:
    """Return the tori of the inner sides of the crowns, by the names of the surfaces."""
    tube = shape.section.crown_radius
    middles = {"contact": -shape.inner_radius, "grip": -shape.inner_radius - shape.straight}
    return {
        name: Torus((middle, 0.0, 0.0), (0.0, 1.0, 0.0), shape.inner_radius + tube, tube)
        for name, middle in middles.items()
    }
