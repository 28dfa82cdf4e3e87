"""The parts of a scene, checks that they fit together, and surfaces of its pairs."""

from __future__ import annotations

import operator
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING, Any, Self
from weakref import WeakKeyDictionary

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._kinematics.base import Kinematics
from fenics_contact._scene.body import Body
from fenics_contact._scene.checks import check_alike
from fenics_contact._scene.constraints import LinearConstraint
from fenics_contact._scene.foundations import ElasticFoundation
from fenics_contact._scene.loads import Load, Pressure
from fenics_contact._scene.local_axes import (
    NO_AXES,
    TILT,
    HeldDirections,
    LocalAxes,
    held_along,
    same_axes,
)
from fenics_contact._scene.pairs import ContactPair, PairPart, Surface
from fenics_contact._scene.part import Part, body_of
from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.revolution import hold_axis, require_all_or_none, require_simple_torsion
from fenics_contact._scene.rollers import held_directions
from fenics_contact._scene.sectors import AnyTie, CyclicSymmetry
from fenics_contact._scene.springs import Spring
from fenics_contact._scene.supports import AnySupport, RigidSurface, Roller
from fenics_contact._scene.thickness import require_thickness
from fenics_contact._scene.tools import ToolBody, bodies_with_tools, tools_in, with_motions
from fenics_contact._surfaces.corners import facing_area, sharp_nodes
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.true_surface import Geometry, true_surface
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.mesh.body_mesh import BodyMesh

if TYPE_CHECKING:
    from fenics_contact._surfaces.continued import Neighbour


@dataclass(frozen=True)
@checked()
class SceneParts:
    """The parts of a `Scene`; its attributes are documented there."""

    bodies: Mapping[str, Body]
    supports: Sequence[AnySupport] = field(default=())
    loads: Sequence[Load] = field(default=())
    contacts: Sequence[ContactPair] = field(default=())
    ties: Sequence[AnyTie] = field(default=())
    preloads: Sequence[Preload] = field(default=())
    foundations: Sequence[ElasticFoundation] = field(default=())
    springs: Sequence[Spring] = field(default=())
    constraints: Sequence[LinearConstraint] = field(default=())

    def __post_init__(self) -> None:
        """Reject names that do not exist, and loads and supports that do not suit their bodies."""
        if not self.bodies:
            raise InvalidInputError(
                "a scene needs at least one body, got none: pass bodies={'name': Body(...)}"
            )
        bodies, supports = with_motions(bodies_with_tools(self.bodies, self.contacts), self.supports)
        object.__setattr__(self, "bodies", bodies)
        object.__setattr__(self, "supports", supports)
        self._require_one_dimension()
        for part in self._checked_parts:
            part.check(self)
        for name in ("supports", "loads"):
            object.__setattr__(self, name, tuple(part.in_scene(self) for part in getattr(self, name)))
        require_thickness(self.deforming, self.foundations, (*self.contacts, *self.ties))
        _require_different(self.contacts)
        _require_different(self.ties)
        if self.torsion:
            tools = len(self.deforming) < len(self.bodies)
            others = {
                "no rigid tools": tools,
                "no preloads": bool(self.preloads),
                "no springs": bool(self.springs),
            }
            require_simple_torsion(self.bodies.values(), self.supports, others)

    @property
    def _checked_parts(self) -> Iterator[Part]:
        """The parts that are checked before meshes are cut: all but those that may name nodes of cuts."""
        yield from (*self.supports, *self.loads, *self.preloads, *self.foundations, *self.springs)
        yield from (*self.contacts, *self.ties)

    @property
    def parts(self) -> Iterator[Part]:
        """All parts that act on bodies or join them."""
        yield from (*self._checked_parts, *self.constraints)

    @property
    def deforms_much(self) -> bool:
        """Whether one of its bodies does."""
        return any(body.deforms_much for body in self.bodies.values())

    @property
    def wears(self) -> bool:
        """Whether one of its contact pairs loses material."""
        return any(pair.wears for pair in self.contacts)

    @property
    def is_nonlinear(self) -> bool:
        """Whether some material's stress is no linear function of the displacement."""
        return any(is_nonlinear(each) for body in self.bodies.values() for each in body.materials)

    @property
    def deforming(self) -> dict[str, Body]:
        """The bodies without those that carry the motions of tools."""
        return {name: body for name, body in self.bodies.items() if not body.is_rigid}

    @property
    def following_pressures(self) -> tuple[Pressure, ...]:
        """The pressures that follow their surfaces, those on bodies that deform much."""
        return tuple(chain.from_iterable(load.following(self) for load in self.loads))

    @property
    def tools(self) -> dict[str, ToolBody]:
        """The bodies that carry the motions of tools."""
        return tools_in(self.bodies)

    def _require_one_dimension(self) -> None:
        """Raise if some bodies are plane and others solid, or only some are bodies of revolution."""
        require_all_or_none(self.bodies, self.deforming)
        plane = {name: body.mesh.dim == 2 for name, body in self.bodies.items()}
        check_alike("be plane", plane, "give the plane ones a depth, as block(...), or describe two scenes")

    @property
    def dim(self) -> int:
        """Dimension of space, 2 or 3."""
        return int(next(iter(self.bodies.values())).mesh.points.shape[1])

    @property
    def components(self) -> int:
        """Number of components of displacements; with torsion there is one more than coordinates."""
        return next(iter(self.bodies.values())).components

    @property
    def kinematics(self) -> Kinematics:
        """The kinematics of its bodies, which are all alike."""
        return next(iter(self.bodies.values())).kinematics

    @property
    def torsion(self) -> bool:
        """Whether its bodies are bodies of revolution that may twist."""
        return next(iter(self.bodies.values())).torsion

    @property
    def axisymmetric(self) -> bool:
        """Whether its bodies are bodies of revolution."""
        return next(iter(self.bodies.values())).axisymmetric

    @property
    def dimension_record(self) -> dict[str, Any]:
        """What files of results say of its space: dimension, revolution, torsion, thickness."""
        thickness = {"thickness": True} if self.has_thickness else {}
        return {"dimension": self.dim, **self.kinematics.record, **thickness}

    @property
    def has_thickness(self) -> bool:
        """Whether its bodies are plane and have a thickness, of which forces are those of all."""
        return any(body.has_thickness for body in self.bodies.values())

    def fixed(self, body: str, supports: Sequence[AnySupport] | None = None) -> np.ndarray:
        """Return which components of a body's nodes supports prescribe, along the axes of `prescribed_along`.

        Args:
            supports: Those that count, all by default.

        Returns:
            Shape (n_nodes, dim).
        """
        return ~np.isnan(self.prescribed(body, supports))

    def prescribed(self, body: str, supports: Sequence[AnySupport] | None = None) -> np.ndarray:
        """Return what supports prescribe at the nodes of a body, NaN where free, (n_nodes, dim), [length].

        Args:
            supports: Those that count, all by default; where they disagree the last one.
        """
        return self.prescribed_along(body, supports)[0]

    def prescribed_along(
        self, body: str, supports: Sequence[AnySupport] | None = None
    ) -> tuple[np.ndarray, LocalAxes]:
        """Return what `prescribed` returns, and along which axes."""
        chosen = self.supports if supports is None else supports
        values = np.full((self.bodies[body].mesh.n_nodes, self.components), np.nan)
        for support in chosen:
            for nodes, given in support.held(self) if support.body == body else ():
                values[nodes] = np.where(np.isnan(given), values[nodes], given)
        hold_axis(self.bodies[body], body, values)
        return self.held_by_rollers(body, values, chosen)

    def holds_as(self, other: SceneParts, body: str) -> bool:
        """Return whether its supports hold the same components of a body's nodes, along the same axes."""
        (mine, axes), (theirs, others) = (each.prescribed_along(body) for each in (self, other))
        return np.array_equal(np.isnan(mine), np.isnan(theirs)) and same_axes(axes, others)

    @property
    def rolling_bodies(self) -> tuple[str, ...]:
        """Names of the bodies with rollers, or with a side of a sector, which may end at the axis."""
        rolling = {roller.body for roller in self.rollers}
        for sector in self.sectors:
            rolling |= {*sector.bodies}
        return tuple(name for name in self.bodies if name in rolling)

    @property
    def rollers(self) -> tuple[Roller, ...]:
        """The rollers among its supports."""
        return tuple(chain.from_iterable(support.rollers for support in self.supports))

    @property
    def rigid_surfaces(self) -> tuple[RigidSurface, ...]:
        """The rigid surfaces among its supports, those of tools included."""
        return tuple(chain.from_iterable(support.rigid_surfaces for support in self.supports))

    @property
    def sectors(self) -> tuple[CyclicSymmetry, ...]:
        """The sides of sectors among its ties."""
        return tuple(chain.from_iterable(tie.sectors for tie in self.ties))

    def held_by_rollers(
        self, body: str, prescribed: np.ndarray, supports: Sequence[AnySupport] | None = None
    ) -> tuple[np.ndarray, LocalAxes]:
        """Return prescribed components of a body with those of rollers and sectors, and along which axes.

        `prescribed`: those of other supports, NaN where free, shape (n_nodes, dim), [length].
        """
        chosen = self.supports if supports is None else supports
        rollers = chain.from_iterable(each.rollers for each in chosen)
        held = [self.directions_of(roller) for roller in rollers if roller.body == body]
        if supports is None:
            held += self._held_on_axes(body)
        if not any(len(each.nodes) for each in held):
            return prescribed, NO_AXES
        return held_along(prescribed, held, body)

    def _held_on_axes(self, body: str) -> list[HeldDirections]:
        """Return what holds nodes on the axes of sectors: there both sides are one."""
        mesh, held = self.bodies[body].mesh, []
        for sector in self.sectors:
            sides = {side.name for side in sector.surfaces if side.body == body}
            held += [sector.held_on_axis(mesh, name) for name in sorted(sides)]
        return held

    def directions_of(self, roller: Roller) -> HeldDirections:
        """Return along what a roller holds which nodes of its body, and by how much they move."""
        mesh = self.bodies[roller.body].mesh
        return held_directions(mesh, roller, mirrored(self, roller.body), planes_of(self))

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of the bodies in the order in which everything is numbered."""
        return tuple(self.bodies)

    def facets(self, surface: Surface) -> np.ndarray:
        """Return the linear facets through the nodes of a surface, rows of node numbers of its body."""
        return self.bodies[surface.body].mesh.linear.surfaces[surface.name]

    @property
    def points(self) -> np.ndarray:
        """Coordinates of the nodes of all bodies in their order, shape (n_nodes, dim), [length]."""
        return np.concatenate([body.mesh.points for body in self.bodies.values()])

    @property
    def has_hanging_nodes(self) -> bool:
        """Whether nodes of some body hang on edges or faces of larger cells."""
        return any(body.mesh.hanging for body in self.bodies.values())

    def has_meshes_of(self, other: SceneParts) -> bool:
        """Return whether its bodies have the very meshes of those of another scene."""
        meshes = [[body.mesh for body in each.bodies.values()] for each in (self, other)]
        return len(meshes[0]) == len(meshes[1]) and all(map(operator.is_, *meshes))

    def has_surfaces_of(self, other: SceneParts) -> bool:
        """Return whether both have the same pairs, on meshes that were `reshaped` from the same ones."""
        pairs = [[*each.contacts, *each.ties] for each in (self, other)]
        meshes = [[body.mesh.origin for body in each.bodies.values()] for each in (self, other)]
        alike = len(meshes[0]) == len(meshes[1]) and all(map(operator.is_, *meshes))
        return alike and pairs[0] == pairs[1]

    def moved(self, points: Mapping[str, np.ndarray]) -> Self:
        """Return the scene with new coordinates for some bodies; topology and names stay.

        Args:
            points: Body name -> coordinates, shape (n_nodes, dim), [length].

        Raises:
            InvalidInputError: If a body is unknown, a coordinate is not finite or a cell is inverted.
        """
        for name in points:
            body_of(self, name, "moved")
        return self._with_meshes({name: self.bodies[name].mesh.moved(x) for name, x in points.items()})

    def reshaped(self, points: Mapping[str, np.ndarray]) -> Self:
        """Return the scene with slightly changed coordinates; surfaces follow, see `BodyMesh.reshaped`.

        Args:
            points: Body name -> coordinates, shape (n_nodes, dim), [length].

        Raises:
            InvalidInputError: As `moved`.
        """
        for name in points:
            body_of(self, name, "reshaped")
        return self._with_meshes({name: self.bodies[name].mesh.reshaped(x) for name, x in points.items()})

    @property
    def origin(self) -> Self:
        """The scene before it was `reshaped`; the scene itself if it was not."""
        meshes = {name: body.mesh.origin for name, body in self.bodies.items()}
        changed = {name: mesh for name, mesh in meshes.items() if mesh is not self.bodies[name].mesh}
        return self._with_meshes(changed) if changed else self

    def _with_meshes(self, meshes: Mapping[str, BodyMesh]) -> Self:
        changed = {name: replace(self.bodies[name], mesh=mesh) for name, mesh in meshes.items()}
        return replace(self, bodies={**self.bodies, **changed})


def _require_different(pairs: Sequence[ContactPair | AnyTie]) -> None:
    """Reject two pairs of the same slave and master: how they share the force is not determined."""
    for number, pair in enumerate(pairs):
        for earlier in range(number):
            other = pairs[earlier]
            alike = getattr(pair, "nodes", None) == getattr(other, "nodes", None)
            if pair.slave == other.slave and pair.master == other.master and alike:
                kind = type(pair).__name__
                raise InvalidInputError(
                    f"the surfaces of {kind} {number}, {pair.place}, are those of {kind} {earlier}: how both "
                    "share the force is not determined; keep one of them, or give them different parts"
                )


def planes_of(scene: SceneParts) -> np.ndarray:
    """Return the normals of planes of symmetry, the axes first, shape (n_planes, dim)."""
    planes = [*np.eye(scene.dim)]
    for normal, _ in chain.from_iterable(roller.symmetry(scene) for roller in scene.rollers):
        if np.max(np.abs(planes @ normal)) < 1.0 - TILT:
            planes.append(normal)
    return np.array(planes)


def mirrored(scene: SceneParts, body: str) -> np.ndarray:
    """Return which nodes of a body lie on which plane of symmetry, shape (n_nodes, n_planes).

    A plane of symmetry is a flat side on which a support prescribes only the component normal to it. The
    columns are those of `planes_of`. On the axis of revolution surfaces have none that is normal to it.
    """
    mesh, planes = scene.bodies[body].mesh, planes_of(scene)
    marks = np.zeros((mesh.n_nodes, len(planes)), dtype=bool)
    mine = (support for support in scene.supports if support.body == body)
    for normal, nodes in chain.from_iterable(support.symmetry(scene) for support in mine):
        marks[nodes, np.argmax(np.abs(planes @ normal))] = True
    marks[scene.bodies[body].on_axis, 0] = True
    return marks


_KNOWN: WeakKeyDictionary[BodyMesh, dict[Hashable, FacetedSurface]] = WeakKeyDictionary()
"""Surfaces of meshes that were asked for."""


def surface_of(
    scene: SceneParts, surface: Surface, geometry: Geometry, *, finer: bool = False
) -> FacetedSurface:
    """Return a named surface; its normals lie in planes of symmetry that cut it, and go around sectors."""
    body, marks, planes = scene.bodies[surface.body], mirrored(scene, surface.body), planes_of(scene)
    measure, made = body.kinematics.measure, _KNOWN.setdefault(body.mesh, {})
    key = surface.name, geometry, finer, measure, np.packbits(marks).tobytes(), planes.tobytes()
    if key not in made:
        made[key] = true_surface(
            body.mesh, surface.name, geometry, mirrored=marks, planes=planes, finer=finer, measure=measure
        )
    found = made[key]
    known = (geometry == "best" or finer) and surface.name in body.mesh.origin.shapes
    neighbours = () if known else _neighbours(scene, surface.body)
    if not neighbours:
        return found
    from fenics_contact._surfaces.continued import continued

    if geometry == "faceted" and not finer:
        return continued(found, neighbours, order=None)
    return continued(found, neighbours, order=3 if finer and geometry != "faceted" else 2)


def slave_of(
    scene: SceneParts, pair: ContactPair | AnyTie, geometry: Geometry, *, finer: bool = False
) -> FacetedSurface:
    """Return the slave of a pair, as `surface_of`; by mortar with the areas of the pieces of its facets."""
    surface = surface_of(scene, pair.slave, geometry, finer=finer)
    return as_mortar_slave(scene, pair.slave, surface) if pair.discretisation == "mortar" else surface


def may_touch(bodies: Mapping[str, Body], pair: PairPart, slave: FacetedSurface) -> np.ndarray:
    """Return which nodes of the slave of a pair may touch its master, shape (len(slave.nodes),)."""
    if not pair.single_nodes:
        return np.ones(len(slave.nodes), dtype=bool)
    return np.isin(slave.nodes, bodies[pair.slave.body].mesh.node_sets[pair.single_nodes])


def as_mortar_slave(scene: SceneParts, side: Surface, surface: FacetedSurface) -> FacetedSurface:
    """Return a named surface as the slave of mortar contact: with areas of pieces, and its sharp nodes."""
    body = scene.bodies[side.body]
    enough = facing_area(body.mesh, side.name, body.kinematics.measure)
    return replace(surface.with_areas_of_pieces(), sharp=np.where(sharp_at(scene, side), enough, np.inf))


def sharp_at(scene: SceneParts, side: Surface) -> np.ndarray:
    """Return which nodes of a named surface, ascending, lie on corners or edges of its body, shape (n,)."""
    mesh = scene.bodies[side.body].mesh
    cuts = mirrored(scene, side.body)
    for neighbour in _neighbours(scene, side.body):
        cuts = np.column_stack([cuts, np.isin(np.arange(mesh.n_nodes), neighbour.here)])
    return sharp_nodes(mesh, side.name, cuts)


def _neighbours(scene: SceneParts, body: str) -> tuple[Neighbour, ...]:
    """Return how a body goes on behind both sides of its sectors."""
    if not scene.sectors:
        return ()
    from fenics_contact._surfaces.continued import Neighbour

    mesh, found = scene.bodies[body].mesh, []
    for sector in scene.sectors:
        if sector.slave.body == body == sector.master.body:
            angle = sector.angle_in(scene)
            slave, master = (np.unique(mesh.surfaces[s.name]) for s in (sector.slave, sector.master))
            found.append(Neighbour(slave, master, sector.turned(mesh.points, angle)))
            found.append(Neighbour(master, slave, sector.turned(mesh.points, -angle)))
    return tuple(found)
