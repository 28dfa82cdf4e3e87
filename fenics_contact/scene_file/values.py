"""Types of values in a scene file: rows of numbers, formulas, file names; each with its requirement."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    Tag,
    WrapValidator,
)
from pydantic_core import PydanticCustomError, ValidationError

from fenics_contact.checks import MOST
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene_file.expression import Expression

#: Value of a free component of a support.
FREE = "free"
#: Separates the key and its possible values in the message of an error of kind "choice".
SEPARATOR = "|"
#: Prefix of tags that pydantic adds to the path of an error: it does not occur in files.
MARK = "\0"
#: Limits of Linux, in bytes.
LONGEST_NAME, LONGEST_PATH = 255, 4000


@dataclass(frozen=True, eq=False)
class Read:
    """Lets pydantic use another annotation for a key than type checkers.

    Attributes:
        annotation: The annotation for pydantic.
    """

    annotation: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Return the schema of the annotation."""
        return handler.generate_schema(self.annotation)


def needed_error(needed: str) -> PydanticCustomError:
    """Return the error of a value that does not meet ``needed``."""
    return PydanticCustomError("needed", "must be {needed}", {"needed": needed})


def with_message(needed: str) -> WrapValidator:
    """Report what is ``needed`` for a rejected value, unless a formula in it has its own message."""

    def check(value: Any, handler: Callable[[Any], Any]) -> Any:
        try:
            return handler(value)
        except ValidationError as error:
            contexts = (each["ctx"] for each in error.errors() if each["type"] == "sentence")
            sentence = next(contexts, None)
            raise (
                PydanticCustomError("sentence", "{sentence}", sentence) if sentence else needed_error(needed)
            )

    return WrapValidator(check)


def one_of(
    key: str,
    *tables: Any,
    default: str = "",
    other: Any = None,
    when: Callable[[Any], bool] | None = None,
    called: str = "",
) -> Read:
    """Discriminate tables by the value of one key.

    Args:
        key: The key, a `Literal` of every table.
        *tables: The tables.
        default: Its value where the key is missing.
        other: Table without such a key.
        when: Returns from the data whether they are that table.
        called: Name of the key's value in that table for messages.
    """
    kinds = {kind: table for table in tables for kind in get_args(table.model_fields[key].annotation)}

    def tag(value: Any) -> str | None:
        if not isinstance(value, Mapping):
            return None
        if when is not None and when(value):
            return MARK
        kind = value.get(key, default)
        return f"{MARK}{kind}" if isinstance(kind, str) and kind in kinds else None

    tagged = [Annotated[table, Tag(f"{MARK}{kind}")] for kind, table in kinds.items()]
    tagged += [] if other is None else [Annotated[other, Tag(MARK)]]
    message = SEPARATOR.join(filter(None, [key, *kinds, called]))  # a context would make the type unhashable
    choice = Discriminator(tag, custom_error_type="choice", custom_error_message=message)
    return Read(Annotated[reduce(or_, tagged), choice])


def _row(kind: Any, least: int, most: int | None, needed: str) -> Read:
    """Read a list with a given number of entries as a tuple."""
    length = Field(min_length=least, max_length=most, strict=False)
    return Read(Annotated[list[kind], length, AfterValidator(tuple), with_message(needed)])


def _formula(text: str) -> Expression:
    try:
        return Expression(text)
    except InvalidInputError as error:
        raise PydanticCustomError("sentence", "{sentence}", {"sentence": str(error)}) from error


def _place_of_file(value: str) -> str:
    """Check a path without testing whether it exists."""
    if not value.strip():
        raise needed_error("the path of a file or folder, in quotes")
    longest = max(len(os.fsencode(part)) for part in value.split("/"))
    if longest > LONGEST_NAME or len(os.fsencode(value)) > LONGEST_PATH:
        raise needed_error(
            f"a path of at most {LONGEST_PATH} bytes in which no name has more than {LONGEST_NAME} bytes"
        )
    return value


PlaceOfFile: TypeAlias = Annotated[str, AfterValidator(_place_of_file)]


class FieldFile(BaseModel):
    """A field from a file: values at points, or on the nodes or cells of a mesh."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
    file: PlaceOfFile = Field(description="the file, relative to the folder of the scene file")
    field: str | list[str] | None = Field(
        None, description="name of its column or field, several for a vector; needed if it has others"
    )


_COUNT = Annotated[int, Field(ge=1, le=MOST)]
_AXES = "in brackets, for x, y and z (two for a plane body)"
_COUNTS = f"integers from 1 to {MOST} in brackets"

Pair: TypeAlias = Annotated[tuple[float, float], _row(float, 2, 2, "two finite numbers in brackets")]
Triple: TypeAlias = Annotated[
    tuple[float, float, float], _row(float, 3, 3, "three finite numbers in brackets")
]
Vector: TypeAlias = Annotated[tuple[float, ...], _row(float, 2, 3, "two or three finite numbers in brackets")]
CountPair: TypeAlias = Annotated[tuple[int, int], _row(_COUNT, 2, 2, f"two {_COUNTS}")]
#: Number of control points along a curve, or along both directions of a surface.
Net: TypeAlias = Annotated[
    _COUNT | CountPair,
    with_message(f"an integer from 1 to {MOST} for a curve, or two in brackets for a surface"),
]
CountTriple: TypeAlias = Annotated[tuple[int, int, int], _row(_COUNT, 3, 3, f"three {_COUNTS}")]
Names: TypeAlias = Annotated[tuple[str, ...], _row(str, 0, None, "names in quotes, in brackets")]
Row: TypeAlias = Annotated[
    tuple[float, ...], _row(float, 1, None, "finite numbers in brackets, one for each design variable")
]

Formula: TypeAlias = Annotated[Any, Read(Annotated[str, AfterValidator(_formula)])]
_FIELD = "or a table {file = ..., field = ...}"
#: A number or a formula in x, y, z; a formula becomes an `Expression`, a free component None.
Scalar: TypeAlias = Annotated[
    float | Formula, with_message("a finite number, or a formula in x, y and z in quotes")
]
#: A number, a formula or a field from a file.
ScalarField: TypeAlias = Annotated[
    float | Formula | FieldFile, with_message(f"a finite number, a formula in x, y and z in quotes, {_FIELD}")
]
#: The same for what cannot be negative.
NotNegativeField: TypeAlias = Annotated[
    Annotated[float, Field(ge=0)] | Formula | FieldFile,
    with_message(f"a number of at least 0, a formula in x, y and z in quotes, {_FIELD}"),
]
FieldOrMeasured: TypeAlias = Annotated[
    Literal["measured"] | Annotated[float, Field(ge=0)] | Formula | FieldFile,
    with_message(f"'measured', a number of at least 0, a formula in x, y and z in quotes, {_FIELD}"),
]
_FREE = Annotated[Literal["free"], AfterValidator(lambda _: None)]
_OF_LOAD = f"three numbers or formulas {_AXES}, {_FIELD}"
VectorOrFormulas: TypeAlias = Annotated[
    Any,
    Read(
        Annotated[
            _row(float | Formula | FieldFile, 2, 3, _OF_LOAD).annotation | FieldFile, with_message(_OF_LOAD)
        ]
    ),
]
_HELD = f"three numbers, formulas or '{FREE}' {_AXES}, or tables {{file = ..., field = ...}} among them"
Components: TypeAlias = Annotated[Any, _row(float | _FREE | Formula | FieldFile, 2, 3, _HELD)]
StepComponents: TypeAlias = Annotated[
    Any,
    _row(
        float | _FREE | Formula | FieldFile, 2, 6,
        f"numbers, formulas or '{FREE}' in brackets, as many as the support's own value has",
    ),
]  # fmt: skip
Motion: TypeAlias = Annotated[
    Any,
    _row(
        float | _FREE | Formula, 3, 6,
        f"six numbers, formulas in t or '{FREE}' in brackets: displacement along x, y and z, rotation about "
        "them (in the plane three: along x and y, rotation)",
    ),
]  # fmt: skip
_LOAD = with_message(
    f"a number or a formula, or two or three of them in brackets, {_FIELD}, like the load's own value"
)
LoadValue: TypeAlias = Annotated[Any, Read(Annotated[float | Formula | VectorOrFormulas | FieldFile, _LOAD])]
Line: TypeAlias = Annotated[str, Field(pattern=r"^[^\n\r]*$"), with_message("one line of text in quotes")]
