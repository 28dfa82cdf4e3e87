"""What the parts of a scene file have in common: unknown keys are mistakes, and values say what they need."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, ConfigDict, Discriminator, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry.arguments import MOST
from fenics_contact.scene_file.expression import Expression, is_finite

#: What a support's component is called that it leaves alone.
FREE = "free"
#: Stands in the message of an error of kind "choice" between the key and the values that it may have.
SEPARATOR = "|"
#: What Linux allows, in bytes.
LONGEST_NAME, LONGEST_PATH = 255, 4000
_COUNTS = {2: "two", 3: "three"}


class Part(BaseModel):
    """A table of a scene file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def needs(needed: str) -> PydanticCustomError:
    """Return the error of a value that is not what is ``needed``."""
    return PydanticCustomError("needed", "must be {needed}", {"needed": needed})


def kind_of(key: str, allowed: tuple[str, ...], default: str | None = None) -> Discriminator:
    """Tell tables apart by the value of one key; tags are the values in angle brackets.

    Args:
        key: The key.
        allowed: Its values.
        default: The value where the key is missing.
    """

    def tag(value: Any) -> str | None:
        if not isinstance(value, Mapping):
            return None if not isinstance(value, BaseModel) else f"<{getattr(value, key)}>"
        kind = value.get(key, default)
        return f"<{kind}>" if kind in allowed else None

    return chooser(tag, key, allowed)


def chooser(tag: Callable[[Any], str | None], key: str, allowed: tuple[str, ...]) -> Discriminator:
    """Tell tables apart by a function that returns a tag, or None for what is not ``allowed``."""
    return Discriminator(
        tag,
        custom_error_type="choice",
        custom_error_message=SEPARATOR.join([key, *allowed]),  # a context would make the type unhashable
    )


def is_number(value: object) -> bool:
    """Tell whether a value is a finite number, which true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool) and is_finite(value)


def _line(value: Any) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise needs("one line of text in quotes")
    return value


def _place_of_file(value: Any) -> str:
    """Check a path as far as that can be without looking whether it is there."""
    if not isinstance(value, str) or not value.strip():
        raise needs("the path of a file or folder, in quotes")
    longest = max(len(os.fsencode(part)) for part in value.split("/"))
    if longest > LONGEST_NAME or len(os.fsencode(value)) > LONGEST_PATH:
        raise needs(
            f"a path of at most {LONGEST_PATH} bytes in which no name has more than {LONGEST_NAME} bytes"
        )
    return value


def _numbers(*counts: int) -> Callable[[Any], tuple[float, ...]]:
    said = " or ".join(_COUNTS[count] for count in counts)

    def validate(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or len(value) not in counts or not all(map(is_number, value)):
            raise needs(f"{said} finite numbers in brackets")
        return tuple(float(entry) for entry in value)

    return validate


def _integers(*counts: int) -> Callable[[Any], tuple[int, ...]]:
    said = " or ".join(_COUNTS[count] for count in counts)

    def validate(value: Any) -> tuple[int, ...]:
        whole = isinstance(value, list | tuple) and all(
            isinstance(entry, int) and not isinstance(entry, bool) and entry > 0 for entry in value
        )
        if not whole or len(value) not in counts:
            raise needs(f"{said} positive integers in brackets")
        if max(value) > MOST:
            raise needs(f"{said} integers of at most {MOST} in brackets")
        return tuple(value)

    return validate


def _array(kind: Mapping[str, Any], *counts: int) -> WithJsonSchema:
    return WithJsonSchema(
        {"type": "array", "items": dict(kind), "minItems": min(counts), "maxItems": max(counts)}
    )


_NUMBER, _TEXT = {"type": "number"}, {"type": "string"}
_NUMBER_OR_FORMULA = {"anyOf": [{"type": "number"}, {"type": "string"}]}
_COUNT = {"type": "integer", "minimum": 1, "maximum": MOST}

Line: TypeAlias = Annotated[str, PlainValidator(_line), WithJsonSchema(_TEXT)]
PlaceOfFile: TypeAlias = Annotated[str, PlainValidator(_place_of_file), WithJsonSchema(_TEXT)]
Pair: TypeAlias = Annotated[tuple[float, float], PlainValidator(_numbers(2)), _array(_NUMBER, 2)]
Triple: TypeAlias = Annotated[tuple[float, float, float], PlainValidator(_numbers(3)), _array(_NUMBER, 3)]
Vector: TypeAlias = Annotated[tuple[float, ...], PlainValidator(_numbers(2, 3)), _array(_NUMBER, 2, 3)]
CountPair: TypeAlias = Annotated[tuple[int, int], PlainValidator(_integers(2)), _array(_COUNT, 2)]
CountTriple: TypeAlias = Annotated[tuple[int, int, int], PlainValidator(_integers(3)), _array(_COUNT, 3)]
Counts: TypeAlias = Annotated[tuple[int, ...], PlainValidator(_integers(2, 3)), _array(_COUNT, 2, 3)]


def _scalar(value: Any) -> float | str:
    """Check a number or a formula."""
    if isinstance(value, str):
        return formula(value)
    if not is_number(value):
        raise needs("a finite number, or a formula in x, y and z in quotes")
    return float(value)


def _vector(value: Any) -> tuple[float | str, ...]:
    """Check two or three numbers or formulas."""
    if not isinstance(value, list | tuple) or len(value) not in _COUNTS:
        raise needs("three numbers or formulas in brackets, for x, y and z (two for a plane body)")
    return tuple(_scalar(entry) for entry in value)


def _components(value: Any) -> tuple[float | str, ...]:
    """Check what a support prescribes."""
    if not isinstance(value, list | tuple) or len(value) not in _COUNTS:
        raise needs(f"three numbers, formulas or '{FREE}' in brackets, for x, y and z (two for a plane body)")
    return tuple(FREE if entry == FREE else _scalar(entry) for entry in value)


def formula(text: str) -> str:
    """Check a formula."""
    try:
        Expression(text)
    except InvalidInputError as error:
        raise PydanticCustomError("sentence", "{sentence}", {"sentence": str(error)}) from error
    return text


Scalar: TypeAlias = Annotated[float | str, PlainValidator(_scalar), WithJsonSchema(_NUMBER_OR_FORMULA)]
VectorOrFormulas: TypeAlias = Annotated[
    tuple[float | str, ...], PlainValidator(_vector), _array(_NUMBER_OR_FORMULA, 2, 3)
]
Components: TypeAlias = Annotated[
    tuple[float | str, ...], PlainValidator(_components), _array(_NUMBER_OR_FORMULA, 2, 3)
]
