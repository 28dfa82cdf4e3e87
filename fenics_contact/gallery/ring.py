"""The ring of a chain link: proportions, section, spacing, and its lattice.

The ring lies in the x-z plane. Its contact crown is the half circle on the +x side, with the middle of the
inner surface (the pole) at the origin; the far crown lies on the -x side. Lattice directions: around the ring
(in the contact crown from -z to +z), a from the inner to the outer side of the section, b along +y. They are
right-handed.

The nodes along a direction are concentrated by the map

    x -> sinh(κ x) / sinh(κ)

of [-1, 1] with the contact at 0, which is smooth there: cells near the contact are almost equal, and those at
the ends cosh κ times as large. The strength κ of the crowns comes from `LinkShape.grading`; across the wire
and through its thickness it is chosen such that the cell at the contact is as small as along the ring.

In the section's own coordinates (a, b), a points away from the ring's inside and b along the ring's axis. The
four arcs turn by the same angle, ``roundness`` times 90 degrees: 0 would be a rectangle, 1 an ellipse-like
oval (a disc for equal sizes) whose corner cells are flat. With the half angle φ and τ = tan(φ/2) the corners
(±c_a, ±c_b) satisfy

    c_a + τ c_b = r_a,    c_b + τ c_a = r_b,

where r_a and r_b are half the thickness and half the width: an arc over a chord of length 2c rises by τ c.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import check_count, check_grading, check_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.blocks import check_cell_type
from fenics_contact.shapes.simple import Torus


@dataclass(frozen=True)
class Spacing:
    """Cells and strengths of a ring.

    `quarter`: cells on a quarter turn of a crown; `leg`: cells on a leg, all of one length; `along`: strength
    κ on the crowns, 0 for equal cells; `through`: strength through its thickness, towards its inner side.
    """

    quarter: int
    leg: int
    along: float = 0.0
    across: float = 0.0
    through: float = 0.0


def drawn_together(places: np.ndarray, strength: float) -> np.ndarray:
    """Concentrate points of [−1, 1] towards 0; the ends stay."""
    if strength == 0.0:
        return places
    return np.asarray(np.sinh(strength * places) / np.sinh(strength))


def strength_for(smallest: float) -> float:
    """Find κ with κ / sinh κ = ``smallest``, the smallest cell over the mean; 0 if that is not below 1."""
    if smallest >= 1.0:
        return 0.0
    from scipy.optimize import brentq  # graded rings alone need it

    # x / sinh x falls from 1 and is about 2 x exp(-x), which lies below at the end of the interval.
    most = 10.0 - 2.0 * float(np.log(smallest))
    return float(brentq(lambda x: x / np.sinh(x) - smallest, 1e-9, most))


@dataclass(frozen=True)
class WireSection:
    """A rounded square.

    `thickness`: size along a (radially in the ring); `roundness`: turning angle of every arc over 90 degrees,
    above 0 and below 1.
    """

    thickness: float
    width: float
    roundness: float

    def __post_init__(self) -> None:
        """Reject sizes that have no such shape."""
        check_numbers(thickness=self.thickness, width=self.width, roundness=self.roundness)
        if not (0.0 < self.thickness and 0.0 < self.width):
            raise InvalidInputError(
                f"thickness and width must be positive, got {self.thickness} and {self.width}: correct them"
            )
        if not 0.0 < self.roundness < 1.0:
            raise InvalidInputError(f"roundness must lie between 0 and 1, got {self.roundness}: take 0.9")
        if min(self.corner) <= 0.0:
            raise InvalidInputError(
                f"a section {self.thickness} thick and {self.width} wide is too slender for roundness "
                f"{self.roundness}: lower that, or bring thickness and width closer"
            )

    @property
    def half_angle(self) -> float:
        """Half the angle that each arc turns, φ, in radians."""
        return float(self.roundness * np.pi / 4.0)

    @property
    def corner(self) -> tuple[float, float]:
        """The corner (c_a, c_b), both positive."""
        tau = np.tan(self.half_angle / 2.0)
        r_a, r_b = self.thickness / 2.0, self.width / 2.0
        return float((r_a - tau * r_b) / (1.0 - tau**2)), float((r_b - tau * r_a) / (1.0 - tau**2))

    @property
    def crown_radius(self) -> float:
        """Radius of the arcs that cross the section on its inner and outer side."""
        return float(self.corner[1] / np.sin(self.half_angle))

    @property
    def flank_radius(self) -> float:
        """Radius of the arcs on the two flanks."""
        return float(self.corner[0] / np.sin(self.half_angle))

    @property
    def area(self) -> float:
        """Area: the rectangle between the corners and four circular segments."""
        c_a, c_b = self.corner
        segment = self.half_angle - np.sin(2.0 * self.half_angle) / 2.0
        return float(4.0 * c_a * c_b + 2.0 * segment * (self.crown_radius**2 + self.flank_radius**2))

    def inner_arc(self, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return points (a, b) of the arc on the ring's inside, and unit normals out of the section.

        `along`: places from −1 at negative b to 1.
        """
        angle = self.half_angle * along
        normals = np.column_stack([-np.cos(angle), np.sin(angle)])
        centre = np.array([self.crown_radius - self.thickness / 2.0, 0.0])
        return centre + self.crown_radius * normals, normals

    def flank_arc(self, along: np.ndarray) -> np.ndarray:
        """Return points of the arc at positive b; `along`: from −1 on the inner side to 1, as `inner_arc`."""
        angle = self.half_angle * along
        outward = np.column_stack([np.sin(angle), np.cos(angle)])
        return np.array([0.0, self.width / 2.0 - self.flank_radius]) + self.flank_radius * outward

    def points(self, through: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Return points (a, b) of the section by transfinite interpolation between its four arcs, (n, 2).

        References:
            Gordon and Hall, Construction of curvilinear co-ordinate systems and applications to mesh
            generation, Int. J. Numer. Meth. Engng 7 (1973), 461-477.
        """
        (inner, _), right = self.inner_arc(across), self.flank_arc(through)
        u, v = 0.5 + 0.5 * through[:, None], 0.5 + 0.5 * across[:, None]
        linear = np.column_stack([through, across]) * self.corner
        sides = (1 - u) * inner + u * inner * [-1.0, 1.0] + (1 - v) * right * [1.0, -1.0] + v * right
        return np.asarray(sides - linear)


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
        sizes = ("inner_radius", "straight", "thickness", "width")
        check_numbers(**{name: getattr(self, name) for name in sizes})
        for name in ("inner_radius", "straight"):
            if getattr(self, name) <= 0.0:
                raise InvalidInputError(f"{name} must be positive, got {getattr(self, name)}: enlarge it")
        check_count(self.n_around, "n_around", 12)
        if self.n_around % 6:
            raise InvalidInputError(
                f"n_around must be a multiple of 6, got {self.n_around}: take {6 * round(self.n_around / 6)}"
            )
        check_count(self.n_a, "n_a")
        check_count(self.n_b, "n_b", 2)
        check_cell_type(self.cell)
        check_grading(self.grading)
        _ = self.section

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
    """Choose the spacing for a link's `grading`; without it a sixth of the ring for every part.

    Cells are moved from the legs to graded crowns such that the cells on both sides of their border are most
    similar along the centre line.
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


def stations(shape: LinkShape, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points of the wire's centre line and the direction a of the section, around the ring.

    `around`: places, in numbers of cells from node 0.
    """
    spacing, half = shape.spacing, shape.n_around // 2
    turning, n_leg = 2 * spacing.quarter, spacing.leg
    # Crown, leg, far crown, leg: direction a rotates in the crowns only, the centre moves along the legs
    # only.
    back, place = np.divmod(np.mod(around - crown_start(shape), shape.n_around), half)
    turn = drawn_together(np.minimum(place, turning) / spacing.quarter - 1.0, spacing.along)
    turn = np.pi / 2.0 * turn + np.pi * back
    moved = shape.straight * np.abs(back - np.maximum(place - turning, 0.0) / n_leg)
    outward = np.column_stack([np.cos(turn), np.zeros(len(around)), np.sin(turn)])
    line = shape.centre_radius * outward
    line[:, 0] -= shape.inner_radius + moved
    return line, outward


@dataclass(frozen=True)
class SweptSection:
    """The map of lattice coordinates of a link, counted in cells, to the section swept around the ring."""

    shape: LinkShape

    def __call__(self, lattice: np.ndarray) -> np.ndarray:
        """Return points of the link, (around, a, b) in rows -> (x, y, z)."""
        shape, spacing = self.shape, self.shape.spacing
        line, outward = stations(shape, lattice[:, 0])
        across = drawn_together(2.0 * lattice[:, 2] / shape.n_b - 1.0, spacing.across)
        through = 2.0 * drawn_together(lattice[:, 1] / shape.n_a, spacing.through) - 1.0
        a, b = shape.section.points(through, across).T
        points = line + a[:, None] * outward
        points[:, 1] += b
        return points


def crown_indices(shape: LinkShape, far: bool = False) -> np.ndarray:
    """Indices around the ring of a crown's nodes, of the contact crown from -z to +z; (n_crown + 1,)."""
    start = crown_start(shape) + far * (shape.n_around // 2)
    return (start + np.arange(2 * shape.spacing.quarter + 1)) % shape.n_around


def crown_facets(shape: LinkShape, far: bool) -> np.ndarray:
    """Return the inner side of a crown, of one quarter turn after the other, (n_facets, 4)."""
    first = crown_indices(shape, far) * (shape.n_a + 1) * (shape.n_b + 1)
    nodes = first[:, None] + np.arange(shape.n_b + 1)
    corners = nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, 1:], nodes[1:, :-1]
    facets = np.stack(corners, axis=-1).reshape(2, -1, shape.n_b, 4)
    return facets.swapaxes(1, 2).reshape(-1, 4)


def crown_shapes(shape: LinkShape) -> dict[str, Torus]:
    """Return the tori of the inner sides of the crowns, by the names of the surfaces."""
    tube = shape.section.crown_radius
    middles = {"contact": -shape.inner_radius, "grip": -shape.inner_radius - shape.straight}
    return {
        name: Torus((middle, 0.0, 0.0), (0.0, 1.0, 0.0), shape.inner_radius + tube, tube)
        for name, middle in middles.items()
    }
