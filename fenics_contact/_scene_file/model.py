"""Pairs, obstacles, loads and supports of a scene file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, PositiveFloat
from scipy.spatial.transform import Rotation

from fenics_contact._base.checks import meaning
from fenics_contact._scene import automatic, loads, pairs, surface_laws
from fenics_contact._scene import obstacles as obstacles_module
from fenics_contact._scene.constraints import ConstraintTerm, LinearConstraint
from fenics_contact._scene.foundations import ElasticFoundation
from fenics_contact._scene.loads import Load
from fenics_contact._scene.obstacles import MovingObstacle, RigidTool
from fenics_contact._scene.pairs import ContactPair, Surface, Tie
from fenics_contact._scene.preloads import Preload, Section
from fenics_contact._scene.sectors import CyclicSymmetry
from fenics_contact._scene.springs import Spring
from fenics_contact._scene.supports import RigidSurface, Roller, Support, ToolMotion
from fenics_contact._scene_file.part import Part, built, keys_of, nodes_of, not_in_files, table_of
from fenics_contact._scene_file.surface_effects import FluidPart, WearPart, check_wear
from fenics_contact._scene_file.values import (
    FREE,
    OF_SCALAR,
    Components,
    Expression,
    FieldOrMeasured,
    Formula,
    Motion,
    Names,
    NotNegativeField,
    OfFile,
    PlaceOfFile,
    Scalar,
    ScalarField,
    StressOrFormulas,
    Triple,
    Vector,
    VectorExpression,
    at_point,
    at_time,
    either,
    field_or,
    one_of,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.readers.triangulation import read_triangulation
from fenics_contact.shapes.rounded import Box, Cone
from fenics_contact.shapes.triangulation import Triangulation

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact._scene.body import Body


@dataclass(frozen=True)
class ObstaclePath:
    """Where an obstacle is at a time.

    `motion`: displacement, then rotation, in the plane three components, in space six.
    """

    motion: tuple[float | Expression, ...]
    about: tuple[float, ...]

    def __call__(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation and translation at a time."""
        point = np.array(self.about)
        now = [at_time(part, time) for part in self.motion]
        numbers = [at_point(part, point) for part in now]
        shift, angle = np.split(np.array(numbers), [len(point)])
        about = Rotation.from_rotvec(angle if len(point) == 3 else (0.0, 0.0, angle[0]))
        turn = about.as_matrix()[: len(point), : len(point)]
        return turn, point - turn @ point + shift


class ObstaclePart(Part):
    """A rigid obstacle, which may move."""

    motion: Motion | None = Field(
        None,
        description="displacement along x, y and z, [length], then rotation about them, in radians (in the "
        "plane along x and y, then one rotation): numbers or formulas in t in quotes; large displacements "
        "follow it through the load steps",
    )
    about: Vector | None = Field(None, description="point about which it turns, the origin by default")
    tool: str | None = Field(
        None, description="name of a rigid tool, which supports of the kind 'tool' move; about is its point"
    )

    def made(self, **other: Any) -> Any:
        """Build the obstacle, one that moves if there is a motion."""
        return self._moving(super().made(**other))

    def _moving(self, still: Any) -> Any:
        if self.tool is not None:
            if self.motion is not None or self.about is None:
                raise InvalidInputError(
                    f"the tool {self.tool!r} needs the point 'about' which it turns and no motion, which "
                    f"supports of kind 'tool' give it, got {self.about!r} and {self.motion!r}"
                )
            return RigidTool(self.tool, still, tuple(self.about))
        if self.motion is None:
            return still
        dim = 2 if len(self.motion) == 3 else 3
        about = self.about or (0.0,) * dim
        if FREE in self.motion or None in self.motion or len(about) != dim:
            raise InvalidInputError(
                f"the motion of an obstacle must be {3 * dim - 3} numbers or formulas in t, about a point of "
                f"{dim} coordinates, got {self.motion!r} about {about!r}: prescribe all of it"
            )
        return MovingObstacle(still, ObstaclePath(self.motion, tuple(about)))


@keys_of(Triangulation, only=("smooth",))
class TriangulationPart(OfFile, ObstaclePart):
    """A body bounded by the triangles of a file."""

    obstacle: Literal["triangulation"]
    file: PlaceOfFile = Field(
        description="the file, STL or another that meshio reads, relative to the folder of the scene file"
    )
    scale: PositiveFloat = Field(1.0, description="factor of its coordinates")

    @property
    def key(self) -> tuple[Any, ...]:
        """What is read once for all tables that share it."""
        return self.file, self.scale, self.smooth  # type: ignore[attr-defined]

    def read(self, folder: Path, comm: MPI.Comm) -> Triangulation:
        """Return the triangles, read on rank 0. Collective."""
        file, scale, smooth = self.key
        return read_triangulation(folder / file, scale=scale, smooth=smooth, comm=comm)

    def taking(self, read: Triangulation) -> Any:
        """Return the obstacle of triangles that were read."""
        return self._moving(read)


@keys_of(Surface)
class SurfaceOfBody(Part):
    """A surface of a body."""

    body: str = Field(description="name of the body")
    name: str = Field(alias="surface", description="name of its surface")

    @property
    def surface(self) -> str:
        """The name of the surface, under the name of the key."""
        return self.name


#: A formula, also of a number alone.
_Function: TypeAlias = Annotated[
    Annotated[float, AfterValidator(lambda value: Expression(repr(value)))] | Formula, OF_SCALAR
]
OBSTACLES = (
    table_of(obstacles_module.RigidPlane, ObstaclePart, obstacle="plane"),
    table_of(obstacles_module.RigidSphere, ObstaclePart, obstacle="sphere"),
    table_of(obstacles_module.RigidCylinder, ObstaclePart, obstacle="cylinder", point=Triple, axis=Triple),
    table_of(Cone, ObstaclePart, obstacle="cone", tip=Triple, axis=Triple),
    table_of(Box, ObstaclePart, obstacle="box"),
    TriangulationPart,
    table_of(
        obstacles_module.DistanceObstacle,
        ObstaclePart,
        only=["function"],
        obstacle="distance",
        function=(
            _Function,
            Field(
                alias="formula",
                description="signed distance, negative inside, [length], as a formula in x, y, z whose "
                "gradient has length one",
            ),
        ),
    ),
)


class NoFriction(Part):
    """Contact without friction."""

    law: Literal["none"]

    def made(self, **other: Any) -> None:
        """Return None."""

    @classmethod
    def describes(cls, made: object) -> bool:
        """Return whether there is no law."""
        return made is None


FRICTION_LAWS = (
    NoFriction,
    table_of(
        pairs.Coulomb,
        law="coulomb",
        friction_coefficient=(
            field_or(
                table_of(surface_laws.FrictionTable) | table_of(surface_laws.SlipTable),
                "{pressure = [...], coefficient = [...]}, or {slip = [...], coefficient = [...]}",
            ),
            Field(
                alias="coefficient",
                description="friction coefficient; a table is linear between pressures, constant beyond",
            ),
        ),
        shear_limit=(
            NotNegativeField | None,
            Field(None, description="largest friction traction, [force/length²]; without it no limit"),
        ),
    ),
    table_of(pairs.Tresca, law="tresca", traction=NotNegativeField),
)


CLOSURE_LAWS = (
    table_of(surface_laws.LinearClosure, law="linear"),
    table_of(surface_laws.ExponentialClosure, law="exponential"),
    table_of(surface_laws.ClosureTable, law="table"),
)

Master: TypeAlias = Annotated[
    Any,
    one_of(
        "obstacle",
        *OBSTACLES,
        other=SurfaceOfBody,
        when=lambda table: "obstacle" not in table and not {"body", "surface"}.isdisjoint(table),
    ),
]
AnyFriction: TypeAlias = Annotated[Any, one_of("law", *FRICTION_LAWS)]

AnyClosure: TypeAlias = Annotated[Any, one_of("law", *CLOSURE_LAWS)]


class _PairPart(Part):
    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of a pair, without a discretisation that the scene has chosen."""
        chosen = {"discretisation"} if made.reason else set()
        return {key: value for key, value in super().written(made).items() if key not in chosen}


@keys_of(ContactPair, without={"choice"})
class ContactPart(_PairPart):
    """Two surfaces that may touch, or a surface and a rigid obstacle."""

    slave: SurfaceOfBody
    master: Master
    friction: AnyFriction | None
    closure: AnyClosure | None
    fluid: FluidPart | None
    wear: WearPart | None
    gap: NotNegativeField | None = Field(
        description="clearance in place of the measured one, [length]: a number, a formula in x, y, z in "
        "quotes, or a field from a file"
    )
    interference: FieldOrMeasured | None = Field(
        description="overlap in place of the measured gap, [length], given like gap; 'measured' takes the "
        "one that the geometry has, which counts as a mistake otherwise"
    )

    def check_formulas(self, made: ContactPair, bodies: Mapping[str, Body]) -> None:
        """Evaluate the distance of an obstacle that is a formula."""
        if isinstance(made.master, obstacles_module.DistanceObstacle):
            made.master.distance(nodes_of(bodies, made.slave.body, made.slave.name))

    def check_values(self, made: ContactPair, key: str, bodies: Mapping[str, Body]) -> None:
        """Evaluate friction, wear, gap or interference, whichever the key is, at the slave's nodes."""
        nodes = nodes_of(bodies, made.slave.body, made.slave.name)
        if key == "friction":
            made.friction_at(nodes)
            made.limit_at(nodes)
        elif key == "wear":
            check_wear(made, nodes)
        elif getattr(made, key) is not None:
            made.gap_at(nodes)


@keys_of(automatic.AutomaticContact)
class AutomaticPart(Part):
    """Contact wherever boundaries of different bodies face each other, or those of a body that folds."""

    friction: AnyFriction | None
    closure: AnyClosure | None


@keys_of(Tie, without={"choice"})
class TiePart(_PairPart):
    """Two surfaces that stay together."""

    slave: SurfaceOfBody
    master: SurfaceOfBody


@keys_of(CyclicSymmetry, without={"choice"})
class CyclicPart(_PairPart):
    """Both sides of a sector that repeats around an axis."""

    kind: Literal["cyclic"]
    slave: SurfaceOfBody
    master: SurfaceOfBody


AnyTiePart: TypeAlias = Annotated[
    Any, one_of("kind", CyclicPart, other=TiePart, when=lambda part: "kind" not in part)
]


class _Named(Part):
    """A part that load steps change."""

    changed: ClassVar[str] = "value"
    name: str = Field("", description="how load steps call it")

    @property
    def size(self) -> Any:
        """What load steps change."""
        return getattr(self, self.changed)

    @classmethod
    def size_of(cls, made: Any) -> Any:
        """Return what load steps change of an object."""
        return getattr(made, cls.changed)

    @classmethod
    def changed_key(cls) -> str:
        """Return the key of what load steps change."""
        return cls.model_fields[cls.changed].alias or cls.changed

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of an object, always with what load steps change."""
        return {**super().written(made), cls.changed_key(): cls.size_of(made)}


class _Load(_Named):
    def build(self, dim: int, value: Any) -> Load:
        """Return the load with a value, its own or that of a load step."""
        if isinstance(value, tuple) and any(map(callable, value)):
            value = VectorExpression(value)
        return self.made(**{self.changed: value})


@keys_of(loads.TotalForce, without=("value", "at"))
class TotalMomentLoad(_Load):
    """A moment, spread over a surface."""

    changed: ClassVar[str] = "moment"
    kind: Literal["total_moment"]
    moment: either(list, Vector, float) = Field(  # type: ignore[valid-type]
        alias="value", description="three numbers, in the plane one, positive from x to y, [force·length]"
    )

    @classmethod
    def describes(cls, made: object) -> bool:
        """Return no: a total force has these keys, too."""
        return False

    def build(self, dim: int, value: Any) -> Load:
        """Return the load, without a force."""
        return self.made(value=(0.0,) * dim, moment=value)


@keys_of(loads.gravity)
class GravityLoad(_Load):
    """Weight of a body."""

    changed: ClassVar[str] = "acceleration"
    kind: Literal["gravity"]


@keys_of(loads.centrifugal)
class CentrifugalLoad(_Load):
    """Centrifugal force on a body that turns about an axis."""

    changed: ClassVar[str] = "speed"
    kind: Literal["centrifugal"]
    speed: Scalar

    @classmethod
    def describes(cls, made: object) -> bool:
        """Return whether a force per volume is that of a rotation."""
        return isinstance(made, loads.BodyForce) and isinstance(made.value, loads.Spinning)

    @classmethod
    def size_of(cls, made: Any) -> Any:
        """Return the speed."""
        return made.value.speed

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of the force, whose value knows the axis."""
        spin = made.value
        return cls.keys({**vars(spin), "body": made.body, "region": made.region})

    def build(self, dim: int, value: Any) -> Load:
        """Return the load at a speed."""
        return self.made(speed=float(value(np.zeros((1, dim)))[0]) if callable(value) else value)


@keys_of(loads.point_mass)
class PointMassLoad(_Load):
    """Weight of a mass that is fastened to a surface."""

    changed: ClassVar[str] = "acceleration"
    kind: Literal["point_mass"]


@keys_of(loads.ThermalStrain)
class ThermalLoad(_Load):
    """A change of temperature."""

    changed: ClassVar[str] = "temperature_change"
    kind: Literal["thermal"]
    temperature_change: ScalarField = Field(alias="value")


@keys_of(loads.InitialStress)
class InitialStressLoad(_Load):
    """A stress that a body has before anything loads or moves it."""

    kind: Literal["initial_stress"]
    value: StressOrFormulas


@keys_of(Support)
class SupportPart(_Named):
    """Displacement prescribed on a surface, component by component."""

    on_nodes: ClassVar[bool] = True
    value: Components | None = Field(
        None,
        description="displacement along x, y and z (x, y of a plane body; r, z and around the axis where "
        f'bodies may twist), [length]: a number, "{FREE}", or '
        "a formula in x, y, z in quotes, or a field from a file; zero in all directions by default",
    )

    def check_formulas(self, made: Support, bodies: Mapping[str, Body]) -> None:
        """Evaluate the components that are formulas."""
        if any(map(callable, made.value)):
            made.values(nodes_of(bodies, made.body, made.surface))

    def build(self, dim: int, value: tuple[Any, ...] | None) -> Support:
        """Return the support with a value, its own or that of a load step."""
        return self.made(value=value or (0.0, 0.0, 0.0))


@keys_of(RigidSurface, without=("displacement", "rotation"))
class RigidPart(_Named):
    """A surface that moves as one rigid piece, driven or loaded at a point."""

    on_nodes: ClassVar[bool] = True
    kind: Literal["rigid"]
    value: Motion | None = Field(
        None,
        description="displacement of the point along x, y and z, [length], then its rotation about them, in "
        "radians (in the plane along x and y, then one rotation): a number, a formula in t in quotes, or "
        f'"{FREE}"; all free by default',
    )

    @property
    def size(self) -> Any:
        """The motion, with its free components."""
        count = len(self.at)  # type: ignore[attr-defined]
        return self.value or (None,) * (3 * count - 3)

    @classmethod
    def size_of(cls, made: Any) -> Any:
        """Return the motion."""
        return made.motion

    def build(self, dim: int, value: tuple[Any, ...]) -> RigidSurface:
        """Return the rigid surface with a motion, its own or that of a load step."""
        motion = tuple(at_point(each, self.at) for each in value)  # type: ignore[attr-defined]
        turned = motion[dim:]
        return self.made(
            displacement=motion[:dim], rotation=turned[0] if dim == 2 and len(turned) == 1 else turned
        )


@keys_of(Roller)
class RollerPart(_Named):
    """A surface that slides: displacement prescribed along its normal or another direction."""

    changed: ClassVar[str] = "displacement"
    on_nodes: ClassVar[bool] = True
    kind: Literal["roller"]
    direction: Vector | None = Field(
        None, description="the direction, of any length; the outward normal at every node by default"
    )
    displacement: ScalarField = Field(
        0.0,
        alias="value",
        description="displacement along the direction, along the normal positive outwards, [length]: a "
        "number, a formula in x, y, z in quotes, or a field from a file; zero by default",
    )

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of the roller, whose directions must be the same at all nodes."""
        if callable(made.direction):
            raise not_in_files(f"no directions that differ from node to node, as {made.in_words} has")
        return super().written(made)

    def check_formulas(self, made: Roller, bodies: Mapping[str, Body]) -> None:
        """Evaluate a displacement that is a formula."""
        if callable(made.displacement):
            made.amounts(nodes_of(bodies, made.body, made.surface))

    def build(self, dim: int, value: Any) -> Roller:
        """Return the roller with a displacement, its own or that of a load step."""
        return self.made(displacement=value)


@keys_of(ElasticFoundation)
class FoundationPart(Part):
    """A surface that rests on springs to the ground."""

    stiffness: either(list, Vector, PositiveFloat) = Field(  # type: ignore[valid-type]
        description="[force / length³]: a number along the normal of the surface, or one for each axis"
    )


@keys_of(Spring, without=("second", "name"))
class SpringPart(Part):
    """A spring between two surfaces, or a surface and a fixed point."""

    first: SurfaceOfBody
    second: SurfaceOfBody | None = Field(None, description="the other surface")
    point: Vector | None = Field(None, description="a fixed point in place of a second surface, [length]")
    stiffness: either(list, Vector, PositiveFloat) = Field(  # type: ignore[valid-type]
        description="[force / length]: a number along the line between the ends, or one for each axis"
    )
    name: str = Field("", description="how results call it, both ends by default")

    def made(self, **other: Any) -> Spring:
        """Build the spring, with the second end that its keys give."""
        if (self.second is None) == (self.point is None):
            raise InvalidInputError(
                f"a spring needs a second surface or a fixed point, got {self.second!r} and {self.point!r}"
            )
        return super().made(second=self.second.made() if self.second else self.point, name=self.name)

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of the spring, its second end by the key of its kind."""
        own = {name: getattr(made, name) for name in (*cls.given, "name")}
        return cls.keys({**own, "second" if "second" in made.surfaces else "point": made.second})


@keys_of(ConstraintTerm)
class TermPart(Part):
    """A term of equations between displacements of nodes."""

    nodes: either(list, list[int], str) = Field(  # type: ignore[valid-type]
        description="a node set or a surface, or numbers of nodes"
    )
    direction: either(  # type: ignore[valid-type]
        str, Literal["x", "y", "z"], either(list, list[float] | list[list[float]], str)
    ) = Field(description='"x", "y" or "z", a vector of any length, or a list with one for each node')
    factor: either(list, list[float], float) = Field(  # type: ignore[valid-type]
        1.0, description="by which it is multiplied, or one for each node"
    )
    equation: either(list, list[int], int | None) = Field(  # type: ignore[valid-type]
        None, description="number of the equation of all nodes, from 0, or of each; by default one a node"
    )


@keys_of(LinearConstraint, without=("name", "terms"))
class ConstraintPart(Part):
    """Equations between displacements of nodes."""

    terms: list[TermPart] = Field(min_length=1, description="what is added")
    value: either(list, list[float], float) = Field(  # type: ignore[valid-type]
        0.0, description="what the sum is, or that of each equation, [length]"
    )
    name: str = Field("", description="how load steps and results call it, the terms by default")

    def made(self, **other: Any) -> LinearConstraint:
        """Build the constraint."""
        return super().made(terms=built(self.terms), name=self.name)

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of the constraint."""
        own = {name: getattr(made, name) for name in cls.given}
        return cls.keys({**own, "name": made.label, "terms": made.terms})


@keys_of(Preload, without=("section", "name"))
class PreloadPart(Part):
    """A bolt drawn together at a section of its body; without force and shortening held at its length."""

    name: str = Field("", description="how load steps and results call it, the body by default")
    point: Vector | None = Field(None, description="a point of the plane of the section, [length]")
    normal: Vector | None = Field(None, description="normal of the plane, the axis of the bolt")
    regions: Annotated[Names | None, Field(min_length=2, max_length=2)] = Field(
        None, description="two regions of the mesh whose common face is the section, in place of a plane"
    )
    region: str | None = Field(None, description=meaning(Section, "region"))
    radius: float | None = Field(None, gt=0, description=meaning(Section, "radius"))

    def made(self, **other: Any) -> Preload:
        """Build the preload, with the section that its keys give."""
        plane = self.point is not None and self.normal is not None
        if plane == (self.regions is not None):
            raise InvalidInputError(
                "a preload needs the point and normal of a plane, or two regions, got "
                f"point={self.point!r}, normal={self.normal!r} and regions={self.regions!r}: give one of them"
            )
        section: Any = self.regions
        if plane:
            section = Section(self.point or (), self.normal or (), self.region, self.radius)
        return super().made(section=section, name=self.name)

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of the preload, with the keys of its section."""
        cut = made.section
        section = vars(cut) if isinstance(cut, Section) else {"regions": cut}
        return cls.keys({**{name: getattr(made, name) for name in cls.given}, **section, "name": made.label})


class PreloadAim(Part):
    """What a load step does with a preload: a force or a shortening."""

    force: float | None = Field(None, description="force of the section, [force]")
    shortening: float | None = Field(None, description="how much shorter the bolt gets, [length]")


@keys_of(ToolMotion, without=("displacement", "rotation"))
class ToolPart(_Named):
    """Motion, forces, moments and springs of a rigid tool."""

    beside: ClassVar[tuple[str, ...]] = ("contacts",)
    kind: Literal["tool"]
    value: Motion | None = Field(
        None,
        description="displacement of its point along x, y and z, [length], then its rotation about them, in "
        f'radians (in the plane along x and y, then one rotation): a number or "{FREE}"; free by default. '
        "In load steps followed by force and moment",
    )

    @property
    def size(self) -> Any:
        """Motion, force and moment; None where the tool is free, zero where nothing acts."""
        force, moment = self.force, self.moment  # type: ignore[attr-defined]
        turns = np.size(moment) if moment is not None else None
        dim = len(force) if force is not None else 3 if turns == 3 else 2 if turns == 1 else None
        count = len(self.value) if self.value is not None else 3 * (dim or 3) - 3
        dim = count // 3 + 1
        turned = np.broadcast_to(0.0 if moment is None else moment, 2 * dim - 3)
        loads = (*(force or (0.0,) * dim), *turned)
        return (*(self.value or (None,) * count), *map(float, loads))

    def build(self, dim: int, value: tuple[Any, ...]) -> ToolMotion:
        """Return the motion of the tool with motion, force and moment, its own or those of a load step."""
        count = 3 * dim - 3
        numbers = [at_point(each, np.zeros(dim)) for each in value]
        motion, load = tuple(numbers[:count]), tuple(numbers[count:])
        turned, moment = motion[dim:], load[dim:]
        return self.made(
            displacement=motion[:dim], rotation=turned[0] if dim == 2 else turned,
            force=load[:dim], moment=moment[0] if dim == 2 else moment,
        )  # fmt: skip


SUPPORTS = (RigidPart, RollerPart, ToolPart)
AnySupportPart: TypeAlias = Annotated[
    Any, one_of("kind", *SUPPORTS, other=SupportPart, when=lambda part: "kind" not in part)
]
LOADS = (
    table_of(loads.Traction, _Load, kind="traction"),
    table_of(loads.TotalForce, _Load, kind="total_force"),
    TotalMomentLoad,
    table_of(loads.Pressure, _Load, kind="pressure"),
    table_of(loads.BodyForce, _Load, kind="body_force"),
    table_of(loads.PointForce, _Load, kind="point_force"),
    GravityLoad,
    CentrifugalLoad,
    PointMassLoad,
    ThermalLoad,
    InitialStressLoad,
)
AnyLoad: TypeAlias = Annotated[Any, one_of("kind", *LOADS)]
