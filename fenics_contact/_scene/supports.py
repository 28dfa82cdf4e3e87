"""Supports: displacements prescribed on surfaces, rollers, and surfaces that move as one rigid piece."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TypeAlias, cast

import numpy as np
from scipy.spatial.transform import Rotation

from fenics_contact._base.checks import LARGEST, GivenVector, checked, floats, unit_vector
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._scene.checks import check_entries, checked_point
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.fields import NodeValues, OfPosition, evaluate
from fenics_contact._scene.local_axes import TILT, flat_normals, widest_angle
from fenics_contact._scene.part import Around, require_nodes, require_vector
from fenics_contact._scene.support_part import SupportPart
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.kernels import motions_about
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas

#: What a support does with one component: leave it free (None), or prescribe a number or a function of the
#: points.
Component = float | OfPosition | None


@dataclass(frozen=True)
class HoldCurrent:
    """What a support of a load step holds where it is when the step begins.

    Give it as a component of `Support.value`, or as `Roller.displacement`: each node keeps the displacement
    that it has. In a scene without a load step before it is zero.

    Example:
        >>> frozen = Support("bar", "x1", (HoldCurrent(), None, None))
    """

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the displacements of undeformed bodies: zeros, shape (n,)."""
        return np.zeros(len(points))


@dataclass(frozen=True)
@checked()
class Support(SupportPart):
    """Displacement prescribed on a surface, or at single nodes, component by component.

    Attributes:
        body: Name of the body.
        surface: Name of its surface, or of a node set of its mesh.
        value: Displacement [length] for x, y, z (for x, y on a plane body), by default zero in all directions
            of the body's space. Of bodies of revolution with torsion it is along the radius, the axis and the
            way around it. None leaves a component free; a function receives points, shape (n, dim), and
            returns the component there, shape (n,). `HoldCurrent` keeps what each node has at the
            start of a load step.

    Raises:
        InvalidInputError: If nothing is prescribed, or something other than a finite number or a function.

    Example:
        >>> clamped = Support("block", "x0")
        >>> roller = Support("block", "z0", (None, None, 0.0))
        >>> pushed = Support("block", "x1", (0.5, None, None))  # mm
    """

    effect = EffectName.PRESCRIBED_DISPLACEMENT
    body: str
    surface: str
    value: tuple[Component, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Reject a support that prescribes nothing or something other than a number."""
        given = [component for component in self.value if component is not None]
        numbers = [component for component in given if not callable(component)]
        if len(self.value) not in (2, 3) or not given or not np.all(np.abs(numbers) < LARGEST):
            raise InvalidInputError(
                "Support.value must hold three entries (two for a plane body), numbers, functions or None, "
                f"not all None, got {self.value!r}: (0.0, 0.0, 0.0) clamps, (None, None, 0.0) is a roller"
            )
        object.__setattr__(self, "value", tuple(self.value))

    def check(self, scene: Around) -> None:
        """Reject nodes that are not there, and another number of components."""
        require_nodes(scene, self.body, self.surface, "Support")
        of, value = scene.bodies[self.body].kinematics, self.in_scene(scene).value
        require_vector(value, of.components, of.vector_in_words, "Support", self.body)

    def in_scene(self, scene: Around) -> Support:
        """Return the support with as many components as bodies have: three zeros hold plane ones, too."""
        plane = scene.kinematics.components == 2 and self.value == (0.0, 0.0, 0.0)
        return replace(self, value=(0.0, 0.0)) if plane else self

    @property
    def in_words(self) -> str:
        """Where it is and what it prescribes."""
        given = ("free" if v is None else "function" if callable(v) else f"{v:g}" for v in self.value)
        return f"{self.body} {self.surface} ({', '.join(given)})"

    @property
    def keeps(self) -> bool:
        """Whether it holds something where it is when a load step begins."""
        return any(isinstance(each, HoldCurrent) for each in self.value)

    @property
    def varies(self) -> bool:
        """Whether it has components that are functions of position."""
        return any(callable(component) for component in self.value)

    def keeping(self, points: np.ndarray, moved: np.ndarray) -> Support:
        """Return it with displacements of its nodes, (n, components), where it keeps them."""
        pairs = zip(self.value, moved.T, strict=True)
        value = (NodeValues(points, own) if isinstance(each, HoldCurrent) else each for each, own in pairs)
        return replace(self, value=tuple(value))

    def holds(self, components: int) -> np.ndarray:
        """Return which components it holds, shape (components,)."""
        return np.array([component is not None for component in self.value])

    def motion_along(self, normal: np.ndarray, scene: Around) -> float:
        """Return the largest displacement along a direction that it prescribes by numbers, [length]."""
        numbers = [np.nan if callable(each) else each for each in self.value[: len(normal)]]
        return abs(float(np.nan_to_num(np.array(numbers, dtype=np.float64)) @ normal))

    def symmetry(self, scene: Around) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Return the axis of its only component, and the nodes of facets normal to it."""
        mesh, dim = scene.bodies[self.body].mesh, scene.kinematics.dim
        (axis, *others) = np.flatnonzero(self.holds(dim))
        if others or callable(self.value[axis]) or axis >= dim or self.surface in mesh.node_sets:
            return ()
        facets = mesh.surfaces[self.surface]
        areas = vector_areas(mesh.points, facets)
        across = np.abs(areas[:, axis]) >= (1.0 - TILT) * np.linalg.norm(areas, axis=1)
        return ((np.eye(dim)[axis], facets[across].ravel()),)

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the prescribed displacement, NaN where a component is free.

        Args:
            points: Coordinates of nodes on the surface, shape (n, dim), [length].

        Returns:
            Shape (n, components), [length].

        Raises:
            InvalidInputError: If a function does not return one finite number per point.
        """
        result = np.full((len(points), len(self.value)), np.nan)
        for component, given in enumerate(self.value):
            if callable(given):
                name = f"component {component} of the support of surface {self.surface!r}"
                result[:, component] = evaluate(name, given, points, ())
            elif given is not None:
                result[:, component] = given
        return result


@dataclass(frozen=True)
@checked()
class Roller(SupportPart):
    """A surface that slides: the displacement along its normal, or another direction, alone is prescribed.

    On a flat side it is a plane of symmetry, in whatever direction that lies: surfaces of contact that it
    cuts go on smoothly behind it. On a curved side each node is held along the normal there, that of the true
    surface where the mesh knows its shape; where the side has an edge, along the normals on both sides of it.

    Attributes:
        body: Name of the body.
        surface: Name of its surface; with a direction also of a node set of its mesh.
        displacement: Displacement along the direction, along the normal positive outwards, [length]: a
            number, zero by default, or a function that receives points, shape (n, dim), and returns it there,
            shape (n,); `HoldCurrent` as for `Support`.
        direction: The direction, of any length, or a function that receives points, shape (n, dim), and
            returns the directions there, shape (n, dim), as the radial one of a cylinder; the outward normal
            at every node by default.

    Raises:
        InvalidInputError: If a direction is zero, or the displacement is no finite number or function.

    Example:
        >>> tilted = Roller("sector", "cut")  # a plane of symmetry at any angle
        >>> guided = Roller("pin", "head", direction=(1.0, 1.0, 0.0))
        >>> round_the_hole = Roller("plate", "bore", displacement=0.02)  # mm, shrinks all around
    """

    effect = EffectName.ROLLER
    body: str
    surface: str
    displacement: float | OfPosition = 0.0
    direction: GivenVector | OfPosition | None = None

    def __post_init__(self) -> None:
        """Reject a direction without length and a displacement that is no number."""
        given = self.displacement
        if not (callable(given) or np.isfinite(given)):
            raise InvalidInputError(
                f"Roller.displacement of surface {self.surface!r} of body {self.body!r} must be a finite "
                f"number or a function of the points, got {given!r}: 0.0 holds the surface where it is"
            )
        for vector in self._vectors:
            name = f"Roller.direction of surface {self.surface!r} of body {self.body!r}"
            dim = 2 if len(vector) == 2 else 3
            object.__setattr__(self, "direction", unit_vector(name, vector, dim))

    def check(self, scene: Around) -> None:
        """Reject nodes that are not there, and a direction that they do not have."""
        require_nodes(scene, self.body, self.surface, "Roller")
        body = scene.bodies[self.body]
        mesh, where = body.mesh, f"{self.surface!r} of body {self.body!r}"
        if self.surface in mesh.node_sets and self.is_along_normal:
            raise InvalidInputError(
                f"a roller on nodes needs a direction, node set {where} has no normal: give one"
            )
        for vector in self._vectors:
            remedy = f"give {mesh.dim}, or none for the normal"
            check_entries(f"Roller.direction of surface {where}", vector, mesh.dim, remedy, "components")
        if body.deforms_much and not self.directions_on(mesh):
            found = "is a function"
            if self.is_along_normal:
                found = f"turns by up to {widest_angle(mesh, self.surface):.3g} degrees, as it is curved"
            raise InvalidInputError(
                f"a Roller on a body that deforms much needs one direction, that of {where} {found}: give a "
                "vector, or hold the surface by a RigidObstacle and contact"
            )

    @property
    def is_along_normal(self) -> bool:
        """Whether it holds its nodes along the normals of its surface."""
        return self.direction is None

    @property
    def _vectors(self) -> tuple[GivenVector, ...]:
        """Its direction, if that is a vector."""
        along = self.is_along_normal or callable(self.direction)
        return () if along else (cast("GivenVector", self.direction),)

    def directions_on(self, mesh: BodyMesh) -> tuple[np.ndarray, ...]:
        """Return the one direction along which it holds its nodes, (dim,); nothing where they differ."""
        if self.is_along_normal:
            return flat_normals(mesh, self.surface)
        return tuple(np.array(vector) for vector in self._vectors)

    @property
    def in_words(self) -> str:
        """Where it is and what it prescribes."""
        amount = "function" if callable(self.displacement) else f"{self.displacement:g}"
        along = "the normal" if self.is_along_normal else "a function"
        for vector in self._vectors:
            along = f"({', '.join(f'{part:.4g}' for part in vector)})"
        return f"{self.body} {self.surface} slides, {amount} along {along}"

    @property
    def rollers(self) -> tuple[Roller, ...]:
        """Itself."""
        return (self,)

    @property
    def keeps(self) -> bool:
        """Whether it holds its nodes where they are when a load step begins."""
        return isinstance(self.displacement, HoldCurrent)

    @property
    def varies(self) -> bool:
        """Whether its displacement is a function of position."""
        return callable(self.displacement)

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return what `amounts` returns."""
        return self.amounts(points)

    def holds(self, components: int) -> np.ndarray:
        """Return which components it holds along the axes: none, its directions are others."""
        return np.zeros(components, dtype=bool)

    def held(self, scene: Around) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Return nothing: it holds along directions of its own, see `SceneParts.directions_of`."""
        return ()

    def largest_motion(self, scene: Around) -> float:
        """Return the largest displacement that it prescribes, [length]."""
        mesh = scene.bodies[self.body].mesh
        return float(np.abs(self.amounts(mesh.points[self.nodes_in(mesh)])).max(initial=0.0))

    def motion_along(self, normal: np.ndarray, scene: Around) -> float:
        """Return the displacement along a direction that it prescribes by one number, [length]."""
        if callable(self.displacement):
            return 0.0
        along = self.directions_on(scene.bodies[self.body].mesh)
        return sum(abs(self.displacement * float(each @ normal)) for each in along)

    def symmetry(self, scene: Around) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Return the normal and the nodes of the flat side that it holds across, if it is one of symmetry."""
        mesh = scene.bodies[self.body].mesh
        if callable(self.displacement):
            return ()
        return tuple(
            (normal, mesh.surfaces[self.surface].ravel())
            for normal in flat_normals(mesh, self.surface)
            for along in self.directions_on(mesh)
            if abs(along @ normal) >= 1.0 - TILT and scene.kinematics.is_mirrored(normal, TILT)
        )

    def amounts(self, points: np.ndarray) -> np.ndarray:
        """Return the prescribed displacement at points, shape (n, dim), along the direction there, (n,).

        Raises:
            InvalidInputError: If a function does not return one finite number per point.
        """
        if callable(self.displacement):
            return evaluate(f"the roller on surface {self.surface!r}", self.displacement, points, ())
        return np.full(len(points), float(self.displacement))


#: Components of a motion: a number prescribes one, None leaves it free.
Motion: TypeAlias = tuple[float | None, ...]


@dataclass(frozen=True)
@checked()
class RigidSurface(SupportPart):
    """A surface that moves as one rigid piece: u = U + θ × (x − p), U and θ being the motion of a point p.

    Components of U and θ that are given are prescribed; the others follow from the equilibrium of the surface
    with a force and a moment at the point. Rotations are small, as all displacements, but on bodies of
    materials for large deformations: there the surface turns about the axis θ by the angle ‖θ‖, however
    large, u = U + (R(θ) − I)(x − p), along arcs on the way; the force acts where the point has moved, force
    and moment keep their directions in space. Other programs call it a remote displacement or a kinematic
    coupling; for a force that leaves the surface flexible see `TotalForce`.

    Attributes:
        body: Name of the body.
        surface: Name of its surface, or a node set.
        at: The point p, which need not belong to the body, [length].
        displacement: U, [length]: for each direction a number, or None where it is free; all free by default.
        rotation: θ about each axis, in the plane one number, positive from x to y, of bodies of revolution
            with torsion about their axis, in radians; a number prescribes a component, None leaves it free;
            all free by default.
        force: Force at the point along free directions, [force] (in the plane: per unit of thickness).
        moment: Moment about the point around free axes, in the plane one number, [force·length].

    Raises:
        InvalidInputError: If numbers are missing or not finite, or a load acts on a prescribed component.

    Example:
        >>> twisted = RigidSurface("shaft", "end", (0, 0, 50), (0, 0, None), (0, 0, 0.01))  # mm, rad
        >>> half_a_turn = RigidSurface("rubber", "top", (0, 0, 20), (0, 0, 0), (0, 0, np.pi))
        >>> loaded = RigidSurface("bracket", "plate", (40, 0, 10), force=(0, 0, -500))  # N
    """

    effect = EffectName.RIGID_SURFACE
    body: str
    surface: str
    at: GivenVector
    displacement: Motion | None = None
    rotation: Motion | float | None = None
    force: GivenVector | None = None
    moment: GivenVector | float | None = None

    def __post_init__(self) -> None:
        """Reject what has not as many finite numbers as the space of the point, and loads without effect."""
        remedy = "give the point whose motion is prescribed or loaded"
        object.__setattr__(self, "at", checked_point("RigidSurface.at", self.at, remedy))
        counts = {"displacement": self.dim, "rotation": self.turns, "force": self.dim, "moment": self.turns}
        for name, count in counts.items():
            object.__setattr__(self, name, self._checked(name, count))
        idle = (self.load != 0.0) & ~self.free
        if idle.any():
            raise InvalidInputError(
                f"a load on {self._whose} must act on free components, got force {self.force!r} and moment "
                f"{self.moment!r} {self._prescribes}: leave the component free (None), or the load away"
            )

    def effects(self, scene: Around) -> tuple[EffectName, ...]:
        """Return that of a rigid surface; a tool is one anyway."""
        return () if scene.bodies[self.body].is_rigid else (self.effect,)

    def check(self, scene: Around) -> None:
        """Reject nodes that are not there, and a point of another space."""
        require_nodes(scene, self.body, self.surface, "RigidSurface")
        dim, at = scene.bodies[self.body].mesh.dim, self.in_scene(scene).at
        check_entries(f"RigidSurface.at of {self._whose}", at, dim, "give as many, and as many displacements")

    def in_scene(self, scene: Around) -> RigidSurface:
        """Return the rigid surface with the motions that its body can have."""
        of = scene.kinematics
        return self if of.can_rotate else self.along_axis(of.components > of.dim)

    def along_axis(self, torsion: bool = False) -> RigidSurface:
        """Return the rigid surface of a body of revolution, which moves along the axis alone.

        With torsion it also turns about the axis: rotation and moment are those about it.
        """
        radial, along, *turned = self.motion
        if torsion and self.dim == 2 and not (radial or self.load[0]):
            given = {each.name: getattr(self, each.name) for each in fields(RigidSurface)}
            return TurningSurface(**{**given, "displacement": (0.0, along)})
        if torsion or self.dim != 2 or radial or any(turned) or self.load[0] or self.load[2]:
            ways = "and turn about it alone" if torsion else "alone"
            raise InvalidInputError(
                f"RigidSurface on {self._whose} of revolution can move along the axis {ways}, got force "
                f"{self.force!r}, moment {self.moment!r} {self._prescribes}: give (0.0, w) or force=(0.0, F)"
            )
        return replace(self, displacement=(0.0, along), rotation=0.0)

    def _checked(self, name: str, count: int) -> Motion | float | None:
        """Return an attribute as plain numbers; reject other than one finite number for each component."""
        given = getattr(self, name)
        if given is None:
            return None
        alone, may_be_free = np.ndim(given) == 0, name in ("displacement", "rotation")
        entries = (given,) if alone else tuple(given)
        known = [entry for entry in entries if entry is not None]
        fits = len(entries) == count and alone == (count == 1) and np.isfinite(known).all()
        if not fits or (len(known) < count and not may_be_free):
            needed = "one finite number" if count == 1 else f"{count} finite numbers"
            needed += ", or None for those that are free" if may_be_free and count > 1 else ""
            kind = "ToolMotion" if self.surface == TOOL else "RigidSurface"
            raise InvalidInputError(
                f"{kind}.{name} of {self._whose} must be {needed}, as its point {self.at!r} has {self.dim} "
                f"coordinates, got {given!r}: give them, or nothing"
            )
        numbers = tuple(None if entry is None else float(entry) for entry in entries)
        return numbers[0] if count == 1 else numbers

    @property
    def _whose(self) -> str:
        """The surface and its body, or the tool that it moves, in words."""
        tool = self.surface == TOOL
        return f"tool {self.body!r}" if tool else f"surface {self.surface!r} of body {self.body!r}"

    @property
    def _prescribes(self) -> str:
        """What it prescribes, in words of messages."""
        return f"with displacement {self.displacement!r} and rotation {self.rotation!r}"

    @property
    def dim(self) -> int:
        """Dimension of the space of the point, 2 or 3."""
        return len(self.at)

    @property
    def turns(self) -> int:
        """Number of components of a rotation, 1 or 3."""
        return 2 * self.dim - 3

    @property
    def motion(self) -> Motion:
        """Components of U, then of θ, None where free."""
        return (*self._components("displacement", self.dim), *self._components("rotation", self.turns))

    def _components(self, name: str, count: int) -> Motion:
        """Return the components of an attribute, None where it gives nothing."""
        given = getattr(self, name)
        if given is None:
            return (None,) * count
        return given if isinstance(given, tuple) else (given,)

    @property
    def free(self) -> np.ndarray:
        """Marks of the free components of U, then of θ, shape (3,) in the plane, (6,) in space."""
        return np.isnan(self._numbers)

    @property
    def _numbers(self) -> np.ndarray:
        """Components of U, then of θ, NaN where free, shape (3,) in the plane, (6,) in space."""
        return np.array(self.motion, dtype=np.float64)

    @property
    def load(self) -> np.ndarray:
        """Force and moment at the point, zero by default, shape (3,) in the plane, (6,) in space."""
        given = *self._components("force", self.dim), *self._components("moment", self.turns)
        return np.nan_to_num(np.array(given, dtype=np.float64))

    @property
    def in_words(self) -> str:
        """Where it is and what it prescribes."""
        given = ["free" if np.isnan(v) else f"{v:g}" for v in self._numbers]
        moved, turned = ", ".join(given[: self.dim]), ", ".join(given[self.dim :])
        return f"{self.body} {self.surface} as rigid: displacement ({moved}), rotation ({turned})"

    @property
    def rigid_surfaces(self) -> tuple[RigidSurface, ...]:
        """Itself."""
        return (self,)

    def held(self, scene: Around) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Return its nodes, ascending, and their displacement by prescribed components, (n, components)."""
        body = scene.bodies[self.body]
        nodes = body.mesh.nodes_to_hold(self.surface)
        points = body.mesh.points[nodes]
        if body.deforms_much:
            return ((nodes, self.turned(points, self.prescribed)),)
        return ((nodes, self.values(points)),)

    def motion_along(self, normal: np.ndarray, scene: Around) -> float:
        """Return the displacement of its point along a direction that it prescribes, [length]."""
        return abs(float(self.prescribed[: len(normal)] @ normal))

    def reference(self, scene: Around) -> np.ndarray:
        """Return the point to which its reaction refers, shape (dim,)."""
        return np.array(self.at)

    def modes(self, points: np.ndarray) -> np.ndarray:
        """Return the displacement of points for each unit component of U and θ.

        Args:
            points: Coordinates, shape (n, dim), [length].

        Returns:
            Shape (n, dim, 3) in the plane, (n, dim, 6) in space.
        """
        return motions_about(points, np.array(self.at))

    def unit_modes(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `modes` in which translations and turns move points about as far, in any unit of length.

        Args:
            points: Coordinates, shape (n, dim), [length].

        Returns:
            The modes, dimensionless, and by what those of U and θ are multiplied: by one, and by one over the
            largest arm, [1 / length], shape (3,) in the plane, (6,) in space.
        """
        modes = self.modes(points)
        arm = np.abs(modes[:, :, self.dim :]).max(initial=0.0)
        if arm <= ROUNDING * max(np.abs(points).max(initial=0.0), np.abs(self.at).max()):
            modes[:, :, self.dim :], arm = 0.0, 1.0  # a single node at the point
        factors = np.repeat([1.0, 1.0 / arm], [self.dim, self.turns])
        return modes * factors, factors

    @property
    def prescribed(self) -> np.ndarray:
        """U, then θ, zero where free, shape (3,) in the plane, (6,) in space."""
        return np.nan_to_num(self._numbers)

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the displacement of points, both of shape (n, dim), with zero for free components."""
        return self.modes(points) @ self.prescribed

    def turned(self, points: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """Return U + (R(θ) − I)(x − p) of points, both of shape (n, dim), for any U, then θ."""
        shift, angle = np.split(motion, [self.dim])
        about = Rotation.from_rotvec(angle if self.dim == 3 else (0.0, 0.0, angle[0]))
        arms = points - np.array(self.at)
        return np.asarray(shift + arms @ about.as_matrix()[: self.dim, : self.dim].T - arms)


@dataclass(frozen=True)
class TurningSurface(RigidSurface):
    """A rigid surface of a body of revolution with torsion, which moves along the axis and turns about it.

    Its rotation and moment are those about the axis; a scene makes it of a `RigidSurface`.
    """

    def modes(self, points: np.ndarray) -> np.ndarray:
        """Return the displacement for unit motions along r and z and about the axis, (n, 2) to (n, 3, 3)."""
        modes = np.zeros((len(points), 3, 3))
        modes[:, [0, 1], [0, 1]] = 1.0
        modes[:, 2, 2] = points[:, 0]
        return modes


#: Name of the surface of a tool.
TOOL = "tool"


@dataclass(frozen=True)
@checked()
class ToolMotion(SupportPart):
    """What moves a `RigidTool`: prescribed components, forces, moments and springs, for a support.

    Components of displacement and rotation that are given are prescribed; the others follow from equilibrium
    with the contact, the force, the moment, and springs between the point and the ground, which are free of
    force where the tool is before it moves. With small displacements rotations are small; where bodies deform
    much the tool turns about the axis of the rotation θ by its length, loads act where its point has moved
    and keep their directions in space, and springs have the energy ½ Σ k U² + ½ Σ k θ². The reaction of the
    tool's support is what prescribed components take, without load and springs.

    Attributes:
        tool: Name of the tool.
        displacement: Of its point: for each direction a number, [length], or None where it is free; all free
            by default.
        rotation: About each axis through the point, in the plane one number, positive from x to y, in
            radians; None leaves a component free; all free by default.
        force: At the point along free directions, [force] (in the plane: per unit of thickness).
        moment: Around free axes, in the plane one number, [force·length].
        stiffness: Of springs along free directions, ≥ 0, [force / length]; none by default.
        rotational_stiffness: Of springs around free axes, in the plane one number, ≥ 0, [force·length].

    Raises:
        InvalidInputError: If numbers are missing or not finite, a stiffness is negative, or a load or a
            spring acts on a prescribed component. When the scene is made: if it has no such tool.

    Example:
        >>> floating = ToolMotion("pad", (0, 0, None), force=(0, 0, -50))  # N: moves down and tilts
        >>> sprung = ToolMotion("arm", (0, 0, None), (0, 0, 0), stiffness=(0, 0, 120))  # N/mm
    """

    tool: str
    displacement: Motion | None = None
    rotation: Motion | float | None = None
    force: GivenVector | None = None
    moment: GivenVector | float | None = None
    stiffness: GivenVector | None = None
    rotational_stiffness: GivenVector | float | None = None

    @property
    def body(self) -> str:  # type: ignore[override]
        """The body that carries the motion of the tool in a scene."""
        return self.tool

    @property
    def surface(self) -> str:  # type: ignore[override]
        """The surface of that body."""
        return TOOL

    @property
    def in_words(self) -> str:
        """Which tool it moves."""
        return f"tool {self.tool}"

    def of(self, at: GivenVector) -> RigidSurface:
        """Return the motion of a tool with a reference point."""
        given = self.displacement, self.rotation, self.force, self.moment
        return RigidSurface(self.tool, TOOL, at, *given)

    def springs(self, at: GivenVector) -> GivenVector:
        """Return the stiffness of the springs along and around all axes, () without any."""
        turns = 2 * len(at) - 3
        parts = [self.stiffness, self.rotational_stiffness]
        rows = [
            np.zeros(count) if part is None else np.atleast_1d(np.asarray(part, dtype=np.float64))
            for part, count in zip(parts, (len(at), turns), strict=True)
        ]
        known = np.concatenate(rows)
        fits = [len(row) for row in rows] == [len(at), turns]
        if not fits or not (np.isfinite(known).all() and (known >= 0).all()):
            raise InvalidInputError(
                f"springs of tool {self.tool!r} need {len(at)} stiffnesses along, {turns} around axes, ≥ 0, "
                f"got {self.stiffness!r} and {self.rotational_stiffness!r}: give zeros where there is none"
            )
        motion = self.of(at)
        if (known[~motion.free] > 0).any():
            raise InvalidInputError(
                f"springs of tool {self.tool!r} must act on free components, got {known.tolist()} "
                f"{motion._prescribes}: leave the component free (None), or the spring away"
            )
        return floats(known) if known.any() else ()


#: What prescribes displacements of a surface; a scene holds motions of tools as those of their surfaces.
AnySupport: TypeAlias = Support | RigidSurface | Roller | ToolMotion
