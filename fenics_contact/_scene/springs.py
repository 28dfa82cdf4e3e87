"""Springs between the mean displacements of two surfaces, or of a surface and the ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from fenics_contact._base.checks import GivenVector, checked, floats
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._scene.checks import checked_stiffness
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.part import Around, Part, centroid, require_nodes
from fenics_contact._surfaces.facets import nodal_areas
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.faces import of_one_shape


@dataclass(frozen=True)
@checked()
class Spring(Part):
    """A spring between two surfaces, or between a surface and a fixed point.

    It acts on the mean displacements ū = ∫ u dA / ∫ dA of its ends, with forces spread over them as an even
    traction, and resists no rotation of an end about its centroid. An end may be a node set of a mesh: of n
    nodes ū = Σ u / n, and each gets an n-th of the force. A number k acts along the unit vector n
    from the centroid of the first end to that of the second one, with the tension N = N₀ + k n·(ū₂ − ū₁). A
    vector acts along each axis, with the forces k_d (ū₂ − ū₁)_d on the first end. Both count displacements
    from the undeformed bodies, and axes and n stay as they are. Surfaces may belong to one body, and one may
    be that of a `RigidTool`, whose name for it is "tool". Bodies may be held by springs alone.

    Attributes:
        first: A named surface, or a node set.
        second: Another one, or the coordinates of a fixed point.
        stiffness: k > 0, [force / length] (in the plane: per unit of thickness; on bodies of revolution: per
            revolution): a number along the line between the ends, or one of at least zero along each axis.
            With a plane of symmetry through the spring that of the part which is modelled. Infinity ties the
            means in a direction: of two nodes it is the equation u_d = w_d.
        tension: N₀ of a spring along its line, before anything moves, negative in compression, [force].
        name: Name in results; by default both ends.

    Raises:
        InvalidInputError: If a stiffness is negative or not a number, all are zero, other numbers are not
            finite, both ends are the same, or there is a tension without a line, or of a rigid one. When
            the scene is made: if the ends of a spring along its line have the same centroid, or bodies
            deform much, in which the line would turn; if numbers do not suit the space of the bodies, or
            bodies of revolution, which have springs along their axis alone.

    Example:
        >>> rod = Spring(Surface("lid", "rim"), Surface("pot", "rim"), 2e4, tension=500.0)  # N/mm, N
        >>> bushing = Spring(Surface("arm", "eye"), Surface("frame", "pin"), (900.0, 900.0, 150.0))
        >>> mount = Spring(Surface("engine", "foot"), (0, 0, -80), 400.0)
        >>> alike = Spring(Surface("beam", "n5"), Surface("beam", "n28"), (0, 0, float("inf")))  # u_z = w_z
    """

    effect = EffectName.SPRING
    first: Surface
    second: Surface | GivenVector
    stiffness: float | GivenVector
    tension: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        """Reject what holds nothing, or pushes away."""
        name, remedy = (
            f"Spring.stiffness of {self.label!r}",
            "give the force that a unit of displacement causes",
        )
        object.__setattr__(self, "stiffness", checked_stiffness(name, self.stiffness, remedy, largest=np.inf))
        if not np.isfinite(self.tension) or (self.tension and (self.along_axes or self.stiffness == np.inf)):
            raise InvalidInputError(
                f"Spring.tension of {self.label!r} must be finite, zero with stiffness along axes or an "
                f"infinite one, got {self.tension!r}: give a finite stiffness along its line"
            )
        if self.first == self.second:
            raise InvalidInputError(
                f"a Spring must have two different ends, got {self.first.in_words!r} twice: give another "
                "surface, or the coordinates of a fixed point"
            )
        if "second" not in self.surfaces:
            object.__setattr__(self, "second", floats(np.asarray(self.second, dtype=np.float64)))

    @property
    def label(self) -> str:
        """Its name, by default both ends."""
        if self.name:
            return self.name
        others = [surface.in_words for surface in self.surfaces.values()][1:]
        return " to ".join([self.first.in_words, *(others or ["ground"])])

    @property
    def along_axes(self) -> tuple[float, ...]:
        """Its stiffness along each axis, empty if it acts along its line."""
        return self.stiffness if isinstance(self.stiffness, tuple) else ()

    @property
    def place(self) -> str:
        """Where it is and how stiff, in words."""
        along = "along each axis" if self.along_axes else "along its line"
        drawn = f", tension {self.tension:g}" if self.tension else ""
        return f"{self.label}, {self.stiffness} {along}{drawn}"

    @property
    def surfaces(self) -> dict[str, Surface]:
        """Its surfaces by the names of the fields."""
        ends = {"first": self.first, "second": self.second}
        return {name: end for name, end in ends.items() if isinstance(end, Surface)}

    def centres(self, scene: Around) -> np.ndarray:
        """Return the centroids of both ends, shape (2, dim), [length]."""
        found = [centroid(scene, end.body, end.name) for end in self.surfaces.values()]
        return np.array(found if len(found) == 2 else [*found, np.asarray(self.second, dtype=np.float64)])

    def rows(self, scene: Around) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions in which it acts, unit vectors, (n, dim), and its stiffness in each, (n,)."""
        if self.along_axes:
            numbers = np.array(self.along_axes)
            return np.eye(scene.kinematics.dim)[numbers > 0.0], numbers[numbers > 0.0]
        line = np.diff(self.centres(scene), axis=0)
        line /= np.linalg.norm(line)
        line[np.abs(line) <= ROUNDING] = 0.0
        return line, np.array([self.stiffness])

    def check(self, scene: Around) -> None:
        """Reject numbers of another space, springs without a line, and motions that bodies do not have."""
        for name, end in self.surfaces.items():
            require_nodes(scene, end.body, end.name, f"Spring.{name}")
        dim, revolved = scene.kinematics.dim, not scene.kinematics.can_rotate
        numbers = {"stiffness": self.along_axes} if self.along_axes else {}
        if "second" not in self.surfaces:
            numbers["second"] = cast("GivenVector", self.second)
        for name, given in numbers.items():
            if len(given) != dim or not (name == "stiffness" or np.isfinite(given).all()):
                raise InvalidInputError(
                    f"Spring.{name} of {self.label!r} must have {dim} finite numbers, got {given!r}: give "
                    "one for each axis"
                )
        if self.along_axes:
            across = revolved and self.along_axes[0] > 0.0
        else:
            line = np.diff(self.centres(scene), axis=0)[0]
            size = max(float(np.abs(body.mesh.points).max()) for body in scene.bodies.values())
            if np.linalg.norm(line) <= ROUNDING * size:
                raise InvalidInputError(
                    f"a Spring along its line needs ends with different centroids, but both of "
                    f"{self.label!r} are in the same place: give a stiffness for each axis"
                )
            across = revolved and abs(line[0]) > ROUNDING * size
            if scene.deforms_much:
                raise InvalidInputError(
                    f"the Spring {self.label!r} along its line needs small displacements, but some body "
                    "deforms much and would turn the line: give a stiffness for each axis"
                )
        if across:
            raise InvalidInputError(
                f"a Spring on bodies of revolution must act along the axis, got {self.place}: give "
                "stiffness=(0, k), and fixed points on the axis, r = 0"
            )


def mean_weights(scene: Around, surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of a surface in its body, shape (n,), and their weights in its mean, (n,), sum one."""
    mesh = scene.bodies[surface.body].mesh
    if surface.name in mesh.node_sets:
        nodes = mesh.node_sets[surface.name]
        return nodes, np.full(len(nodes), 1.0 / len(nodes))
    facets = mesh.surfaces[surface.name]
    sums = np.zeros(mesh.n_nodes)
    for _, some in of_one_shape(facets):
        np.add.at(sums, some, nodal_areas(mesh.points, some, scene.bodies[surface.body].kinematics.measure))
    nodes = np.unique(facets)
    return nodes, sums[nodes] / sums.sum()
