"""Scenes of heat: bodies that conduct, what heats and cools them, and surfaces between which heat passes."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isnan, nan
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._base.display import displayed
from fenics_contact._kinematics.base import Kinematics
from fenics_contact._kinematics.scalar import RevolvedScalar, Scalar
from fenics_contact._scene.body import Body
from fenics_contact._scene.checks import check_known, check_not_negative, check_positive
from fenics_contact._scene.obstacles import RigidObstacle
from fenics_contact._scene.pairs import AnyDiscretisation, ContactPair, Surface, Tie
from fenics_contact._scene.part import Around
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.supports import Support
from fenics_contact._surfaces.true_surface import Geometry
from fenics_contact.errors import InvalidInputError
from fenics_contact.heat.conductance import AnyConductance, Conductance, EvenConductance
from fenics_contact.heat.friction import NO_FRICTION_HEAT, FrictionHeat
from fenics_contact.heat.parts import HeatLoad, HeldTemperature, Value
from fenics_contact.heat.properties import Conductor
from fenics_contact.materials.elastic import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh.body_mesh import BodyMesh

if TYPE_CHECKING:
    from fenics_contact.heat.plan import HeatPlan


@dataclass(frozen=True)
class _Typical:
    """The conductivity by which subdomains are compared, as a material of a scalar field."""

    conductivity: float
    dims: ClassVar[tuple[int, ...]] = (2, 3)

    @property
    def parameters(self) -> tuple[float, ...]:
        return (self.conductivity,)

    def stress(self, u: Any, parameters: Any) -> Any:
        import ufl

        return parameters[0] * ufl.grad(u)

    def stiffness(self, u: Any, v: Any, parameters: Any) -> Any:
        import ufl

        return ufl.inner(self.stress(u, parameters), ufl.grad(v))

    def kernel(self, points: np.ndarray) -> np.ndarray:
        return np.ones((len(points), 1, 1))


@dataclass(frozen=True)
class _FieldBody(Body):
    """A body whose unknown is a temperature."""

    @property
    def kinematics(self) -> Kinematics:
        """One number at each node."""
        return RevolvedScalar() if self.axisymmetric else Scalar(self.mesh.dim)


@dataclass(frozen=True)
class _Held(Support):
    """A held temperature as a support of a scalar field."""

    def __post_init__(self) -> None:
        """Nothing: it was checked as a temperature."""

    def check(self, scene: Around) -> None:
        """Nothing, likewise."""

    def in_scene(self, scene: Around) -> Self:
        """Return itself."""
        return self

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the temperatures at points, shape (n, 1)."""
        (given,) = self.value
        return HeldTemperature(self.body, self.surface, given).values(points)[:, None]  # type: ignore[arg-type]


@displayed
@dataclass(frozen=True)
@checked()
class ConductingBody:
    """A mesh and what conducts heat in it.

    Attributes:
        mesh: The mesh.
        material: What it is made of, or one `Conductor` for each of the mesh's regions by name.
        axisymmetric: Whether the plane mesh is half the section of a body of revolution, see `Body`: heat is
            that of a full revolution.
        thickness: Of a plane body, [length]; heat is that of all of it.

    Raises:
        InvalidInputError: If materials do not name the regions, or do not suit the dimension.

    Example:
        >>> from fenics_contact.gallery import rectangle
        >>> fin = ConductingBody(rectangle((0, 0), (50, 2), (50, 4)), Conductor(0.2), thickness=100.0)
    """

    mesh: BodyMesh
    material: Conductor | Mapping[str, Conductor]
    axisymmetric: bool = False
    thickness: float = 1.0

    def __post_init__(self) -> None:
        """Reject regions without exactly one material, and tensors of another dimension."""
        check_positive("ConductingBody.thickness", self.thickness, "leave it out for heat per unit of it")
        if self.thickness != 1.0 and (self.mesh.dim == 3 or self.axisymmetric):
            raise InvalidInputError(
                f"only plane bodies have a thickness, got {self.thickness:g} of one in space or of "
                "revolution: leave it out"
            )
        given = self.material
        if isinstance(given, Mapping) and set(given) != set(self.mesh.regions):
            raise InvalidInputError(
                f"materials by region must name exactly the regions of the mesh, got {sorted(given)}, the "
                f"mesh has {sorted(self.mesh.regions)}: give one for each, or one for the whole body"
            )
        for each in self.materials:
            size = len(each.tensor) if each.tensor.ndim else self.mesh.dim
            if size != self.mesh.dim:
                raise InvalidInputError(
                    f"a conductivity must be one, or have {self.mesh.dim} axes in this body, got {size}: "
                    f"give {self.mesh.dim}"
                )

    @property
    def materials(self) -> tuple[Conductor, ...]:
        """What it is made of, region by region."""
        if isinstance(self.material, Mapping):
            return tuple(self.material[name] for name in self.mesh.regions)
        return (self.material,)

    @property
    def is_linear(self) -> bool:
        """Whether nothing in it depends on the temperature."""
        return all(each.is_linear for each in self.materials)

    def cells_of(self, number: int) -> np.ndarray:
        """Return the cells of one of its materials, ascending."""
        if isinstance(self.material, Mapping):
            return np.sort(self.mesh.regions[list(self.mesh.regions)[number]])
        return np.arange(self.mesh.n_cells)

    def conducted(
        self, cells: np.ndarray, points: np.ndarray, temperature: np.ndarray, gradient: np.ndarray
    ) -> np.ndarray:
        """Return k ∇T at points of some cells, shape (n, m, dim).

        `cells`: their numbers, (n,); `points`: (n, m, dim); `temperature`: (n, m); `gradient`: (n, m, dim).
        """
        result = np.empty_like(gradient)
        for number, material in enumerate(self.materials):
            own = np.isin(cells, self.cells_of(number))
            result[own] = material.conducted(points[own], temperature[own], gradient[own])
        return result

    def _facts(self) -> dict[str, Any]:
        kind = ", a body of revolution" if self.axisymmetric else ""
        return {"mesh": self.mesh.cells_in_words + kind, "materials": list(self.materials)}


@displayed
@dataclass(frozen=True)
@checked("conductance", "temperature", "pressure")
class ThermalContact:
    """Two surfaces between which heat passes: q = h (T_slave − T_master).

    Heat passes wherever the slave faces the master, through closed points and across gaps, as the conductance
    says. It is conserved at each point: what leaves the slave enters the master.

    Attributes:
        slave: Surface at whose nodes heat passes: the finer one.
        master: Surface of another body, or a rigid obstacle of a given temperature.
        conductance: A number h > 0, [power / (length² · degree)], or a `Conductance`; laws add up by "+".
        temperature: Of an obstacle: a number or a function of the slave's points, in degrees.
        pressure: Pressure where mechanics does not give it, because no contact pair has these surfaces: a
            number or a function of the slave's points, [force / length²].
        discretisation: "node", "mortar" or "best", as in `ContactPair`.
        geometry: As in `ContactPair`.
        friction: Heat that arises where the surfaces slide; none by default.

    Raises:
        InvalidInputError: If an obstacle has no temperature, or a body has one, or a pressure is negative.

    Example:
        >>> film = ThermalContact(Surface("chip", "bottom"), Surface("sink", "top"), 0.02)  # W/(mm² K)
    """

    slave: Surface
    master: Surface | RigidObstacle
    conductance: AnyConductance
    temperature: Value = nan
    pressure: Value = 0.0
    discretisation: AnyDiscretisation = "best"
    geometry: Geometry = "best"
    friction: FrictionHeat = NO_FRICTION_HEAT

    def __post_init__(self) -> None:
        """Reject obstacles without a temperature."""
        if not isinstance(self.conductance, Conductance):
            object.__setattr__(self, "conductance", EvenConductance(self.conductance))
        if self.law.by_contact:
            self.law.require_rising(self.place)
        given: Any = self.temperature
        has = callable(given) or not isnan(given)
        if has == isinstance(self.master, Surface):
            needed = "a body has the temperature that is computed" if has else "an obstacle needs one"
            raise InvalidInputError(
                f"ThermalContact.temperature of {self.place} is that of an obstacle, {needed}: "
                + ("leave it out" if has else "give temperature=...")
            )
        if not callable(self.pressure):
            remedy = "give what presses the surfaces together, or leave it out"
            check_not_negative("ThermalContact.pressure", self.pressure, remedy)

    @property
    def law(self) -> Conductance:
        """The conductance as a law."""
        assert isinstance(self.conductance, Conductance)
        return self.conductance

    @property
    def pair(self) -> ContactPair:
        """The surfaces as a pair that may touch."""
        return ContactPair(
            self.slave, self.master, discretisation=self.discretisation, geometry=self.geometry,
            interference=None,
        )  # fmt: skip

    @property
    def place(self) -> str:
        """Where it is, in words."""
        other = self.master.in_words if isinstance(self.master, Surface) else type(self.master).__name__
        return f"{self.slave.in_words} - {other}"

    def _facts(self) -> dict[str, Any]:
        return {"surfaces": self.place, "conductance": self.conductance}


@displayed
@dataclass(frozen=True)
@checked()
class HeatScene:
    """Bodies that conduct heat.

    Temperatures have any zero, unless something radiates. Lengths, powers and degrees are in units of your
    own that fit each other, such as m, W and K, or mm, W and K; together with mechanics in N and mm power is
    in N mm/s, which is 1e-3 W.

    Attributes:
        bodies: Bodies by name.
        held: Temperatures that are held.
        loads: What heats and cools them.
        contacts: Surfaces between which heat passes.
        ties: Pairs of surfaces with the same temperature, see `Tie`.

    Raises:
        InvalidInputError: If a part names a body or a surface that is not there.

    Example:
        >>> from fenics_contact.gallery import block
        >>> plates = {
        ...     name: ConductingBody(block((0, 0, z), (9, 9, z + 2), (4, 4, 2)), Conductor(0.05))
        ...     for name, z in (("lower", 0.0), ("upper", 2.0))
        ... }
        >>> scene = HeatScene(
        ...     plates,
        ...     held=[HeldTemperature("lower", "z0", 20.0), HeldTemperature("upper", "z1", 80.0)],
        ...     contacts=[ThermalContact(Surface("upper", "z0"), Surface("lower", "z1"), 2e-3)],
        ... )
    """

    bodies: Mapping[str, ConductingBody]
    held: Sequence[HeldTemperature] = ()
    loads: Sequence[HeatLoad] = ()
    contacts: Sequence[ThermalContact] = ()
    ties: Sequence[Tie] = ()

    def __post_init__(self) -> None:
        """Check the parts."""
        if not self.bodies:
            raise InvalidInputError("a scene of heat needs at least one body, got none: give bodies={...}")
        for name in ("held", "loads", "contacts", "ties"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        meshes = {name: body.mesh for name, body in self.bodies.items()}
        for part in (*self.held, *self.loads):
            part.check(meshes)
        for contact in self.contacts:
            for side in (contact.slave, contact.master):
                if isinstance(side, Surface):
                    check_known(side.body, meshes, f"ThermalContact names body {side.body!r}, the scene has")
            if isinstance(contact.master, Surface) and contact.master.body == contact.slave.body:
                raise InvalidInputError(
                    f"heat passes between surfaces of two bodies, got {contact.place} of one: split the "
                    "body and join its parts by a Tie"
                )
        self._require_one_way()
        _ = self.geometry, self.field

    def _require_one_way(self) -> None:
        """Reject surfaces between which heat passes in two ways."""
        for contact in self.contacts:
            both = [contact.slave, contact.master]
            if any(both in ([tie.slave, tie.master], [tie.master, tie.slave]) for tie in self.ties):
                raise InvalidInputError(
                    f"heat passes between {contact.place} by a ThermalContact and by a Tie, which has no "
                    "resistance: leave out one"
                )

    @classmethod
    def on(cls, scene: Scene, materials: Mapping[str, Any], **parts: Any) -> Self:
        """Return heat on the meshes of a scene of mechanics, with their thickness and axes of revolution.

        `materials`: those of the bodies that conduct, by name; `parts`: as for `HeatScene`, ties by default
        those of the scene. Raises `InvalidInputError` if a body is not there, or has several thicknesses.

        Example:
            >>> heat = HeatScene.on(scene, {"rod": Conductor(0.05)}, held=[...])  # doctest: +SKIP
        """
        bodies = {}
        for name, material in materials.items():
            check_known(name, scene.bodies, f"heat is of body {name!r}, the scene has")
            body, known = scene.bodies[name], np.unique(scene.bodies[name].thickness_of_cells)
            if len(known) > 1 or scene.preloads:
                raise InvalidInputError(
                    f"heat on meshes of a scene needs bodies of one thickness without cuts of preloads, got "
                    f"{len(known)} and {len(scene.preloads)}: give HeatScene bodies of your own"
                )
            bodies[name] = ConductingBody(body.mesh, material, body.axisymmetric, float(known[0]))
        ties = [tie for tie in scene.ties if all(side.body in bodies for side in tie.surfaces)]
        return cls(bodies, **{"ties": ties, **parts})

    def _facts(self) -> dict[str, Any]:
        return {
            "bodies": {name: body.mesh.cells_in_words for name, body in self.bodies.items()},
            "held": [each.place for each in self.held],
            "loads": [f"{type(each).__name__} {each.place}" for each in self.loads],
            "contacts": [each.place for each in self.contacts],
            "ties": [each.place for each in self.ties],
        }

    @cached_property
    def geometry(self) -> Scene:
        """Its meshes and surfaces as a scene, by which points that face each other are found."""

        def body(given: ConductingBody) -> Body:
            solid = given.axisymmetric or given.mesh.dim == 3
            stand_in = IsotropicElasticity(1.0, 0.0) if solid else PlaneStrain(1.0, 0.0)
            return Body(given.mesh, stand_in, axisymmetric=given.axisymmetric)

        bodies = {name: body(each) for name, each in self.bodies.items()}
        found = Scene(bodies, contacts=[each.pair for each in self.contacts], ties=list(self.ties))
        if not any(pair.choice.exchanged for pair in found.contacts):
            return found
        # A corner that presses is better as the slave; heat goes from the given slave to its master.
        chosen = zip(self.contacts, found.contacts, strict=True)
        kept = [replace(each.pair, discretisation=pair.discretisation) for each, pair in chosen]
        return replace(found, contacts=kept)

    @cached_property
    def field(self) -> Scene:
        """The scene of its temperatures: what is torn into subdomains."""
        bodies = {
            name: _FieldBody(body.mesh, _typical(body), body.axisymmetric)
            for name, body in self.bodies.items()
        }
        return Scene(bodies, supports=[_Held(each.body, each.surface, (each.value,)) for each in self.held])

    def effects(self) -> dict[str, int]:
        """Return how many parts of the scene have each physical effect, by its name."""
        parts = (*self.bodies.values(), *self.held, *self.loads, *self.contacts, *self.ties)
        names = [re.sub("(?<=[a-z])(?=[A-Z])", " ", type(each).__name__).lower() for each in parts]
        names += ["body of revolution" for body in self.bodies.values() if body.axisymmetric]
        varying = [not each.is_linear for each in (*self.bodies.values(), *self.loads)]
        varying += [each.law.by_temperature for each in self.contacts]
        return dict(Counter([*names, *["law that depends on the temperature"] * sum(varying)]))

    def partition(self, ranks: int = 1) -> dict[str, np.ndarray]:
        """Cut every body into subdomains of a suitable size, see `Scene.partition`."""
        return self.field.partition(ranks)

    def plan(self, partitions: Mapping[str, np.ndarray] | None = None, *, ranks: int = 1) -> HeatPlan:
        """Return what will be built: unknowns, rows, memory; arguments as for `Scene.plan`.

        Example:
            >>> print(scene.plan())  # doctest: +SKIP
        """
        from fenics_contact.heat.plan import make_plan

        places, cut = [each.place for each in self.contacts], partitions or self.partition(ranks)
        return make_plan(self.field, self.geometry, self.effects(), places, cut, ranks)

    @property
    def levels(self) -> tuple[float, ...]:
        """Temperatures that were given as numbers: of what is held, of surroundings and of obstacles."""
        given = [each.value for each in self.held]
        given += [each.level for each in self.loads] + [each.temperature for each in self.contacts]
        return tuple(each for each in given if not callable(each) and not isnan(each))

    @property
    def only_films_vary(self) -> bool:
        """Whether bodies and contacts do not depend on the temperature: then steps are Newton's."""
        laws = any(each.law.by_temperature or each.friction.by_temperature for each in self.contacts)
        return not laws and all(body.is_linear for body in self.bodies.values())

    @property
    def is_linear(self) -> bool:
        """Whether nothing depends on the temperature."""
        return self.only_films_vary and all(each.is_linear for each in self.loads)


def _typical(body: ConductingBody) -> Any:
    """Return stand-ins for the materials of a body."""
    values = [_Typical(each.typical(Conductor.compared_at) * body.thickness) for each in body.materials]
    if isinstance(body.material, Mapping):
        return dict(zip(body.mesh.regions, values, strict=True))
    return values[0]
