"""Bolt preload: sections through bodies that are drawn together by a force, or by a length."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from fenics_contact._base.checks import GivenVector, checked, unit_vector
from fenics_contact._kinematics.measure import PLAIN, Measure
from fenics_contact._scene.checks import check_entries, check_known, check_positive, checked_point
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.part import Around, Part, body_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh, Cut
from fenics_contact.mesh.faces import vector_areas


@dataclass(frozen=True)
@checked()
class Section:
    """The section of a body by a plane.

    The body is cut along the faces of cells nearest to the plane: between cells whose centres lie on
    different sides of it. Cells stay as they are.

    Attributes:
        point: A point of the plane, three coordinates (two for a plane body), [length].
        normal: Its normal, of any length: the axis of the bolt.
        region: Region of the body's mesh to which the section is limited; by default none.
        radius: Distance from the point to which the section is limited, [length]: one of several bolts that
            are meshed as one body. By default the whole plane cuts.

    Raises:
        InvalidInputError: If there are not as many finite numbers, the normal is zero or the radius is not
            positive.

    Example:
        >>> across_the_shank = Section((0, 0, 5), (0, 0, 1))  # mm
        >>> one_of_four = Section((40, 0, 5), (0, 0, 1), radius=8.0)
    """

    point: GivenVector
    normal: GivenVector
    region: str | None = None
    radius: float | None = None

    def __post_init__(self) -> None:
        """Reject a plane that is not determined, and keep its unit normal."""
        point = checked_point("Section.point", self.point, "give a point inside the bolt's shank")
        object.__setattr__(self, "point", point)
        object.__setattr__(self, "normal", unit_vector("Section.normal", self.normal, len(point)))
        if self.radius is not None:
            check_positive("Section.radius", self.radius, "give a little more than that of the bolt")

    def sides(self, mesh: BodyMesh, body: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the cells before and behind the plane that the section may separate."""
        check_entries(f"Section.point of body {body!r}", self.point, mesh.dim, "give as many coordinates")
        cells = np.arange(mesh.n_cells)
        if self.region is not None:
            cells = cells_of_region(mesh, body, self.region)
        arms = mesh.points[mesh.cells[cells]].mean(axis=1) - np.array(self.point)
        near = np.linalg.norm(arms, axis=1) <= self.extent
        cells, arms = cells[near], arms[near]
        behind = arms @ np.array(self.normal) > 0.0
        return cells[~behind], cells[behind]

    @property
    def extent(self) -> float:
        """Distance from the point to which it is limited, infinite if it is not, [length]."""
        return np.inf if self.radius is None else self.radius

    def reach(self, mesh: BodyMesh) -> str:
        """Return in words where the body lies along the normal."""
        along = (mesh.points - np.array(self.point)) @ np.array(self.normal)
        return f"the body reaches from {along.min():.4g} to {along.max():.4g} along the normal from the point"


#: A plane, or the names of two regions of a mesh, as gmsh and CAD make them by partition: the section is
#: their common face, its normal points from the first to the second.
AnySection: TypeAlias = Section | tuple[str, str]


@dataclass(frozen=True)
@checked()
class Preload(Part):
    """A bolt drawn together at a section through its body, by a force or a length, or held at its length.

    The sides of the section move alike, but that one approaches the other along the normal n by the
    shortening q, u₊ − u₋ = −q n: both parts overlap by q, and together are that much longer. With a force F,
    q is unknown and the section transmits F; with a shortening it is given, and the force follows. Without
    either, the bolt is held at the length that it had at the end of the load step before, in the first step
    as it was made. n stays as it is, also where bodies deform much. F and q are read from `State.preloads`.

    Attributes:
        body: Name of the body.
        section: Where it is cut: a plane, or two regions of its mesh by name, at their common face.
        force: Force F that the section transmits, positive in tension, [force] (in the plane: per unit of
            thickness).
        shortening: q, positive where the bolt gets shorter, [length]. Not together with a force.
        name: Name in results; by default that of the body.

    Raises:
        InvalidInputError: If both are given, or numbers are not finite.

    Example:
        >>> tightened = Preload("bolt", Section((0, 0, 5), (0, 0, 1)), force=40e3)  # N
        >>> held = Preload("bolt", Section((0, 0, 5), (0, 0, 1)))
        >>> at_a_partition_face = Preload("bolt", ("shank", "head"), shortening=0.05)  # mm
    """

    effect = EffectName.PRELOAD
    body: str
    section: AnySection
    force: float | None = None
    shortening: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        """Reject two aims at once, numbers that are not finite and regions that do not form a pair."""
        given = self.aims
        if len(given) > 1 or not np.isfinite([*given.values()]).all():
            raise InvalidInputError(
                f"a Preload must have a finite force or a finite shortening, got force={self.force!r} and "
                f"shortening={self.shortening!r}: give one of them, or none to hold the bolt at its length"
            )
        if isinstance(self.section, tuple) and (len(self.section) != 2 or len(set(self.section)) < 2):
            raise InvalidInputError(
                f"Preload.section must be a Section or the names of two regions, got {self.section!r}: give "
                "the regions on both sides of the face"
            )

    def check(self, scene: Around) -> None:
        """Reject a body that is not there."""
        body_of(scene, self.body, "Preload")

    @property
    def place(self) -> str:
        """The body and what it does, in words."""
        words = {"force": "drawn by {:g} [force]", "shortening": "shortened by {:g} [length]"}
        aims = [words[name].format(value) for name, value in self.aims.items()]
        return f"{self.label} {aims[0] if aims else 'held at its length'}"

    @property
    def aims(self) -> dict[str, float]:
        """The force or the shortening by name, nothing if the bolt is held at its length."""
        given = {"force": self.force, "shortening": self.shortening}
        return {name: value for name, value in given.items() if value is not None}

    @property
    def label(self) -> str:
        """Its name, by default that of the body."""
        return self.name or self.body

    @property
    def key(self) -> tuple[str, AnySection]:
        """Body and section, by which load steps find it."""
        return self.body, self.section

    @property
    def is_free(self) -> bool:
        """Whether the shortening is unknown."""
        return "force" in self.aims

    def with_aims(self, aims: Mapping[str, float]) -> Preload:
        """Return it with another force or shortening, held if there is none."""
        return replace(self, force=aims.get("force"), shortening=aims.get("shortening"))

    def cut(self, mesh: BodyMesh) -> Cut:
        """Return the cut that the scene has made into the mesh of its body."""
        return mesh.cuts[self.section]

    def held_pairs(self, mesh: BodyMesh) -> np.ndarray:
        """Return the nodes behind and before the section that are unknowns, shape (n, 2)."""
        pairs = self.cut(mesh).pairs
        return pairs[~np.isin(pairs, mesh.centres.nodes).any(axis=1)]

    def normal(self, mesh: BodyMesh) -> np.ndarray:
        """Return the unit normal n, shape (dim,): that of the plane, or the mean one of the common face."""
        if isinstance(self.section, Section):
            return np.array(self.section.normal)
        areas = vector_areas(mesh.points, self.cut(mesh).facets).sum(axis=0)
        return np.asarray(areas / np.linalg.norm(areas))

    def count(self, mesh: BodyMesh) -> int:
        """Return the number of nodes on either side of the section, without centres that follow others."""
        return len(self.held_pairs(mesh))

    def area(self, mesh: BodyMesh, measure: Measure = PLAIN) -> float:
        """Return the area of the section across its normal, [length^(dim - 1)]."""
        facets = self.cut(mesh).facets
        areas = vector_areas(mesh.points, facets) @ self.normal(mesh)
        radius = mesh.points[facets[:, :2], 0].mean(axis=1)
        return float((measure.around(radius) * areas).sum())


def cells_of_region(mesh: BodyMesh, body: str, name: str) -> np.ndarray:
    words = f"the section of body {body!r} names region {name!r}, its mesh has"
    check_known(name, mesh.regions, words, "use one of them, or a plane")
    return mesh.regions[name]
