"""Formulas in x, y, z and t as text, evaluated at points; only arithmetic is accepted, no code is run."""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import OfPosition
from fenics_contact.scene_file.places import shortened

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
#: Longest accepted formula, and largest depth of nested operations; those of a sum or a product, which are
#: evaluated from left to right, are not nested.
LONGEST, DEEPEST = 2000, 50
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

    Raises:
        InvalidInputError: If the text contains anything but arithmetic.

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
                f"a formula must have at most {LONGEST} characters, got {len(self.text)}: "
                "write a Python function and a scene in Python for it"
            )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's own, of what is refused in a moment
                if "#" in self.text:
                    raise ValueError("what follows # would be left out")
                return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise InvalidInputError(
                "a formula must be arithmetic such as '0.1 * x**2', got "
                f"{shortened(self.text)!r}: write {ALLOWED}"
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

        Args:
            points: Coordinates, shape (n, dim), [length].

        Returns:
            One number per point, shape (n,).

        Raises:
            InvalidInputError: If the formula depends on z and the points lie in the plane, on t and there is
                no time, or has no finite value somewhere.
        """
        values = {name: points[:, axis] for axis, name in enumerate(COORDINATES[: points.shape[1]])}
        if self.changes and self.time is None:
            raise InvalidInputError(
                f"the formula {shortened(self.text)!r} depends on the time t, which only loads and supports "
                "of a file with [[steps]] have: add steps, or leave t out"
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
                f"{result[infinite[0]]} at ({place}): choose another one there with where(condition, a, b), "
                "each of whose values may be infinite where the other is taken"
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
    """A value on the way from one to another, each a number or a function of position.

    Attributes:
        start: The one.
        end: The other.
        share: Part of the way.
    """

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


def changes(value: Any) -> bool:
    """Return whether a value, or an entry of it, depends on t."""
    parts = value if isinstance(value, tuple) else (value,)
    return any(isinstance(part, Expression) and part.changes for part in parts)


def at_time(value: Any, time: float) -> Any:
    """Return a value, or all entries of one, at a time."""
    if isinstance(value, tuple):
        return tuple(at_time(part, time) for part in value)
    return replace(value, time=time) if isinstance(value, Expression) and value.changes else value


def is_finite(value: float) -> bool:
    """Return whether a number is finite; False for an integer that exceeds a float."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _check(node: ast.expr, text: str, depth: int) -> None:
    for operation in _from_left(node):
        if depth > DEEPEST or not _known(operation):
            part = ast.get_source_segment(text.strip(), operation) or text
            if depth > DEEPEST:
                part = f"more than {DEEPEST} nested operations"
            raise InvalidInputError(
                f"a formula may hold {ALLOWED}, got {shortened(part)!r} in {shortened(text)!r}: leave it "
                "out, or give the value by a scene in Python"
            )
        left = operation.left if isinstance(operation, ast.BinOp) else None
        for child in ast.iter_child_nodes(operation):
            name = isinstance(operation, ast.Call) and child is operation.func
            if isinstance(child, ast.expr) and child is not left and not name:
                _check(child, text, depth + 1)


def _from_left(node: ast.expr) -> list[ast.expr]:
    """Return the operations of a - b + c - ..., each of which is the left operand of the one before."""
    operations = [node]
    while isinstance(operations[-1], ast.BinOp):
        operations.append(operations[-1].left)
    return operations


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
            *operations, first = _from_left(node)
            result = _value(first, names)
            for operation in reversed(operations):
                assert isinstance(operation, ast.BinOp)
                result = _BINARY[type(operation.op)](result, _value(operation.right, names))
            return result
        case ast.Compare(left=left, ops=[comparison], comparators=[right]):
            return _COMPARED[type(comparison)](_value(left, names), _value(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name][0](*(_value(argument, names) for argument in arguments))
    raise AssertionError(ast.dump(node))
