"""Tables of a scene file, whose keys are the arguments of a class or function."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import singledispatch
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ModelWrapValidatorHandler, create_model, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError

from fenics_contact._base.checks import MOST, GivenVector, meaning
from fenics_contact._scene.fields import ScalarValue, VectorValue
from fenics_contact._scene_file.source import Path, parts_of
from fenics_contact._scene_file.values import (
    CountPair,
    CountTriple,
    Names,
    NumberOrPairs,
    Pair,
    Pairs,
    ScalarField,
    Six,
    SixBySix,
    Triple,
    Vector,
    VectorOrFormulas,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.temperature_dependent import ByTemperature

if TYPE_CHECKING:
    from fenics_contact._scene.body import Body

_FORMULAS = "; numbers, formulas in x, y, z in quotes, or fields from files"
SixNumbers = tuple[float, float, float, float, float, float]
#: Types in files for declared types of arguments, with their descriptions; others are read as declared.
IN_FILES: list[tuple[Any, Any, str]] = [
    (Sequence[float], Vector, ""),
    (tuple[float, ...], Vector, ""),
    (GivenVector | float | None, Vector | float | None, ""),
    (GivenVector | None, Vector | None, ""),
    (tuple[float, float], Pair, ""),
    (tuple[float, float] | None, Pair | None, ""),
    (tuple[tuple[float, float], ...], Pairs, ""),
    (tuple[float, float, float], Triple, ""),
    (tuple[float, float, float] | None, Triple | None, ""),
    (SixNumbers | None, Six | None, ""),
    (tuple[SixNumbers, SixNumbers, SixNumbers, SixNumbers, SixNumbers, SixNumbers], SixBySix, ""),
    (ByTemperature, NumberOrPairs, "; a number, or pairs [temperature, value]"),
    (ByTemperature | None, NumberOrPairs | None, "; a number, or pairs [temperature, value]"),
    (tuple[str, ...], Names, ""),
    (tuple[int, int], CountPair, ""),
    (tuple[int, int, int], CountTriple, ""),
    (ScalarValue, ScalarField, _FORMULAS),
    (VectorValue, VectorOrFormulas, _FORMULAS),
]
#: Limits of arguments, by their names.
LIMITS = {
    **dict.fromkeys(
        ("young_modulus", "yield_stress", "bulk_modulus", "shear_modulus", "density",
         "radius", "inner_radius", "length", "straight", "thickness", "width", "hole", "half_width", "shank",
         "head", "head_height", "distance", "n", "n_length", "n_radial", "n_a"),
        Field(gt=0),
    ),
    **dict.fromkeys(("saturation_rate", "kinematic_hardening", "adjust", "pair"), Field(ge=0)),
    "poisson_ratio": Field(gt=-1, lt=0.5),
    "roundness": Field(gt=0, le=1),
    "n_around": Field(ge=12),
    "n_layers": Field(ge=1, le=MOST),
    "p": Field(ge=2, le=100),
}  # fmt: skip
Table = TypeVar("Table", bound="type[Part]")


class Part(BaseModel):
    """A table of a scene file.

    Attributes:
        of: The class or function that is called with it.
        given: Those of its arguments that are keys.
        on_nodes: Whether its surface may be a set of nodes.
        beside: Keys of parts of the scene that its own check needs.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
    of: ClassVar[Callable[..., Any]]
    given: ClassVar[tuple[str, ...]] = ()
    on_nodes: ClassVar[bool] = False
    beside: ClassVar[tuple[str, ...]] = ()

    def made(self, **other: Any) -> Any:
        """Build the object of the table, with other values for some arguments."""
        own = {name: built(getattr(self, name)) for name in self.given}
        return type(self).of(**{**own, **other})

    def check_formulas(self, made: Any, bodies: Mapping[str, Body]) -> None:
        """Evaluate the formulas of the object of the table at nodes, as solvers will."""
        if callable(value := getattr(made, "value", None)):
            named = getattr(made, "surface", getattr(made, "nodes", None))
            value(bodies[made.body].mesh.points if named is None else nodes_of(bodies, made.body, named))

    @classmethod
    def describes(cls, made: object) -> bool:
        """Return whether the table builds such an object."""
        return type(made) is cls.of

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of an object, the inverse of `made`; objects within it stay as they are."""
        return cls.keys({name: getattr(made, name, None) for name in cls.given})

    @classmethod
    def keys(cls, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values under their keys but defaults and None, and the key that names the table."""
        found = {}
        for name, field in cls.model_fields.items():
            names = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
            value = values.get(name, names[0] if len(names) == 1 and field.is_required() else None)
            if value is not None and not (type(value) is type(field.default) and value == field.default):
                found[field.alias or name] = value
        return found

    @model_validator(mode="wrap")
    @classmethod
    def _explained(cls, data: Any, handler: ModelWrapValidatorHandler[Any]) -> Any:
        """Add the table's keys and the meaning of the wrong one to errors."""
        try:
            return handler(data)
        except ValidationError as error:
            explained = [cls._explain(each) for each in error.errors()]
            raise ValidationError.from_exception_data(cls.__name__, explained) from None

    @classmethod
    def _explain(cls, error: Any) -> InitErrorDetails:
        context = error.get("ctx", {})
        if error["type"] != "explained":
            known = {field.alias or name: field.description for name, field in cls.model_fields.items()}
            hint = known.get(error["loc"][0]) if error["loc"] else None
            context = {
                **context, "kind": error["type"], "text": error["msg"], "keys": list(known), "hint": hint
            }  # fmt: skip
        explained = PydanticCustomError("explained", "{kind}", context)
        return {"type": explained, "loc": error["loc"], "input": error["input"]}


@singledispatch
def built(value: Any) -> Any:
    """Return what a value of a table stands for: of tables, in lists and mappings, too, their objects."""
    return value


built.register(Part, lambda value: value.made())
built.register(list, lambda value: [built(part) for part in value])
built.register(dict, lambda value: {name: built(part) for name, part in value.items()})


def keys_of(
    of: Any, *, without: Collection[str] = (), only: Collection[str] = ()
) -> Callable[[Table], Table]:
    """Add the arguments of a class or function to a table as keys, with their types, defaults and meaning.

    The table's own declaration of a key takes precedence: another type, a default, a description, or an
    alias, which is then the key.

    `only`: arguments that are keys; all unless given.
    """

    def derive(table: Table) -> Table:
        hints, own = get_type_hints(of), table.__pydantic_fields__
        fields: dict[str, Any] = {}
        for name, argument in inspect.signature(of).parameters.items():
            if name not in without and (not only or name in only):
                words = meaning(of, name)
                fields[name] = _field(own.get(name), hints[name], argument, words, LIMITS.get(name))
        derived: Any = create_model(
            table.__name__, __base__=table, __doc__=table.__doc__, __module__=table.__module__, **fields
        )
        derived.of, derived.given = staticmethod(of), tuple(fields)
        return derived

    return derive


def table_of(of: Any, base: Any = Part, *, only: Collection[str] = (), **own: Any) -> Any:
    """Return a table with the arguments of a class or function as keys, and its summary; see `keys_of`.

    `own`: other types of keys, alone or with their `Field`. A text is the only value of a key; the first such
    text names the table.
    """
    name = next((value for value in own.values() if isinstance(value, str)), of.__name__)
    fields: dict[str, Any] = {
        key: value if isinstance(value, tuple) else (Literal[value] if isinstance(value, str) else value, ...)
        for key, value in own.items()
    }
    words = (of.__doc__ or "").partition("\n")[0]
    table = create_model(name, __base__=base, __doc__=words, __module__=base.__module__, **fields)
    return keys_of(of, only=only)(table)


def _field(
    own: FieldInfo | None, hint: Any, argument: inspect.Parameter, words: str, limit: FieldInfo | None
) -> tuple[Any, Any]:
    """Return type and field data of a key, the table's own if there are any."""
    default = ... if argument.default is argument.empty else argument.default
    matches = ((read, beside) for declared, read, beside in IN_FILES if declared == hint)
    kind, beside = next(matches, (hint, ""))
    words += beside
    if own is None:
        return Annotated[kind, limit] if limit else kind, Field(default, description=words)
    kind = Annotated[(own.annotation, *own.metadata)] if own.metadata else own.annotation
    default = default if own.is_required() else own.default
    return kind, Field(default, description=own.description or words, alias=own.alias)


def not_in_files(what: str) -> InvalidInputError:
    """Return an error about what cannot be written, which says what scene files have instead."""
    return InvalidInputError(f"a scene file has {what}: run the deck, or read it in Python")


def nodes_of(bodies: Mapping[str, Body], body: str, surface: str) -> np.ndarray:
    """Return the nodes of a surface, shape (n, dim)."""
    mesh = bodies[body].mesh
    return np.asarray(mesh.points[mesh.nodes_of(surface)])


def values_of(data: Any, key: str, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield what tables give under a key, with paths."""
    for place, part in parts_of(data, Part, path):
        if getattr(part, key, None) is not None:
            yield (*place, key), getattr(part, key)
