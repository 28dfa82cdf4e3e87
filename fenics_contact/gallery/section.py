"""The cross-section of a link's wire: a rounded square bounded by four circular arcs.

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

from fenics_contact.checks import check_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.ring_spacing import drawn_together


@dataclass(frozen=True)
class WireSection:
    """A rounded square.

    Attributes:
        thickness: Size along a (radially in the ring).
        width: Size along b (across the ring).
        roundness: Turning angle of every arc over 90 degrees, above 0 and below 1.
    """

    thickness: float
    width: float
    roundness: float

    def __post_init__(self) -> None:
        """Reject sizes that have no such shape."""
        check_numbers(thickness=self.thickness, width=self.width, roundness=self.roundness)
        if not (0.0 < self.thickness and 0.0 < self.width):
            raise InvalidInputError(
                f"thickness and width must be positive, got {self.thickness} and {self.width}: give the size "
                "of the wire in both directions"
            )
        if not 0.0 < self.roundness < 1.0:
            raise InvalidInputError(
                "roundness must lie between 0 (square) and 1 (disc, whose corner cells are flat), got "
                f"{self.roundness}: take for example 0.9"
            )
        if min(self.corner) <= 0.0:
            raise InvalidInputError(
                f"a section {self.thickness} thick and {self.width} wide is too slender for roundness "
                f"{self.roundness}: lower the roundness or bring thickness and width closer together"
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

    def inner_arc(self, n: int, strength: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Divide the arc on the ring's inside.

        Args:
            n: Number of pieces.
            strength: Concentration towards the middle, see `drawn_together`; 0 for equal pieces.

        Returns:
            Points (a, b), from negative to positive b, and unit normals out of the section, both (n + 1, 2).
        """
        angle = drawn_together(np.linspace(-self.half_angle, self.half_angle, n + 1), 0.0, strength)
        normals = np.column_stack([-np.cos(angle), np.sin(angle)])
        centre = np.array([self.crown_radius - self.thickness / 2.0, 0.0])
        return centre + self.crown_radius * normals, normals

    def flank_arc(self, n: int, strength: float = 0.0) -> np.ndarray:
        """Divide the arc at positive b, from the inner to the outer side; (n + 1, 2).

        Args:
            n: Number of pieces.
            strength: Concentration towards the inner side; 0 for equal pieces.
        """
        start = -self.half_angle
        angle = drawn_together(np.linspace(start, self.half_angle, n + 1), start, strength)
        outward = np.column_stack([np.sin(angle), np.cos(angle)])
        return np.array([0.0, self.width / 2.0 - self.flank_radius]) + self.flank_radius * outward

    def lattice(self, n_a: int, n_b: int, through: float = 0.0, across: float = 0.0) -> np.ndarray:
        """Fill the section by transfinite interpolation between its four arcs.

        Args:
            n_a: Number of cells along a.
            n_b: Number of cells along b.
            through: Concentration of cells towards the inner side, see `drawn_together`.
            across: Concentration of cells towards b = 0.

        Returns:
            Points (a, b), (n_a + 1, n_b + 1, 2).

        References:
            Gordon and Hall, Construction of curvilinear co-ordinate systems and applications to mesh
            generation, Int. J. Numer. Meth. Engng 7 (1973), 461-477.
        """
        inner, _ = self.inner_arc(n_b, across)
        right = self.flank_arc(n_a, through)
        outer, left = inner * [-1.0, 1.0], right * [1.0, -1.0]
        u = drawn_together(np.linspace(0.0, 1.0, n_a + 1), 0.0, through)[:, None, None]
        v = drawn_together(np.linspace(0.0, 1.0, n_b + 1), 0.5, across)[None, :, None]
        corners = (1 - u) * ((1 - v) * inner[0] + v * inner[-1]) + u * ((1 - v) * outer[0] + v * outer[-1])
        return (1 - u) * inner + u * outer + (1 - v) * left[:, None] + v * right[:, None] - corners
