"""The parts of a scene, checks that they fit together, and surfaces of its pairs."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._kinematics.base import Kinematics
from fenics_contact._scene.body import Body
from fenics_contact._scene.constraints import LinearConstraint
from fenics_contact._scene.foundations import ElasticFoundation
from fenics_contact._scene.initial_stress import require_components
from fenics_contact._scene.loads import (
    BodyForce,
    InitialStress,
    Load,
    Pressure,
    Spinning,
    SurfaceLoad,
    ThermalStrain,
    TotalForce,
    require_region,
)
from fenics_contact._scene.local_axes import NO_AXES, HeldDirections, LocalAxes, held_along, same_axes
from fenics_contact._scene.obstacles import RigidObstacle
from fenics_contact._scene.pairs import ContactPair, Surface, pressures_of
from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.revolution import hold_axis, require_all_or_none, require_simple_torsion, twisting
from fenics_contact._scene.rollers import direction_of, flat_normal, held_directions, require_direction
from fenics_contact._scene.sectors import AnyTie, CyclicSymmetry
from fenics_contact._scene.springs import Spring
from fenics_contact._scene.supports import AnySupport, RigidSurface, Roller, Support, ToolMotion
from fenics_contact._scene.thickness import require_thickness
from fenics_contact._scene.tools import ToolBody, bodies_with_tools, with_motions
from fenics_contact._scene.touching import check_touching
from fenics_contact._surfaces.corners import facing_area, sharp_nodes
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.true_surface import Geometry, true_surface
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import Material, can_expand
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas

if TYPE_CHECKING:
    from fenics_contact._surfaces.continued import Neighbour

_ON_NODES = ("Support", "Roller", "RigidSurface", "PointForce", "Spring.first", "Spring.second")
"""What may act on the nodes of a node set."""


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
        for part in (*self.supports, *self.loads):
            surface = part.surface if isinstance(part, SurfaceLoad | AnySupport) else None
            self._require(part.body, getattr(part, "nodes", surface), type(part).__name__)
        for preload in self.preloads:
            self._require(preload.body, None, "Preload")
        for foundation in self.foundations:
            self._require(foundation.body, foundation.surface, "ElasticFoundation")
            foundation.require_space(self.components)
        for spring in self.springs:
            for name, end in spring.surfaces.items():
                self._require(end.body, end.name, f"Spring.{name}")
            spring.require_suits(self)
        object.__setattr__(self, "supports", tuple(map(self._in_space, self.supports)))
        if self.torsion:
            object.__setattr__(self, "loads", tuple(map(twisting, self.loads)))
        for part in (*self.supports, *self.loads):
            if not isinstance(part, RigidSurface | Roller | ToolMotion):
                self._require_components(part)
            self._require_off_axis(part)
            if isinstance(part, TotalForce):
                self._require_lever(part)
            if isinstance(part, BodyForce | InitialStress):
                require_region(part, self.bodies[part.body].mesh)
            if isinstance(part, BodyForce) and isinstance(part.value, Spinning):
                part.value.require_axis(self.kinematics)
            if isinstance(part, InitialStress):
                require_components(part, self.bodies[part.body])
            if isinstance(part, ThermalStrain):
                self._require_expansion(part)
        pairs: list[ContactPair | AnyTie] = [*self.contacts, *self.ties]
        for pair in pairs:
            kind = type(pair).__name__
            self._require(pair.slave.body, pair.slave.name, f"{kind}.slave")
            if isinstance(pair, ContactPair) and pair.within_body:
                self._require_deforming(pair)
            if isinstance(pair, ContactPair) and pair.fluid is not None:
                self._require_inlet(pair)
            if isinstance(pair, ContactPair) and pair.nodes is not None:
                check_touching(self.bodies[pair.slave.body].mesh, pair)
            if isinstance(pair, ContactPair) and pair.slip_table is not None:
                self._require_linear_slip(pair)
            if isinstance(pair.master, Surface):
                self._require(pair.master.body, pair.master.name, f"{kind}.master")
                if isinstance(pair, CyclicSymmetry):
                    self._require_sector(pair)
            else:
                self._require_dimension(pair.master)
        require_thickness(self.deforming, self.foundations, (*self.contacts, *self.ties))
        _require_different(self.contacts)
        _require_different(self.ties)
        pressures_of(self.contacts)
        if self.torsion:
            tools = len(self.deforming) < len(self.bodies)
            others = {
                "no rigid tools": tools,
                "no preloads": bool(self.preloads),
                "no springs": bool(self.springs),
            }
            require_simple_torsion(self.bodies.values(), self.supports, others)

    @property
    def deforms_much(self) -> bool:
        """Whether one of its bodies does."""
        return any(body.deforms_much for body in self.bodies.values())

    @property
    def deforming(self) -> dict[str, Body]:
        """The bodies without those that carry the motions of tools."""
        return {name: body for name, body in self.bodies.items() if not isinstance(body, ToolBody)}

    @property
    def following_pressures(self) -> tuple[Pressure, ...]:
        """The pressures that follow their surfaces, those on bodies that deform much."""
        return tuple(
            load
            for load in self.loads
            if isinstance(load, Pressure) and not load.dead and self.bodies[load.body].deforms_much
        )

    def _require_one_dimension(self) -> None:
        """Raise if some bodies are plane and others solid, or only some are bodies of revolution."""
        require_all_or_none(self.bodies, self.deforming)
        plane = [name for name, body in self.bodies.items() if body.mesh.dim == 2]
        solid = [name for name in self.bodies if name not in plane]
        if plane and solid:
            raise InvalidInputError(
                f"the bodies of a scene must all be plane or all be solid, got plane {plane} and solid "
                f"{solid}: give the plane ones a thickness, as block(...) or an extruded mesh, or describe "
                "two scenes"
            )

    def _require(self, body: str, surface: str | None, user: str) -> None:
        if body not in self.bodies:
            raise InvalidInputError(
                f"{user} names body {body!r}, the scene has {sorted(self.bodies)}: use one of them"
            )
        if surface is None:
            return
        surfaces = self.bodies[body].mesh.surfaces
        nodes = self.bodies[body].mesh.node_sets if user in _ON_NODES else ()
        if surface not in surfaces and surface not in nodes:
            raise InvalidInputError(
                f"{user} names surface {surface!r} of body {body!r}, which has {sorted(surfaces)}: "
                "use one of them"
            )

    def _in_space(self, support: AnySupport) -> AnySupport:
        """Return a support with as many components as its body has; reject a point in another space."""
        dim = self.bodies[support.body].mesh.dim
        if isinstance(support, Support):
            return support.held_in(self.components)
        if isinstance(support, Roller):
            require_direction(self.bodies[support.body], support)
            return support
        assert isinstance(support, RigidSurface)
        if self.axisymmetric:
            support = support.along_axis(self.torsion)
        if support.dim != dim:
            raise InvalidInputError(
                f"RigidSurface.at on surface {support.surface!r} of body {support.body!r} must have {dim} "
                f"coordinates, got {support.at!r}: give {dim} of them, and as many displacements"
            )
        return support

    def _require_components(self, part: Load | Support) -> None:
        """Reject a vector whose dimension is not that of its body."""
        if isinstance(part, InitialStress):
            return
        of = self.bodies[part.body].kinematics
        dim, needed = of.components, of.vector_in_words
        if isinstance(part, TotalForce):
            dim, needed = of.resultant_components, of.resultant_in_words
        if isinstance(part.value, tuple) and len(part.value) != dim:
            raise InvalidInputError(
                f"{type(part).__name__}.value of body {part.body!r} must hold {needed}, got {part.value!r}: "
                f"give {dim} of them"
            )

    def _require_off_axis(self, part: Load | AnySupport) -> None:
        """Reject a surface load on the axis, and a resultant with a moment."""
        if not isinstance(part, SurfaceLoad):
            return
        where, body = f"surface {part.surface!r} of body {part.body!r}", self.bodies[part.body]
        if body.on_axis[body.mesh.surfaces[part.surface]].all():
            raise InvalidInputError(
                f"a load on a surface needs an area, {where} is a line, the axis of revolution: choose "
                "another surface"
            )
        if isinstance(part, TotalForce) and not body.kinematics.has_moment(part.moment, part.at):
            raise InvalidInputError(
                f"TotalForce on {where} of a body of revolution acts along its axis, and outwards all "
                f"around, got moment {part.moment!r} and at {part.at!r}: leave both out"
            )

    def _require_lever(self, load: TotalForce) -> None:
        """Reject a moment or a point whose dimension is not that of the body."""
        dim = self.bodies[load.body].mesh.dim
        where = f"surface {load.surface!r} of body {load.body!r}"
        if load.moment is not None and np.shape(load.moment) != (() if dim == 2 else (3,)):
            needed = "one number, as the body is plane" if dim == 2 else "three numbers, about x, y and z"
            raise InvalidInputError(
                f"TotalForce.moment on {where} must be {needed}, got {load.moment!r}: in the plane "
                "a moment is positive from x to y"
            )
        if load.at is not None and len(load.at) != dim:
            raise InvalidInputError(
                f"TotalForce.at of the force on {where} must have {dim} coordinates, got {load.at!r}: give a "
                "point, or none for the centroid of the surface"
            )

    def _require_dimension(self, obstacle: RigidObstacle) -> None:
        """Reject an obstacle whose dimension, if it has one, is not that of the bodies."""
        dim = getattr(obstacle, "dim", self.dim)
        if dim != self.dim:
            raise InvalidInputError(
                f"an obstacle must lie in the space of the bodies, {type(obstacle).__name__} is for {dim} "
                f"dimensions and the bodies have {self.dim}: give it {self.dim} coordinates, or in the plane "
                "a RigidSphere for a round bar"
            )

    def _require_linear_slip(self, pair: ContactPair) -> None:
        """Reject friction by slip between nonlinear materials."""
        if any(is_nonlinear(m) for body in self.bodies.values() for m in body.materials):
            raise InvalidInputError(
                f"the SlipTable of {pair.place} needs linear materials in all bodies: give the coefficient "
                "of each load step as a number or a function of the place"
            )

    def _require_inlet(self, pair: ContactPair) -> None:
        """Reject fluid that enters at an unknown surface, and between bodies with nonlinear materials."""
        enters = pair.fluid.enters if pair.fluid is not None else ""
        if isinstance(enters, str):
            self._require(pair.slave.body, enters, "FluidPressure.enters")
        if any(is_nonlinear(m) for body in self.bodies.values() for m in body.materials):
            raise InvalidInputError(
                f"the fluid between {pair.place} needs linear materials in all bodies: load the wetted "
                "surfaces by Pressure where materials are nonlinear"
            )

    def _require_deforming(self, pair: ContactPair) -> None:
        """Reject contact of a body with itself unless it may deform much."""
        deforming = (is_nonlinear(m) and getattr(m, "finite", True) for m in self._materials(pair.slave))
        if pair.discretisation == "mortar" or pair.given_gap or not any(deforming):
            raise InvalidInputError(
                f"contact of body {pair.slave.body!r} with itself needs a material for large deformations, "
                "discretisation='node' and gaps as they are: change the material, such as to NeoHooke, or "
                "split the body where its parts may touch"
            )

    def _materials(self, surface: Surface) -> tuple[Material, ...]:
        return self.bodies[surface.body].materials

    def _require_sector(self, sector: CyclicSymmetry) -> None:
        """Reject an axis in another space, and sides that are no part of a turn apart."""
        if len(sector.at) != self.dim or not self.kinematics.can_rotate:
            raise InvalidInputError(
                f"CyclicSymmetry.at of {sector.place} must have {self.dim} coordinates, and bodies of "
                f"revolution have no sectors, got {sector.at!r}: give a point of the bodies' space"
            )
        self.sector_angle(sector)

    def sector_angle(self, sector: CyclicSymmetry) -> float:
        """Return the angle that turns the master of a sector onto its slave, in radians."""
        slave, master = (self.bodies[s.body].mesh.origin for s in (sector.slave, sector.master))
        return sector.measured_angle(slave, master)

    def _require_expansion(self, load: ThermalStrain) -> None:
        stiff = [material for material in self.bodies[load.body].materials if not can_expand(material)]
        if stiff:
            raise InvalidInputError(
                f"ThermalStrain needs a thermal expansion of every material of body {load.body!r}, got none "
                f"for {stiff[0]!r}: give the material its thermal_expansion"
            )

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
    def is_plane(self) -> bool:
        """Whether its bodies are plane, with forces a unit of thickness; with a thickness they are not."""
        return self.dim == 2 and not self.axisymmetric and not self.has_thickness

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
            if support.body == body and not isinstance(support, Roller | ToolMotion):
                nodes, given = self.given(support)
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
        rolling = {support.body for support in self.supports if isinstance(support, Roller)}
        for sector in self.sectors:
            rolling |= {sector.slave.body, sector.master.body}
        return tuple(name for name in self.bodies if name in rolling)

    @property
    def sectors(self) -> tuple[CyclicSymmetry, ...]:
        """The sides of sectors among its ties."""
        return tuple(tie for tie in self.ties if isinstance(tie, CyclicSymmetry))

    def held_by_rollers(
        self, body: str, prescribed: np.ndarray, supports: Sequence[AnySupport] | None = None
    ) -> tuple[np.ndarray, LocalAxes]:
        """Return prescribed components of a body with those of rollers and sectors, and along which axes.

        `prescribed`: those of other supports, NaN where free, shape (n_nodes, dim), [length].
        """
        chosen = self.supports if supports is None else supports
        rollers = [each for each in chosen if isinstance(each, Roller) and each.body == body]
        held = [self.directions_of(roller) for roller in rollers]
        if supports is None:
            held += self._held_on_axes(body)
        if not any(len(each.nodes) for each in held):
            return prescribed, NO_AXES
        return held_along(prescribed, held, body)

    def _held_on_axes(self, body: str) -> list[HeldDirections]:
        """Return what holds nodes on the axes of sectors: there both sides are one."""
        mesh, held = self.bodies[body].mesh, []
        for sector in self.sectors:
            sides = {side.name for side in (sector.slave, sector.master) if side.body == body}
            held += [sector.held_on_axis(mesh, name) for name in sorted(sides)]
        return held

    def directions_of(self, roller: Roller) -> HeldDirections:
        """Return along what a roller holds which nodes of its body, and by how much they move."""
        mesh = self.bodies[roller.body].mesh
        return held_directions(mesh, roller, mirrored(self, roller.body), planes_of(self))

    def given(self, support: Support | RigidSurface) -> tuple[np.ndarray, np.ndarray]:
        """Return the nodes of a support, ascending, and what it prescribes, NaN where free, (n, dim)."""
        body = self.bodies[support.body]
        nodes = body.mesh.nodes_to_hold(support.surface)
        points = body.mesh.points[nodes]
        if isinstance(support, RigidSurface) and body.deforms_much:
            return nodes, support.turned(points, support.prescribed)
        return nodes, support.values(points)

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
            self._require(name, None, "moved")
        return self._with_meshes({name: self.bodies[name].mesh.moved(x) for name, x in points.items()})

    def reshaped(self, points: Mapping[str, np.ndarray]) -> Self:
        """Return the scene with slightly changed coordinates; surfaces follow, see `BodyMesh.reshaped`.

        Args:
            points: Body name -> coordinates, shape (n_nodes, dim), [length].

        Raises:
            InvalidInputError: As `moved`.
        """
        for name in points:
            self._require(name, None, "reshaped")
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


#: Directions are the same if the cosine of the angle between them differs from one by no more than this.
TILT = 1e-9


def planes_of(scene: SceneParts) -> np.ndarray | None:
    """Return the normals of planes of symmetry, the axes first, (n_planes, dim); None: the axes alone."""
    planes = [*np.eye(scene.dim)]
    for support in scene.supports:
        normal = _plane(scene, support)
        if normal is not None and np.max(np.abs(planes @ normal)) < 1.0 - TILT:
            planes.append(normal)
    return np.array(planes) if len(planes) > scene.dim else None


def _plane(scene: SceneParts, support: AnySupport) -> np.ndarray | None:
    """Return the normal of the flat side that a roller holds across, if it is one of symmetry."""
    if not isinstance(support, Roller) or callable(support.displacement) or callable(support.direction):
        return None
    mesh = scene.bodies[support.body].mesh
    normal = flat_normal(mesh, support.surface)
    if normal is None or abs(direction_of(mesh, support) @ normal) < 1.0 - TILT:
        return None
    return normal if scene.kinematics.is_mirrored(normal, TILT) else None


def mirrored(scene: SceneParts, body: str) -> np.ndarray:
    """Return which nodes of a body lie on which plane of symmetry, shape (n_nodes, n_planes).

    A plane of symmetry is a flat side on which a support prescribes only the component normal to it. The
    columns are those of `planes_of`, by default of planes normal to the axes. On the axis of revolution
    surfaces have none that is normal to it.
    """
    mesh, planes = scene.bodies[body].mesh, planes_of(scene)
    planes = np.eye(scene.dim) if planes is None else planes
    marks = np.zeros((mesh.n_nodes, len(planes)), dtype=bool)
    for support in scene.supports:
        if support.body != body or isinstance(support, RigidSurface | ToolMotion):
            continue
        if isinstance(support, Roller):
            normal = _plane(scene, support)
            if normal is not None:
                marks[mesh.surfaces[support.surface].ravel(), np.argmax(np.abs(planes @ normal))] = True
            continue
        given = [axis for axis, value in enumerate(support.value) if value is not None]
        if len(given) != 1 or callable(support.value[given[0]]) or given[0] >= scene.dim:
            continue
        if support.surface in mesh.node_sets:
            continue
        facets = mesh.surfaces[support.surface]
        areas = vector_areas(mesh.points, facets)
        across = np.abs(areas[:, given[0]]) >= (1.0 - TILT) * np.linalg.norm(areas, axis=1)
        marks[facets[across].ravel(), given[0]] = True
    marks[scene.bodies[body].on_axis, 0] = True
    return marks


def surface_of(
    scene: SceneParts, surface: Surface, geometry: Geometry, *, finer: bool = False
) -> FacetedSurface:
    """Return a named surface; its normals lie in planes of symmetry that cut it, and go around sectors."""
    body, marks = scene.bodies[surface.body], mirrored(scene, surface.body)
    found = true_surface(
        body.mesh, surface.name, geometry, mirrored=marks, planes=planes_of(scene), finer=finer,
        measure=body.kinematics.measure,
    )  # fmt: skip
    known = (geometry == "best" or finer) and surface.name in body.mesh.origin.shapes
    neighbours = () if known else _neighbours(scene, surface.body)
    if not neighbours:
        return found
    from fenics_contact._surfaces.continued import continued

    if geometry == "faceted" and not finer:
        return continued(found, neighbours, order=None)
    return continued(found, neighbours, order=3 if finer and geometry != "faceted" else 2)


def slave_of(scene: SceneParts, pair: ContactPair | AnyTie, geometry: Geometry) -> FacetedSurface:
    """Return the slave of a pair, as `surface_of`; by mortar with the areas of the pieces of its facets."""
    surface = surface_of(scene, pair.slave, geometry)
    return as_mortar_slave(scene, pair.slave, surface) if pair.discretisation == "mortar" else surface


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
            angle = scene.sector_angle(sector)
            slave, master = (np.unique(mesh.surfaces[s.name]) for s in (sector.slave, sector.master))
            found.append(Neighbour(slave, master, sector.turned(mesh.points, angle)))
            found.append(Neighbour(master, slave, sector.turned(mesh.points, -angle)))
    return tuple(found)
