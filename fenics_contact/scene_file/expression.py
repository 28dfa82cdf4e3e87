"""Formulas in x, y, z as text, evaluated at points; nothing but arithmetic is understood, nothing is run."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fenics_contact.errors import InvalidInputError

#: Coordinates by name, in the order of the columns of points.
COORDINATES = ("x", "y", "z")
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
#: Longest formula that is read, and deepest nesting.
LONGEST, DEEPEST = 2000, 50
ALLOWED = (
    f"numbers, {', '.join(COORDINATES)}, {', '.join(CONSTANTS)}, + - * / **, comparisons with < <= > >=, and "
    f"{', '.join(sorted(FUNCTIONS))}"
)


@dataclass(frozen=True)
class Expression:
    """A number at every point, given by a formula: a value that compares equal where the text does.

    Attributes:
        text: The formula, for instance ``"0.1 * (1 - x**2)"``; where(condition, a, b) chooses.

    Raises:
        InvalidInputError: If the text holds anything but arithmetic.

    Example:
        >>> Expression("2 * x + y")(np.array([[1.0, 0.5]]))
        array([2.5])
    """

    text: str

    def __post_init__(self) -> None:
        """Refuse what is no formula."""
        _check(self._tree, self.text, 0)

    @cached_property
    def _tree(self) -> ast.expr:
        if len(self.text) > LONGEST:
            raise InvalidInputError(
                f"a formula must have at most {LONGEST} characters, got {len(self.text)}: "
                "write a Python function and a scene in Python for it"
            )
        try:
            return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise InvalidInputError(
                f"a formula must be arithmetic such as '0.1 * x**2', got {self.text!r}: write {ALLOWED}"
            ) from error

    @property
    def names(self) -> frozenset[str]:
        """Coordinates that the formula depends on."""
        found = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(found & set(COORDINATES))

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Evaluate at points.

        Args:
            points: Coordinates, shape (n, dim), [length].

        Returns:
            A number for each, shape (n,).

        Raises:
            InvalidInputError: If the formula depends on z and the points lie in the plane.
        """
        values = {name: points[:, axis] for axis, name in enumerate(COORDINATES[: points.shape[1]])}
        missing = self.names - set(values)
        if missing:
            raise InvalidInputError(
                f"the formula {self.text!r} depends on {', '.join(sorted(missing))}, but the bodies lie in "
                "the plane: use x and y"
            )
        with np.errstate(all="ignore"):  # whoever uses the values refuses those that are not finite
            found = _value(self._tree, {**CONSTANTS, **values})
        return np.broadcast_to(np.asarray(found, dtype=np.float64), (len(points),)).copy()


@dataclass(frozen=True)
class VectorExpression:
    """A vector at every point, a number or a formula for each component.

    Attributes:
        components: Numbers and formulas.
    """

    components: tuple[float | Expression, ...]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Evaluate at points, shape (n, dim) -> (n, dim)."""
        columns = [
            part(points) if isinstance(part, Expression) else np.full(len(points), part)
            for part in self.components
        ]
        return np.column_stack(columns)


def between(start: float | str, end: float | str, share: float) -> float | str:
    """Return the value on the way from ``start`` (share 0) to ``end`` (share 1), number or formula."""
    if isinstance(start, str) or isinstance(end, str):
        return end if share == 1.0 else f"(1 - {share!r}) * ({start}) + {share!r} * ({end})"
    return end if share == 1.0 else start + share * (end - start)


def _check(node: ast.expr, text: str, depth: int) -> None:
    if depth > DEEPEST or not _known(node):
        part = ast.unparse(node) if depth <= DEEPEST else "deeply nested brackets"
        raise InvalidInputError(
            f"a formula may hold {ALLOWED}, got {part!r} in {text!r}: leave it out, or give the value by a "
            "scene in Python"
        )
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr) and not (isinstance(node, ast.Call) and child is node.func):
            _check(child, text, depth + 1)


def _known(node: ast.expr) -> bool:
    match node:
        case ast.Constant(value=bool()):
            return False
        case ast.Constant(value=int() | float()):
            return True
        case ast.Name(id=name):
            return name in COORDINATES or name in CONSTANTS
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
        case ast.BinOp(left=left, op=operator, right=right):
            return _BINARY[type(operator)](_value(left, names), _value(right, names))
        case ast.Compare(left=left, ops=[comparison], comparators=[right]):
            return _COMPARED[type(comparison)](_value(left, names), _value(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name][0](*(_value(argument, names) for argument in arguments))
    raise AssertionError(ast.dump(node))
