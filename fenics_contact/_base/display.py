"""Objects on a screen: a few lines of facts or tables instead of their arrays, and tables in notebooks."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum, IntEnum
from functools import singledispatch
from types import NoneType
from typing import Any, TypeAlias, TypeVar

import numpy as np

__all__ = [
    "DerivedUnits", "Table", "counted", "displayed", "in_lines", "in_notebooks", "in_short", "name_in_words",
    "tabled",
]  # fmt: skip

Class = TypeVar("Class", bound=type)

#: Largest number of lines of a ``repr``: it fits on a screen with others.
LINES = 10
#: Largest number of its columns: a wide terminal, as of the sources.
COLUMNS = 110
#: Largest number of columns of a part inside another object.
INSIDE = 64
#: Largest number of entries of a mapping or sequence that are shown.
ENTRIES = 4


def displayed(cls: Class) -> Class:
    """Let a class show facts, one per line, as its ``repr``, and as a table in notebooks.

    The facts are what its method ``_facts`` returns, name -> value; without one the fields of a dataclass
    that take part in its ``repr``. Arrays are shown by shape and range. Place it above ``@dataclass``.

    Example:
        >>> from dataclasses import dataclass
        >>> @displayed
        ... @dataclass(frozen=True)
        ... class Wire:
        ...     radius: float
        ...     points: np.ndarray
        >>> Wire(0.5, np.arange(12.0).reshape(4, 3))
        Wire
          radius  0.5
          points  float64 (4, 3), 0 to 11
    """
    cls.__repr__ = in_lines  # type: ignore[assignment]
    cls._repr_html_ = _in_table  # type: ignore[attr-defined]
    return cls


def in_notebooks(cls: Class) -> Class:
    """Let a class show its facts as a table in notebooks alone. Place it above ``@dataclass``."""
    cls._repr_html_ = _in_table  # type: ignore[attr-defined]
    return cls


@dataclass(frozen=True)
class Table:
    """A table of text.

    `names`: number of columns that are words and lie to the left; numbers lie to the right; `notes`: lines
    behind it; `headed`: whether the first row has names.
    """

    rows: Sequence[tuple[str, ...]]
    names: int
    notes: tuple[str, ...] = ()
    headed: bool = True

    def lines(self) -> list[str]:
        """Return it as lines of text."""
        width = [max(map(len, column)) for column in zip(*self.rows, strict=True)]
        rows = [
            "  ".join(
                cell.ljust(size) if k < self.names else cell.rjust(size)
                for k, (cell, size) in enumerate(zip(row, width, strict=True))
            ).rstrip()
            for row in self.rows
        ]
        return [*rows, *self.notes]

    def html(self, caption: str) -> str:
        """Return it in HTML, the notes behind the caption."""
        from html import escape

        def row(cells: tuple[str, ...], kind: str) -> str:
            sides = ("left" if k < self.names else "right" for k in range(len(cells)))
            parts = (
                f'<{kind} style="text-align: {side}">{escape(cell)}</{kind}>'
                for cell, side in zip(cells, sides, strict=True)
            )
            return f"<tr>{''.join(parts)}</tr>"

        kinds = ["th" if self.headed else "td", *["td"] * (len(self.rows) - 1)]
        body = "".join(map(row, self.rows, kinds))
        return f"<table><caption>{escape('; '.join([caption, *self.notes]))}</caption>{body}</table>"


def tabled(cls: Class) -> Class:
    """Let a class show the tables of its method ``_tables``, printed, as its ``repr``, and in notebooks.

    A ``repr`` is cut to some lines. Place it above ``@dataclass``.

    Example:
        >>> @tabled
        ... @dataclass(frozen=True)
        ... class Wires:
        ...     radii: dict[str, float]
        ...     def _tables(self) -> list[Table]:
        ...         rows = [(name, f"{radius:.5g}") for name, radius in self.radii.items()]
        ...         return [Table([("", "radius"), *rows], 1, ("in [length]",))]
        >>> Wires({"thin": 0.1, "thick": 2.5})
               radius
        thin      0.1
        thick     2.5
        in [length]
    """
    cls.__str__ = _printed  # type: ignore[assignment]
    cls.__repr__ = _printed_in_short  # type: ignore[assignment]
    cls._repr_html_ = _in_tables  # type: ignore[attr-defined]
    return cls


def _printed(shown: Any) -> str:
    """Return its tables as text, "none" without any."""
    return "\n".join(line for table in shown._tables() for line in table.lines()) or "none"


def _printed_in_short(shown: Any) -> str:
    """Return its tables as text, or the first lines and how many follow."""
    lines = _printed(shown).splitlines()
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], f"… {len(lines) - LINES + 1} more lines: print it"]
    return "\n".join(_cut(line, COLUMNS) for line in lines)


def _in_tables(shown: Any) -> str:
    """Return its tables in HTML, as notebooks show them."""
    name = type(shown).__name__
    return "".join(table.html(name) for table in shown._tables()) or f"{name}: none"


def in_lines(shown: Any, most: int = LINES, columns: int = COLUMNS) -> str:
    """Return an object's name and facts, one per line."""
    facts = _facts(shown)
    names, more = list(facts), []
    if len(names) >= most:
        names, more = names[: most - 2], names[most - 2 :]
    width = max(map(len, names), default=0)
    lines = [f"  {name:{width}s}  {in_short(facts[name], columns - width - 4)}" for name in names]
    rest = [_cut(f"  and {', '.join(more)}", columns)] if more else []
    return "\n".join([type(shown).__name__, *lines, *rest])


def _in_table(shown: Any) -> str:
    """Return the facts as a table in HTML, as notebooks show it."""
    from html import escape

    rows = "".join(
        f'<tr><th style="text-align: left">{escape(name)}</th>'
        f'<td style="text-align: left">{escape(in_short(value, 2 * COLUMNS))}</td></tr>'
        for name, value in _facts(shown).items()
    )
    return f"<table><caption>{escape(type(shown).__name__)}</caption>{rows}</table>"


def _facts(shown: Any) -> Mapping[str, Any]:
    if hasattr(shown, "_facts"):
        return dict(shown._facts())
    return {field.name: getattr(shown, field.name) for field in fields(shown) if field.repr}


def in_short(value: Any, width: int = INSIDE) -> str:
    """Return a value in one line: arrays by shape and range, long lists by their length."""
    return _in_line(value, _object, width)


#: What is said of an object that is no number, text, array, list or mapping.
OfObject: TypeAlias = Callable[[Any], str]


def _in_line(value: Any, of_object: OfObject, width: int = INSIDE) -> str:
    return _cut(" ".join(_words(value, of_object).split()), width)


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: width - 2]} …"


@singledispatch
def _words(value: Any, of_object: OfObject) -> str:
    if callable(value) and hasattr(value, "__qualname__"):
        return str(value.__qualname__)
    return of_object(value)


_words.register(str, lambda value, of_object: value)
_kind: type
for _kind in (float, np.floating):
    _words.register(_kind, lambda value, of_object: f"{value:.6g}")
for _kind in (int, NoneType):
    _words.register(_kind, lambda value, of_object: repr(value))
for _kind in (Enum, IntEnum):
    _words.register(_kind, lambda value, of_object: value.name)


@_words.register(Mapping)
def _(value: Mapping[Any, Any], of_object: OfObject) -> str:
    parts = [f"{name}: {_in_line(part, of_object)}" for name, part in list(value.items())[:ENTRIES]]
    return "; ".join(parts + _more(len(value))) or "none"


@_words.register(list)
@_words.register(tuple)
@_words.register(Set)
def _(values: Sequence[Any] | Set[Any], of_object: OfObject) -> str:
    kinds = {type(value).__name__ for value in values}
    if len(values) > ENTRIES and len(kinds) == 1 and kinds != {"str"}:
        return f"{len(values)} × {kinds.pop()}"
    shown = [_in_line(value, of_object) for value in list(values)[:ENTRIES]] + _more(len(values))
    numbers = all(isinstance(value, int | float | np.number | None) for value in values)
    return f"({', '.join(shown)})" if values and numbers else "; ".join(shown) or "none"


def _object(value: Any) -> str:
    """Return the facts of an object that shows them, or what it says itself."""
    if type(value).__repr__ is not in_lines and not is_dataclass(value):
        return repr(value)
    parts = (f"{name} {_in_line(fact, _named)}" for name, fact in _facts(value).items())
    return f"{type(value).__name__}({', '.join(parts)})"


def _named(value: Any) -> str:
    return f"{type(value).__name__}(…)"


@_words.register(np.ndarray)
def _(array: np.ndarray, of_object: OfObject) -> str:
    known = f"{array.dtype} {array.shape}"
    if array.size == 0 or array.dtype.kind not in "biuf":
        return known
    if array.dtype.kind == "b":
        return f"{known}, {np.count_nonzero(array)} true"
    nan = int(np.count_nonzero(np.isnan(array)))
    low, high = (np.nan, np.nan) if nan == array.size else (np.nanmin(array), np.nanmax(array))
    return f"{known}, {low:.6g} to {high:.6g}{f', {nan} nan' if nan else ''}"


def _more(count: int) -> list[str]:
    return [f"… {count - ENTRIES} more"] if count > ENTRIES else []


def counted(number: int, one: str, many: str = "") -> str:
    """Return a count with what is counted, ``many`` being "s" behind ``one`` by default.

    Example:
        >>> counted(1, "node lies", "nodes lie"), counted(3, "rank")
        ('1 node lies', '3 ranks')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


@dataclass(frozen=True)
class DerivedUnits:
    """Names of units of forces, of moments and energies, of areas of surfaces and of volumes.

    `per`: what follows behind them, " per revolution" of bodies of revolution.
    """

    force: str
    moment: str
    area: str
    per: str
    volume: str

    @classmethod
    def of(cls, force: str, length: str, scene: Mapping[str, Any]) -> DerivedUnits:
        """Return them by what a scene records; what plane bodies without a thickness have is per length."""
        turned = bool(scene.get("axisymmetric"))
        plane = scene.get("dimension") == 2 and not turned and not scene.get("thickness")
        each = f"/{length}" if plane else ""
        area, per = length if plane else f"{length}²", " per revolution" if turned else ""
        volume = f"{length}²" if plane else f"{length}³"
        return cls(f"{force}{each}", f"{force} {length}{each}", area, per, volume)


def name_in_words(name: str) -> str:
    """Return the name of a class in words: "rigid plane" for RigidPlane."""
    return re.sub(r"(?<!^)(?=[A-Z])", " ", name).lower()
