"""Sectors of bodies that repeat around an axis: both sides move alike, turned by the angle of the sector."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias, cast

import numpy as np
from scipy.spatial.transform import Rotation

from fenics_contact._base.checks import GivenVector, checked, unit_vector
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._scene.checks import check_entries, checked_point
from fenics_contact._scene.choice import NO_CHOICE, Choice
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.local_axes import HeldDirections
from fenics_contact._scene.pairs import AnyDiscretisation, PairPart, Surface, Tie
from fenics_contact._scene.part import Around, require_surface
from fenics_contact._surfaces.facets import surface_moments
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.shapes.simple import tangent_bases


@dataclass(frozen=True)
@checked()
class CyclicSymmetry(PairPart):
    """Both sides of a sector that repeats around an axis: u_slave = R u_master, R turns master onto slave.

    One of the `Scene.ties`. The sector is 360°/N of a whole whose loads and supports repeat, too; all its
    quantities are those of the sector. Meshes of both sides need not match. The whole may turn about the axis
    and move along it, and nothing else, unless supports or contact hold it.

    Attributes:
        slave: One side of the sector, whose nodes carry the forces; the finer mesh is the better slave.
        master: The other side, of the same body, or of another one of the sector.
        at: A point on the axis, [length].
        axis: Direction of the axis, of any length; None in the plane.
        angle: Angle by which R turns about the axis, in radians, positive by the right-hand rule, in the
            plane from x to y. By default it is measured between the sides.
        discretisation: As in `Tie`.
        choice: As in `ContactPair`.

    Raises:
        InvalidInputError: If the point or the axis is not finite, or the angle is not 360°/N.

    Example:
        >>> sides = Surface("rotor", "end"), Surface("rotor", "start")
        >>> sector = CyclicSymmetry(*sides, at=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    """

    effect = EffectName.CYCLIC_SYMMETRY
    slave: Surface
    master: Surface
    at: GivenVector
    axis: GivenVector | None = None
    angle: float | None = None
    discretisation: AnyDiscretisation = "best"
    choice: Choice = field(default=NO_CHOICE, repr=False)

    def __post_init__(self) -> None:
        """Reject points and axes that are not finite, and an angle that does not divide a turn."""
        at = checked_point("CyclicSymmetry.at", self.at, "give a point on the axis")
        object.__setattr__(self, "at", at)
        if (self.axis is None) != self.is_plane:
            raise InvalidInputError(
                f"CyclicSymmetry needs an axis in space and none in the plane, got at={self.at!r} and axis="
                f"{self.axis!r}: give its direction with three coordinates, or leave it out"
            )
        if not self.is_plane:
            object.__setattr__(
                self, "axis", unit_vector("CyclicSymmetry.axis", cast("GivenVector", self.axis), 3)
            )
        if self.angle is not None:
            whole_sectors(self.place, self.angle)
        if self.slave == self.master:
            raise InvalidInputError(
                f"CyclicSymmetry needs both sides of a sector, got {self.place}: name the other as master"
            )

    def check(self, scene: Around) -> None:
        """Reject an axis in another space, and sides that are no part of a turn apart."""
        require_surface(scene, self.slave.body, self.slave.name, "CyclicSymmetry.slave")
        require_surface(scene, self.master.body, self.master.name, "CyclicSymmetry.master")
        of = scene.kinematics
        check_entries(
            f"CyclicSymmetry.at of {self.place}", self.at, of.dim, "give a point of the bodies' space"
        )
        if not of.can_rotate:
            raise InvalidInputError(f"bodies of revolution have no sectors: leave out that of {self.place}")
        self.angle_in(scene)

    def angle_in(self, scene: Around) -> float:
        """Return the angle that turns the master onto the slave, in radians."""
        slave, master = (scene.bodies[side.body].mesh.origin for side in (self.slave, self.master))
        return self.measured_angle(slave, master)

    @property
    def sectors(self) -> tuple[CyclicSymmetry, ...]:
        """Itself."""
        return (self,)

    @property
    def is_plane(self) -> bool:
        """Whether it lies in the plane, with an axis across."""
        return len(self.at) == 2

    @property
    def _axis(self) -> GivenVector:
        """Its axis, in the plane that across."""
        return self.axis or (0.0, 0.0, 1.0)

    def matrix(self, angle: float) -> np.ndarray:
        """Return the rotation about the axis by an angle, shape (dim, dim)."""
        turn = Rotation.from_rotvec(angle * np.array(self._axis)).as_matrix()
        return np.asarray(turn[: len(self.at), : len(self.at)])

    @property
    def across(self) -> np.ndarray:
        """Orthonormal directions across the axis, shape (2, dim)."""
        return np.eye(2) if self.is_plane else np.asarray(tangent_bases(np.array([self._axis]))[0])

    def measured_angle(self, slave: BodyMesh, master: BodyMesh) -> float:
        """Return the angle that turns the master onto the slave, in radians, a whole part of a turn.

        Raises:
            InvalidInputError: If it cannot be measured, or is not 360°/N.
        """
        if self.angle is not None:
            return whole_sectors(self.place, self.angle)
        sides = ((slave, self.slave.name), (master, self.master.name))
        first = self.across
        second = first[1] if self.is_plane else np.cross(self._axis, first[0])
        middles = [surface_moments(mesh.points, mesh.surfaces[name]).centroid for mesh, name in sides]
        arms = np.array([middle - np.array(self.at) for middle in middles]) @ np.array([first[0], second]).T
        near = [1e-6 * np.ptp(mesh.points[mesh.surfaces[name]], axis=(0, 1)).max() for mesh, name in sides]
        if np.any(np.linalg.norm(arms, axis=1) <= np.array(near)):
            raise InvalidInputError(
                f"the angle between the sides {self.place} is unknown, as the middle of one is on the axis: "
                "give CyclicSymmetry its angle, or sides that end at the axis"
            )
        turned = np.arctan2(arms[0, 1], arms[0, 0]) - np.arctan2(arms[1, 1], arms[1, 0])
        return whole_sectors(self.place, float((turned + np.pi) % (2.0 * np.pi) - np.pi))

    def turned(self, points: np.ndarray, angle: float) -> np.ndarray:
        """Return points, shape (n, dim), turned about the axis."""
        at = np.array(self.at)
        return np.asarray((points - at) @ self.matrix(angle).T + at)

    def axial_nodes(self, mesh: BodyMesh, surface: str, near: float = 1e-6) -> np.ndarray:
        """Return the nodes of a side that lie on the axis, ascending.

        `near`: distance from the axis, relative to the size of the side, below which they do.
        """
        nodes = np.unique(mesh.surfaces[surface])
        points = mesh.points[nodes]
        away = np.linalg.norm((points - np.array(self.at)) @ self.across.T, axis=1)
        return np.asarray(nodes[away <= near * np.linalg.norm(np.ptp(points, axis=0))])

    def held_on_axis(self, mesh: BodyMesh, surface: str) -> HeldDirections:
        """Return what holds the nodes of a side on the axis, which move along it alone."""
        nodes = self.axial_nodes(mesh, surface)
        directions = np.tile(self.across, (len(nodes), 1))
        return HeldDirections(surface, np.repeat(nodes, 2), directions, np.zeros(2 * len(nodes)))


#: What ties surfaces of bodies.
AnyTie: TypeAlias = Tie | CyclicSymmetry


def whole_sectors(place: str, angle: float, off: float = 1e-2) -> float:
    """Return an angle as an exact part of a turn, of the same sign.

    `off`: by how much the number of sectors may differ from a whole one: nodes of sides that are curved and
    meshes that do not match have other middles.

    Raises:
        InvalidInputError: If it is not 360°/N.
    """
    count = 2.0 * np.pi / abs(angle) if np.isfinite(angle) and abs(angle) > ROUNDING else np.inf
    whole = float(np.round(count)) if np.isfinite(count) else 0.0
    if whole < 2 or abs(count - whole) > off:
        nearest = f", the nearest is {360.0 / max(whole, 2.0):.6g}°" if np.isfinite(count) else ""
        raise InvalidInputError(
            f"sides of a sector must be 360°/N apart, those of {place} are {np.degrees(angle):.6g}° apart, "
            f"1/{count:.6g} of a turn{nearest}: check surfaces, at and axis of CyclicSymmetry, or give angle"
        )
    return float(np.copysign(2.0 * np.pi / whole, angle))
