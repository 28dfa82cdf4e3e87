"""The tables of heat in a scene file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import reduce
from operator import add
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Field, PositiveFloat, PositiveInt

from fenics_contact._scene_file import document
from fenics_contact._scene_file.bodies import AnyMaterial
from fenics_contact._scene_file.model import Master, SurfaceOfBody, TiePart
from fenics_contact._scene_file.part import IN_FILES, Part, built, keys_of, table_of
from fenics_contact._scene_file.source import Path, parts_of
from fenics_contact._scene_file.values import (
    Line,
    Numbers,
    Read,
    ScalarField,
    either,
    field_or,
    one_of,
    with_message,
)
from fenics_contact.heat import conductance, parts
from fenics_contact.heat.friction import FrictionHeat
from fenics_contact.heat.properties import Conductor, TemperatureTable
from fenics_contact.heat.scene import ThermalContact

IN_FILES.append((parts.Value, ScalarField, "; in quotes a formula in x, y, z, or a field from a file"))
_Table: Any = table_of(TemperatureTable, temperature=Numbers, value=Numbers)
_KEYS = "{temperature = [...], value = [...]}"
_Property: Any = either(dict, _Table, PositiveFloat)
_Conductivity: Any = either(list, list[either(list, list[float], _Property)], _Property)  # type: ignore[misc]
ConductorPart: Any = table_of(
    Conductor,
    conductivity=(
        Annotated[Any, Read(_Conductivity)],
        Field(description=f"a number, a table {_KEYS}, one for each axis, or a symmetric matrix"),
    ),
    heat_capacity=(
        Annotated[Any, Read(either(dict, _Table, PositiveFloat))] | None,
        Field(None, description=f"of a volume, [energy / (length³ · degree)]: a number or a table {_KEYS}"),
    ),
)


class ConductingPart(document.MadeOf):
    """What a body conducts with."""

    kind_of_material = "a material of heat"
    material: document.Materials = Field(
        description="name of one of [heat.materials], or one for each region"
    )
    thickness: PositiveFloat = Field(1.0, description="of a plane body without mechanics, [length]")


class HeatedPart(document.BodyPart):
    """A body: a mesh and what it is made of, for mechanics and heat."""

    heat: ConductingPart | None = Field(None, description="what it conducts with")


class ConductingAlonePart(HeatedPart):
    """A body: a mesh and what it is made of, for mechanics, heat or both."""

    material: document.Materials | None = Field(None, description="what it deforms with")  # type: ignore[assignment]


@keys_of(parts.HeldTemperature)
class HeldPart(Part):
    """A temperature that a surface, or nodes, are held at."""

    on_nodes: ClassVar[bool] = True


LOADS = (
    table_of(parts.HeatFlux, kind="heat_flux"),
    table_of(parts.HeatSource, kind="heat_source"),
    table_of(parts.HeatAtNodes, kind="heat_at_nodes"),
    table_of(parts.Convection, kind="convection", coefficient=field_or(_Table, _KEYS)),
    table_of(parts.Radiation, kind="radiation"),
)
_Power = conductance.PressureConductance
_OPEN: dict[str, Any] = {
    name: (Numbers, Field((), description=f"{name}, see closed")) for name in ("gap", "open")
}
LAWS = (
    table_of(_Power, law="pressure"),
    table_of(_Power.cooper_mikic_yovanovich, law="cooper_mikic_yovanovich"),
    table_of(_Power.mikic, law="mikic"),
    table_of(conductance.ConductanceTable, law="table", pressure=Numbers, closed=Numbers, **_OPEN),
    table_of(conductance.GapConductance, law="gap"),
    table_of(conductance.GapRadiation, law="radiation"),
)
_OneLaw: TypeAlias = Annotated[Any, one_of("law", *LAWS)]
_Laws = either(list, Annotated[list[_OneLaw], Field(min_length=1)], either(dict, _OneLaw, PositiveFloat))


FrictionHeatPart: Any = table_of(FrictionHeat, coefficient=(field_or(_Table, _KEYS), Field(0.0)))


@keys_of(ThermalContact)
class ThermalContactPart(Part):
    """Two surfaces between which heat passes."""

    slave: SurfaceOfBody
    master: Master
    conductance: Annotated[Any, Read(_Laws)] = Field(
        description="a number, a law, or a list of laws that add up"
    )
    temperature: ScalarField | None = Field(None, description="of an obstacle, in degrees")
    friction: FrictionHeatPart | None = Field(None, description="heat that arises where the surfaces slide")

    def made(self, **other: Any) -> Any:
        """Build the contact."""
        given = {name: value for name in self.given if (value := built(getattr(self, name))) is not None}
        laws = given["conductance"]
        return ThermalContact(
            **{**given, "conductance": reduce(add, laws) if isinstance(laws, list) else laws}
        )


_SCHEMES = Literal["bdf2", "euler", "crank-nicolson"]
_SCHEME = Annotated[
    _SCHEMES | float, with_message("'bdf2', 'euler', 'crank-nicolson' or a number from 0.5 to 1")
]


class TimePart(Part):
    """Temperatures over time, by steps of one length or of a given error."""

    duration: PositiveFloat = Field(description="until when, from zero on, [time]")
    begin: PositiveInt = Field(1, description="number of steps of Euler's rule at the start")
    initial: either(dict, dict[str, ScalarField], float) = Field(  # type: ignore[valid-type]
        description="temperature at the start, or by body, in degrees"
    )
    step: PositiveFloat | None = Field(
        None, description="length of steps, with a tolerance of the longest, [time]"
    )
    tolerance: PositiveFloat | None = Field(
        None, description="largest error of temperatures by steps, [degree]"
    )
    scheme: Annotated[Any, Read(_SCHEME)] = Field(
        "bdf2", description="bdf2 is of second order, euler of first"
    )
    outputs: Numbers = Field((), description="times at which steps end and states are written, [time]")

    @property
    def options(self) -> dict[str, Any]:
        """What is given of it."""
        return {name: getattr(self, name) for name in self.model_fields_set}


class HeatPart(Part):
    """Heat that bodies conduct: of what, what heats and cools them, where it passes."""

    materials: dict[str, ConductorPart] = Field(min_length=1, description="what conducts, by name")
    held: list[HeldPart] = Field([], description="temperatures that are held")
    loads: list[Annotated[Any, one_of("kind", *LOADS)]] = Field([], description="what heats and cools bodies")
    contacts: list[ThermalContactPart] = Field([], description="surfaces between which heat passes")
    ties: list[TiePart] = Field([], description="pairs of surfaces with the same temperature")
    stress_free: either(dict, dict[str, float], float) = Field(  # type: ignore[valid-type]
        0.0, description="temperature at which bodies are free of thermal strain, or by body, in degrees"
    )
    duration: PositiveFloat | None = Field(
        None,
        description="time in which loads act, for heat of friction; by default so long that it is none",
    )

    time: TimePart | None = Field(None, description="temperatures over time; without it steady ones")

    @property
    def coupling(self) -> dict[str, Any]:
        """What is given for mechanics and heat together."""
        return {name: getattr(self, name) for name in self.model_fields_set & {"stress_free", "duration"}}


class HeatOutputPart(document.OutputPart):
    """What is written, and where."""

    pictures: list[document.PictureKind] = Field(default=[], description="pictures as PNG files")
    fields: list[Line] = Field(default=["temperature"], description="names of fields that are drawn")


class HeatDocument(document.Document):
    """A scene of fenics_contact with heat."""

    materials: dict[str, AnyMaterial] = Field({}, description="materials by name")
    bodies: dict[str, ConductingAlonePart] = Field(min_length=1, description="bodies by name")  # type: ignore[assignment]
    output: HeatOutputPart = Field(HeatOutputPart(), description="what is written, and where")
    heat: HeatPart = Field(description="heat of the bodies")  # type: ignore[assignment]
    why: ClassVar[str] = "has no meaning in this file of heat alone: leave it out"

    @property
    def known(self) -> Mapping[str, Collection[str]]:  # type: ignore[override]
        """Names of what conducts."""
        return {"a material of heat": self.heat.materials}

    def refused(self) -> Mapping[type, set[str]]:
        """Return keys of tables that have no meaning in such a file."""
        own = {"title", "units", "meshes", "bodies", "heat", "solver", "output"}
        of_body = {"material", "torsion", "integration"}
        return {HeatDocument: {*HeatDocument.model_fields} - own, ConductingAlonePart: of_body,
                HeatPart: {"stress_free", "duration"},
                document.SolverPart: _OF_SOLVERS | ({"tolerance"} if self.heat.time else set())}  # fmt: skip

    def misfits(self) -> Iterator[tuple[Path, str]]:
        """Yield keys that have no meaning in such a file."""
        refused = self.refused()
        for path, part in parts_of(self, Part):
            for key in sorted(part.model_fields_set & refused.get(type(part), set())):
                yield (*path, key), self.why
        for name in [
            name for name, body in self.bodies.items() if HeatDocument is type(self) and not body.heat
        ]:
            yield ("bodies", name), "must have 'heat', what it conducts with: this file has heat alone"


class HeatedDocument(HeatDocument):
    """A scene of fenics_contact with mechanics and heat."""

    materials: dict[str, AnyMaterial] = Field(min_length=1, description="materials by name")
    bodies: dict[str, HeatedPart] = Field(min_length=1, description="bodies by name")  # type: ignore[assignment]
    output: document.OutputPart = Field(  # type: ignore[assignment]
        document.OutputPart(), description="what is written, and where"
    )
    why: ClassVar[str] = "does not go with mechanics and heat together: leave it out"

    def refused(self) -> Mapping[type, set[str]]:
        """Return keys of tables that have no meaning in such a file."""
        return {HeatedDocument: {"steps", "accuracy", "design", "automatic_contact"},
                ConductingPart: {"thickness"}, HeatPart: {"time"},
                document.SolverPart: _OF_SOLVERS}  # fmt: skip


#: What solvers of mechanics alone take.
_OF_SOLVERS = {*document.SolverPart.model_fields} - {"subdomains", "tolerance"}
