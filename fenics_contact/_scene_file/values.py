"""Types of values in a scene file: rows of numbers, formulas, file names; each with its requirement.

Formulas in x, y, z and t as text, evaluated at points; only arithmetic is accepted, no code is run.
"""

from __future__ import annotations

import ast
import math
import os
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce, singledispatch
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, get_args

import numpy as np
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

from fenics_contact._base.checks import MOST, run_file
from fenics_contact._scene.fields import OfPosition, read_field
from fenics_contact._scene_file.source import parts_of, shortened
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import scene_file_code

if TYPE_CHECKING:
    from mpi4py import MPI

#: Coordinates by name, in the order of the columns of points.
COORDINATES = ("x", "y", "z")
#: Time, which only values that load steps change may depend on.
TIME = "t"
CONSTANTS = {"pi": np.pi, "e": np.e}
FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    **{
        name: (getattr(np, name), 1)
        for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "sign")
    },
    "asin": (np.arcsin, 1),
    "acos": (np.arccos, 1),
    "atan": (np.arctan, 1),
    "abs": (np.abs, 1),
    "atan2": (np.arctan2, 2),
    "min": (np.minimum, 2),
    "max": (np.maximum, 2),
    "where": (np.where, 3),
}
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
_COMPARED: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}
#: Longest accepted formula, in characters: files may come from others.
LONGEST = 2000
#: Largest depth of nested operations, below Python's limit of recursion; those of a sum or a product, which
#: are evaluated from left to right, are not nested.
DEEPEST = 50
ALLOWED = (
    f"numbers, {', '.join(COORDINATES)}, {TIME}, {', '.join(CONSTANTS)}, + - * / **, comparisons with < <= > "
    f">=, and {', '.join(sorted(FUNCTIONS))}"
)


@dataclass(frozen=True)
class Expression:
    """A number at every point, given by a formula; equal to another if the texts are equal.

    Attributes:
        text: The formula, for instance ``"0.1 * (1 - x**2)"``; where(condition, a, b) chooses.
        time: Value of t in it, None without one.

    Example:
        >>> Expression("2 * x + y")(np.array([[1.0, 0.5]]))
        array([2.5])
    """

    text: str
    time: float | None = None

    def __post_init__(self) -> None:
        """Reject text that is not a formula."""
        _check(self._tree, self.text, 0)

    @cached_property
    def _tree(self) -> ast.expr:
        if len(self.text) > LONGEST:
            raise InvalidInputError(
                f"a formula must have at most {LONGEST} characters, got {len(self.text)}: write it in Python"
            )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's own, of what is refused in a moment
                if "#" in self.text:
                    raise ValueError("what follows # would be left out")
                return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise InvalidInputError(
                f"a formula must be like '0.1 * x**2', got {shortened(self.text)!r}: write {ALLOWED}"
            ) from error

    @property
    def names(self) -> frozenset[str]:
        """Coordinates that the formula depends on, and t."""
        used = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(used & {*COORDINATES, TIME})

    @property
    def changes(self) -> bool:
        """Whether it depends on t."""
        return TIME in self.names

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Evaluate at points.

        `points`: coordinates, shape (n, dim), [length].

        Returns one number per point, shape (n,).
        """
        values = {name: points[:, axis] for axis, name in enumerate(COORDINATES[: points.shape[1]])}
        if self.changes and self.time is None:
            raise InvalidInputError(
                f"the formula {shortened(self.text)!r} depends on the time t, which only loads and supports "
                "of a file with [[steps]] have, and heat of one with [heat.time]: add these, or leave t out"
            )
        missing = self.names - {*values, TIME}
        if missing:
            raise InvalidInputError(
                f"the formula {shortened(self.text)!r} depends on {', '.join(sorted(missing))}, but the "
                "bodies lie in the plane: use x and y"
            )
        with np.errstate(all="ignore"):
            result = np.asarray(
                _value(self._tree, {**CONSTANTS, TIME: self.time, **values}), dtype=np.float64
            )
        result = np.broadcast_to(result, (len(points),)).copy()
        infinite = np.flatnonzero(~np.isfinite(result))
        if infinite.size:
            place = ", ".join(f"{x:.6g}" for x in points[infinite[0]])
            raise InvalidInputError(
                f"the formula {shortened(self.text)!r} must have a finite value at every node, got "
                f"{result[infinite[0]]} at ({place}): choose another one there with where(condition, a, b)"
            )
        return result


@dataclass(frozen=True)
class VectorExpression:
    """A vector at every point, a number or a formula for each component.

    Attributes:
        components: Numbers, formulas and other functions of position.
    """

    components: tuple[float | OfPosition, ...]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Evaluate at points, shape (n, dim) -> (n, dim)."""
        columns = [part(points) if callable(part) else np.full(len(points), part) for part in self.components]
        return np.column_stack(columns)


@dataclass(frozen=True)
class Between:
    """A value on the way from one to another, each a number or a function of position."""

    start: float | OfPosition
    end: float | OfPosition
    share: float

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Evaluate at points, shape (n, dim) -> (n,), (n, dim) for vectors."""
        start, end = (part(points) if callable(part) else part for part in (self.start, self.end))
        return np.asarray((1.0 - self.share) * start + self.share * end)


def between(start: float | OfPosition, end: float | OfPosition, share: float) -> float | OfPosition:
    """Return the value between ``start`` (share 0) and ``end`` (share 1), number or function."""
    if share == 1.0:
        return end
    if callable(start) or callable(end):
        return Between(start, end, share)
    return start + share * (end - start)


def formulas(value: Any) -> list[Expression]:
    """Return the formulas of a value, those of its entries if it has any."""
    return [part for _, part in parts_of(value, Expression)]


def changes(value: Any) -> bool:
    """Return whether a value, or an entry of it, depends on t."""
    return any(part.changes for part in formulas(value))


@singledispatch
def at_time(value: Any, time: float) -> Any:
    """Return a value, or all entries of one, at a time."""
    return value


at_time.register(Expression, lambda value, time: replace(value, time=time) if value.changes else value)
at_time.register(tuple, lambda value, time: tuple(at_time(part, time) for part in value))


@singledispatch
def at_point(value: Any, point: Sequence[float] | np.ndarray) -> Any:
    """Return a number, that of a formula at a point; None if it is None."""
    return value


at_point.register(Expression, lambda value, point: float(value(np.array([point]))[0]))


def is_finite(value: float) -> bool:
    """Return whether a number is finite; False for an integer that exceeds a float."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _check(node: ast.expr, text: str, depth: int) -> None:
    operations, first = _from_left(node)
    for operation in (*operations, first):
        if depth > DEEPEST or not _known(operation):
            part = ast.get_source_segment(text.strip(), operation) or text
            if depth > DEEPEST:
                part = f"more than {DEEPEST} nested operations"
            raise InvalidInputError(
                f"a formula may hold {ALLOWED}, got {shortened(part)!r} in {shortened(text)!r}: leave it out"
            )
        for operand in _operands(operation):
            _check(operand, text, depth + 1)


def _from_left(node: ast.expr) -> tuple[list[ast.BinOp], ast.expr]:
    """Return the operations of a - b + c - ..., each the left operand of the one before, and its first."""
    operations = []
    while isinstance(node, ast.BinOp):
        operations.append(node)
        node = node.left
    return operations, node


def _operands(node: ast.expr) -> list[ast.expr]:
    """Return the operands of a known operation without a left one that `_from_left` returns."""
    match node:
        case ast.UnaryOp(operand=operand) | ast.BinOp(right=operand):
            return [operand]
        case ast.Compare(left=left, comparators=comparators):
            return [left, *comparators]
        case ast.Call(args=arguments):
            return arguments
    return []


def _known(node: ast.expr) -> bool:
    match node:
        case ast.Constant(value=bool()):
            return False
        case ast.Constant(value=int() | float() as value):
            return is_finite(value)
        case ast.Name(id=name):
            return name in {*COORDINATES, TIME, *CONSTANTS}
        case ast.UnaryOp(op=ast.UAdd() | ast.USub()):
            return True
        case ast.BinOp(op=operator):
            return type(operator) in _BINARY
        case ast.Compare(ops=[operator]):
            return type(operator) in _COMPARED
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return name in FUNCTIONS and FUNCTIONS[name][1] == len(arguments)
    return False


def _value(node: ast.expr, names: dict[str, Any]) -> Any:
    """Evaluate a checked formula."""
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, names)
        case ast.UnaryOp(operand=operand):
            return _value(operand, names)
        case ast.BinOp():
            operations, first = _from_left(node)
            result = _value(first, names)
            for operation in reversed(operations):
                result = _BINARY[type(operation.op)](result, _value(operation.right, names))
            return result
        case ast.Compare(left=left, ops=[comparison], comparators=[right]):
            return _COMPARED[type(comparison)](_value(left, names), _value(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name][0](*(_value(argument, names) for argument in arguments))
    raise AssertionError(ast.dump(node))


_NOTHING = object()


def is_reference(text: object) -> bool:
    """Return whether a text has the form "file.py:Name"."""
    file, colon, name = text.rpartition(":") if isinstance(text, str) else ("", "", "")
    return bool(colon) and file.endswith(".py") and name.isidentifier()


def load(reference: str, folder: Path) -> Any:
    """Return the object of a name in a Python file; the file is run."""
    file, _, name = reference.rpartition(":")
    path = folder / file
    module = run_file(path)
    with scene_file_code(f"the Python file '{path}'"):
        loaded = getattr(module, name, _NOTHING)
    if loaded is _NOTHING:
        known = sorted(
            key for key, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__
        )
        raise InvalidInputError(f"'{path}' must define {name!r}, it defines {known}: use one of them")
    return loaded


#: Value of a free component of a support.
FREE = "free"
#: Separates the key and its possible values in the message of an error of kind "choice".
SEPARATOR = "|"
#: Prefix of tags that pydantic adds to the path of an error: it does not occur in files.
MARK = "\0"
#: Longest name of a file on Linux, in bytes.
LONGEST_NAME = 255
#: Longest path there, in bytes, with room below its 4096.
LONGEST_PATH = 4000


def either(kind: type, this: Any, other: Any) -> Any:
    """Read values of a Python type as one annotation, all others as another."""
    tag = Discriminator(lambda value: f"{MARK}this" if isinstance(value, kind) else f"{MARK}other")
    return Annotated[Annotated[this, Tag(f"{MARK}this")] | Annotated[other, Tag(f"{MARK}other")], tag]


@dataclass(frozen=True, eq=False)
class Read:
    """Lets pydantic use another annotation for a key than type checkers."""

    annotation: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Return the schema of the annotation."""
        return handler.generate_schema(self.annotation)


def needed_error(needed: str) -> PydanticCustomError:
    """Return the error of a value that is not what is ``needed``."""
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
    when: Callable[[Any], bool] = lambda table: False,
    called: str = "",
) -> Read:
    """Discriminate tables by the value of one key."""
    kinds = {kind: table for table in tables for kind in get_args(table.model_fields[key].annotation)}

    def tag(value: Any) -> str | None:
        if not isinstance(value, Mapping):
            return None
        if when(value):
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


class OfFile(ABC):
    """A value that is read from a file, once for all tables that name it alike."""

    @property
    @abstractmethod
    def key(self) -> tuple[Any, ...]:
        """What is read."""

    @abstractmethod
    def read(self, folder: Path, comm: MPI.Comm) -> Any:
        """Return it, read on rank 0. Collective."""

    def taking(self, read: Any) -> Any:
        """Return the value with what was read."""
        return read


class FieldFile(OfFile, BaseModel):
    """A field from a file: values at points, or on the nodes or cells of a mesh."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
    file: PlaceOfFile = Field(description="the file, relative to the folder of the scene file")
    field: str | list[str] | None = Field(
        None, description="name of its column or field, several for a vector; needed if it has others"
    )

    @property
    def key(self) -> tuple[Any, ...]:
        """File and names."""
        return self.file, repr(self.field)

    def read(self, folder: Path, comm: MPI.Comm) -> Any:
        """Return the field, read on rank 0. Collective."""
        return read_field(folder / self.file, self.field, comm=comm)


_COUNT = Annotated[int, Field(ge=1, le=MOST)]
_AXES = "in brackets, for x, y and z (two for a plane body)"
_COUNTS = f"integers from 1 to {MOST} in brackets"

Pair: TypeAlias = Annotated[tuple[float, float], _row(float, 2, 2, "two finite numbers in brackets")]
Triple: TypeAlias = Annotated[
    tuple[float, float, float], _row(float, 3, 3, "three finite numbers in brackets")
]
Vector: TypeAlias = Annotated[tuple[float, ...], _row(float, 2, 3, "two or three finite numbers in brackets")]
Pairs: TypeAlias = Annotated[
    tuple[tuple[float, float], ...],
    _row(Pair, 0, None, "pairs of finite numbers in brackets, such as [[0.02, 290.0], [0.1, 340.0]]"),
]
Numbers: TypeAlias = Annotated[tuple[float, ...], _row(float, 1, None, "finite numbers in brackets")]
Six: TypeAlias = Annotated[tuple[float, ...], _row(float, 6, 6, "six finite numbers in brackets")]
#: A matrix of six rows and columns.
SixBySix: TypeAlias = Annotated[
    tuple[Six, ...], _row(Six, 6, 6, "six rows of six finite numbers, each in brackets, all in brackets")
]
#: A number, or pairs of a temperature and the value there.
NumberOrPairs: TypeAlias = Annotated[Any, Read(either(list, Pairs, float))]
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
OF_SCALAR = with_message("a finite number, or a formula in x, y and z in quotes")
#: A number or a formula in x, y, z; a formula becomes an `Expression`, a free component None.
Scalar: TypeAlias = Annotated[float | Formula, OF_SCALAR]
#: A number, a formula or a field from a file.
ScalarField: TypeAlias = Annotated[
    float | Formula | FieldFile, with_message(f"a finite number, a formula in x, y and z in quotes, {_FIELD}")
]
#: The same for what cannot be negative.
NotNegativeField: TypeAlias = Annotated[
    Annotated[float, Field(ge=0)] | Formula | FieldFile,
    with_message(f"a number of at least 0, a formula in x, y and z in quotes, {_FIELD}"),
]


def field_or(table: Any, keys: str) -> Any:
    """Return the type of such a field or of a table, whose keys errors show."""
    kinds = Annotated[float, Field(ge=0)] | Formula | FieldFile | table
    words = f"a number of at least 0, a formula in x, y and z in quotes, {_FIELD}, or {keys}"
    return Annotated[kinds, with_message(words)]


FieldOrMeasured: TypeAlias = Annotated[
    Literal["measured"] | Annotated[float, Field(ge=0)] | Formula | FieldFile,
    with_message(f"'measured', a number of at least 0, a formula in x, y and z in quotes, {_FIELD}"),
]
_OF_STRESS = f"six numbers or formulas in brackets, xx, yy, zz, yz, xz, xy, {_FIELD}"
StressOrFormulas: TypeAlias = Annotated[
    Any,
    Read(
        Annotated[
            _row(float | Formula | FieldFile, 6, 6, _OF_STRESS).annotation | FieldFile,
            with_message(_OF_STRESS),
        ]
    ),
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
_STEP = f"numbers, formulas or '{FREE}' in brackets, as many as the support's own value has"
StepComponents: TypeAlias = Annotated[
    Any,
    Read(
        Annotated[
            float | Formula | FieldFile | _row(float | _FREE | Formula | FieldFile, 2, 12, _STEP).annotation,
            with_message(_STEP),
        ]
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
