"""Shape optimisation: what moves, what is minimised, what must hold."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, PlainValidator, Tag, WithJsonSchema

from fenics_contact.scene_file.own_python import is_reference
from fenics_contact.scene_file.values import CountPair, Part, is_number, kind_of, needs

TOTAL_POTENTIAL = "total_potential"


def _objective(value: Any) -> str:
    if value == TOTAL_POTENTIAL or is_reference(value):
        return str(value)
    raise needs(f'"{TOTAL_POTENTIAL}", or an objective of your own as "file.py:NAME"')


def _row(value: Any) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or not value or not all(map(is_number, value)):
        raise needs("finite numbers in brackets, one for each design variable")
    return tuple(float(entry) for entry in value)


_ROW = WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 1})
Row: TypeAlias = Annotated[tuple[float, ...], PlainValidator(_row), _ROW]


class DesignSurfacePart(Part):
    """A surface that a net of control points moves along its normals."""

    body: str = Field(description="name of the body")
    surface: str = Field(
        "contact",
        description='"contact" of a chain link (its crown), or a side of a block',
    )
    net: CountPair = Field((7, 4), description="control points along the surface's two directions")
    transition: float | None = Field(
        None, gt=0, description="width of the strip of boundary around it that follows, [length]"
    )
    lower: float = Field(le=0, description="least displacement of a control point, [length]")
    upper: float = Field(ge=0, description="largest displacement of a control point, [length]")


class VolumeConstraint(Part):
    """The volume of the designed bodies, linearised at the start, relative to that of the start."""

    kind: Literal["volume"]
    at_least: float | None = Field(None, gt=0, description="least volume relative to that of the start")
    at_most: float | None = Field(None, gt=0, description="largest volume relative to that of the start")


class LinearConstraint(Part):
    """A linear function of the design variables."""

    kind: Literal["linear"]
    coefficients: Row = Field(description="one for each design variable")
    at_most: float = Field(description="largest value of the sum of coefficients times variables")


Constraint: TypeAlias = Annotated[
    Annotated[VolumeConstraint, Tag("<volume>")] | Annotated[LinearConstraint, Tag("<linear>")],
    kind_of("kind", ("volume", "linear")),
]


class DesignPart(Part):
    """A shape optimisation of the scene."""

    objective: Annotated[str, PlainValidator(_objective), WithJsonSchema({"type": "string"})] = Field(
        TOTAL_POTENTIAL,
        description='what is minimised: "total_potential" (½ uᵀK u − fᵀu), or "file.py:NAME", an Objective',
    )
    surfaces: list[DesignSurfacePart] = Field(min_length=1, description="what moves")
    constraints: list[Constraint] = Field(default_factory=list, description="what must hold")
    start: Row | None = Field(None, description="design variables at the start, [length]; zero by default")
    tolerance: float = Field(1e-4, gt=0, lt=1, description="relative stopping tolerance of the optimiser")
    max_iterations: int = Field(100, ge=0, description="most serious steps")
    max_evaluations: int = Field(500, ge=1, description="most evaluations of the objective")
    adaptive: bool = Field(
        False,
        description="solve states no more accurately than the optimiser needs; else to solver.tolerance",
    )
