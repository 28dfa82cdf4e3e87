"""The numeric constants of the package's modules, read from their text."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from benchmarks.study import ROOT

PACKAGE = ROOT / "fenics_contact"
#: A number, several, or several by some key.
Value: TypeAlias = float | tuple[float, ...] | dict[Any, float]

#: Rooms whose constants are not run, as no answer is computed there, and what they are about.
NOT_RUN = {
    "__main__": "command line",
    "_base.checkpoint": "format",
    "_base.display": "lines and columns on a screen",
    "_base.files": "format",
    "_base.fingerprint": "words of messages",
    "_base.progress": "progress",
    "_cli": "command line",
    "_dolfinx": "cell types",
    "_scene_file": "format",
    "errors": "ranks that wait for each other",
    "gallery": "meshes of examples",
    "output": "format",
    "pictures": "layout",
    "study": "scenes and tables of studies",
    "theory": "exact solutions",
}


@dataclass(frozen=True)
class Constant:
    """A constant of a module.

    Attributes:
        module: Its module within the package, "qp.face".
        name: Its name there.
        value: Its value.
        meaning: First sentence of the comment on it, empty without one.
    """

    module: str
    name: str
    value: Value
    meaning: str

    @property
    def key(self) -> str:
        """Module and name, "qp.face:STEEP"."""
        return f"{self.module}:{self.name}"

    @property
    def room(self) -> str:
        """The part of the package that it belongs to; of the ground each module is one."""
        first, _, _ = self.module.partition(".")
        return self.module if first == "_base" else first


@cache
def constants() -> tuple[Constant, ...]:
    """Return all constants that are written as numbers, tuples of numbers or mappings to numbers."""
    return tuple(found for path in sorted(PACKAGE.rglob("*.py")) for found in _of_module(path))


def module_of(path: Path) -> str:
    """Return the module of a file of the package, "qp.face"; that of a folder is in its ``__init__.py``."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def scaled(value: Value, factor: float) -> Value:
    """Return a value times a factor: whole numbers stay whole and change, and none becomes 0.

    A 1 cannot be halved: it stays what it is.
    """
    if isinstance(value, tuple):
        return tuple(_scaled(each, factor) for each in value)
    if isinstance(value, dict):
        return {key: _scaled(each, factor) for key, each in value.items()}
    return _scaled(value, factor)


def _scaled(number: float, factor: float) -> float:
    if not isinstance(number, int):
        return factor * number
    if factor < 1.0:
        return min(number, max(1, round(factor * number)))
    return max(number + 1, round(factor * number))


def _of_module(path: Path) -> Iterator[Constant]:
    """Return the constants of a module in their order."""
    text = path.read_text(encoding="utf-8")
    lines, known = text.splitlines(), dict[str, Any]()
    body = ast.parse(text).body
    for statement, after in zip(body, [*body[1:], None], strict=True):
        for name, expression in _assigned(statement):
            try:
                value = eval(compile(ast.Expression(expression), str(path), "eval"), {"np": np, **known})
            except Exception:  # no number: a class, a table, something of another module
                continue
            if (number := _number(value)) is not None:
                known[name] = number
                yield Constant(module_of(path), name, number, _meaning(lines, statement, after))


def _assigned(statement: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """Return names in capitals that a statement assigns to, and what."""
    pairs: list[tuple[ast.expr, ast.expr]]
    if isinstance(statement, ast.AnnAssign) and statement.value is not None:
        pairs = [(statement.target, statement.value)]
    elif isinstance(statement, ast.Assign):
        (target,), value = statement.targets, statement.value
        pairs = [(target, value)]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = list(zip(target.elts, value.elts, strict=True))
    else:
        return
    for target, value in pairs:
        if isinstance(target, ast.Name) and target.id.strip("_").isupper():
            yield target.id, value


def _number(value: Any) -> Value | None:
    """Return what is a number, a tuple of them or a mapping to them, else None."""
    if isinstance(value, bool):
        return None
    if isinstance(value, int | float | np.floating):
        return value if isinstance(value, int) else float(value)
    parts = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple) else ()
    found = [_number(part) for part in parts]
    numbers = [number for number in found if isinstance(number, int | float)]
    if not numbers or len(numbers) < len(found):
        return None
    return dict(zip(value, numbers, strict=True)) if isinstance(value, Mapping) else tuple(numbers)


def _meaning(lines: list[str], statement: ast.stmt, after: ast.stmt | None) -> str:
    """Return the first sentence of the comment above a statement, behind it, or of the text below it."""
    above, number = list[str](), statement.lineno - 2
    while number >= 0 and lines[number].startswith("#"):
        above.insert(0, lines[number].lstrip("#: "))
        number -= 1
    behind = lines[(statement.end_lineno or statement.lineno) - 1].partition("  # ")[2]
    text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and after.value.value
    words = " ".join(above) or behind or str(text or "")
    return " ".join(words.split()).split(". ")[0].rstrip(".")
