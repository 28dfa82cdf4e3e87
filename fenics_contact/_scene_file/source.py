"""The text of a scene file: its data and their lines."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property, singledispatch
from pathlib import Path as FilePath
from types import NoneType
from typing import Any, TypeAlias, TypeVar

import tomlkit
import tomlkit.exceptions
import tomlkit.items
from pydantic import BaseModel

from fenics_contact._base.progress import visible
from fenics_contact.errors import InvalidInputError

#: Keys and positions from the top of the file: ("contacts", 0, "friction").
Path: TypeAlias = tuple[str | int, ...]

#: Largest length of a value in messages.
LONGEST = 60
#: Largest integer, in bits: of a thousand digits.
_MOST_BITS = 3322
_BARE_PART = re.compile(r"[A-Za-z0-9_-]+")


def written(path: Path) -> str:
    """Return a path in the form of `--set`: ``contacts.0.friction``."""
    return ".".join(
        part if _BARE_PART.fullmatch(part) else f'"{shortened(visible(part))}"' for part in map(str, path)
    )


def shortened(text: str) -> str:
    """Return a text, cut to the length allowed in messages."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def as_toml(value: Any) -> str:
    """Return a value in TOML's form, shortened if it is long."""
    return shortened(visible(" ".join(_as_toml(value).split())))


@singledispatch
def _as_toml(value: Any) -> str:
    try:
        return tomlkit.item(value).as_string()
    except (TypeError, ValueError):
        return repr(value)


_of_any: Callable[[Any], str] = _as_toml.dispatch(object)
_as_toml.register(NoneType, lambda value: "nothing")


@_as_toml.register(Mapping)
def _(value: Mapping[Any, Any]) -> str:
    return f"a table with {', '.join(map(str, value))}" if value else "an empty table"


@_as_toml.register(str)
@_as_toml.register(list)
@_as_toml.register(tuple)
def _(value: str | list[Any] | tuple[Any, ...]) -> str:
    return _of_any(value[:LONGEST])


@_as_toml.register(int)
def _(value: int) -> str:
    if value.bit_length() > _MOST_BITS:
        return "an integer of more than 1000 digits"  # Python refuses to convert it
    return _of_any(value)


@singledispatch
def _entries(data: Any) -> Iterable[tuple[Any, Any]]:
    """Return what lists, tables and checked tables hold, by position or key; nothing of other data."""
    return ()


_entries.register(list, enumerate)
_entries.register(tuple, enumerate)
_entries.register(Mapping, lambda data: data.items())
_entries.register(BaseModel, iter)


def branches(data: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield plain data or a table and everything in it, with paths."""
    waiting = [(path, data)]
    while waiting:  # data may be nested deeper than Python's recursion limit
        path, data = waiting.pop()
        yield path, data
        waiting += [((*path, key), part) for key, part in _entries(data)]


Kind = TypeVar("Kind")


def parts_of(data: Any, kind: type[Kind], path: Path = ()) -> Iterator[tuple[Path, Kind]]:
    """Yield everything of a kind in plain data or a table, with paths."""
    for place, part in branches(data, path):
        if isinstance(part, kind):
            yield place, part


def value_at(data: Any, path: Path) -> Any:
    """Return the value at a path; None if there is none."""
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def replaced(data: Any, path: Sequence[str], value: Any) -> tuple[Path, Any]:
    """Return a path with numbers for entries of lists, and a copy of the data with another value there."""
    if not path:
        return (), value
    key, inner, renewed = _entry(data, path[0])
    rest, new = replaced(inner, path[1:], value)
    return (key, *rest), renewed(new)


@singledispatch
def _entry(data: Any, key: str) -> tuple[str | int, Any, Callable[[Any], Any]]:
    """Return a key, a number in lists, what is there, and what makes a copy with another value there."""
    raise KeyError(f"{key}, but there is {as_toml(data)}")


_entry.register(str, _entry.dispatch(object))


@_entry.register(Mapping)
def _(data: Mapping[str, Any], key: str) -> tuple[str | int, Any, Callable[[Any], Any]]:
    return key, data.get(key, {}), lambda new: {**data, key: new}


@_entry.register(Sequence)
def _(data: Sequence[Any], key: str) -> tuple[str | int, Any, Callable[[Any], Any]]:
    if not key.isdecimal() or int(key) >= len(data):
        raise KeyError(f"{key} of {len(data)} entries, numbered from 0")
    number = int(key)
    return number, data[number], lambda new: [*data[:number], new, *data[number + 1 :]]


_BARE = r"[A-Za-z0-9_-]+"
_BASIC, _LITERAL = r'"(?:[^"\\\n]|\\.)*"', r"'[^'\n]*'"
_PART = rf"(?:{_BARE}|{_BASIC}|{_LITERAL})"
_KEY = re.compile(rf"{_PART}(?:[ \t]*\.[ \t]*{_PART})*")
_BARE_KEY = re.compile(rf"{_BARE}(?:\.{_BARE})*")
#: Multi-line strings come first: they begin like the others.
_STRING = re.compile(rf"\"{{3}}(?:[^\\]|\\.)*?\"{{3,5}}|'{{3}}.*?'{{3,5}}|{_BASIC}|{_LITERAL}", re.DOTALL)
_NUMBER_OR_DATE = re.compile(r"[^,\]}#\n]*")
_OPEN_HEAD, _CLOSED_HEAD = re.compile(r"\[+[ \t]*"), re.compile(r"[ \t]*\]+")
_EQUALS = re.compile(r"[ \t]*=[ \t]*")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BLANK_OR_COMMA = re.compile(r"(?:[ \t\r\n,]|#[^\n]*)*")


def lines_of(text: str) -> dict[Path, int]:
    """Return the line, from 1, on which every key, table and entry of a list begins."""
    return _Scanner(text).lines


def nearest(lines: Mapping[Path, int], path: Path) -> int:
    """Return the line of a key, or of the nearest enclosing table; 0 if there is none."""
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path, 0)


class _Scanner:
    """Scans a text once, statement by statement."""

    def __init__(self, text: str) -> None:
        """Scan the text."""
        self._text, self._at = text, 0
        self._ends = [match.start() for match in re.finditer("\n", text)]
        self._lengths: dict[Path, int] = {}  # of lists of tables, [[...]]
        self.lines: dict[Path, int] = {}
        table: Path = ()
        self._skip(_BLANK)
        while self._at < len(text):
            before = self._at
            if text[self._at] == "[":
                table = self._head()
            else:
                self._assignment(table)
            self._skip(_BLANK)
            if self._at == before:  # not TOML
                return

    def _skip(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self._text, self._at)
        if match is None:
            return ""
        self._at = match.end()
        return match.group()

    def _note(self, path: Path) -> None:
        self.lines.setdefault(path, bisect_left(self._ends, self._at) + 1)

    def _head(self) -> Path:
        """Read [a.b] or [[a.b]]; return its path, with the number of the present entry of every list."""
        several = self._text.startswith("[[", self._at)
        self._skip(_OPEN_HEAD)
        path: Path = ()
        parts = key_parts(self._skip(_KEY))
        for number, part in enumerate(parts, 1):
            path = (*path, part)
            self._note(path)
            if several and number == len(parts):
                self._lengths[path] = self._lengths.get(path, 0) + 1
            if path in self._lengths:
                path = (*path, self._lengths[path] - 1)
                self._note(path)
        self._skip(_CLOSED_HEAD)
        return path

    def _assignment(self, table: Path) -> None:
        """Read key = value."""
        path, start = table, self._at
        parts = key_parts(self._skip(_KEY))
        after, self._at = self._at, start
        for part in parts:
            path = (*path, part)
            self._note(path)
        self._at = after
        self._skip(_EQUALS)
        self._value(path)

    def _value(self, path: Path) -> None:
        first = self._text[self._at : self._at + 1]
        if first in ("[", "{"):
            self._entries(path, "]" if first == "[" else "}")
        elif first in ('"', "'"):
            self._skip(_STRING)
        else:
            self._skip(_NUMBER_OR_DATE)

    def _entries(self, path: Path, end: str) -> None:
        """Read the content of brackets or braces."""
        self._at += 1
        number = 0
        self._skip(_BLANK_OR_COMMA)
        while self._at < len(self._text) and self._text[self._at] != end:
            before = self._at
            if end == "}":
                self._assignment(path)
            else:
                self._note((*path, number))
                self._value((*path, number))
                number += 1
            self._skip(_BLANK_OR_COMMA)
            if self._at == before:  # not TOML
                self._at = len(self._text)
        self._at += 1


def key_parts(key: str) -> list[str]:
    """Return the names of a dotted key of TOML, none if the text is not such a key."""
    if _BARE_KEY.fullmatch(key):
        return key.split(".")
    names: list[str] = []
    if not _KEY.fullmatch(key):
        return names
    inner: Any = tomllib.loads(f"{key} = 0")
    while inner:
        ((name, inner),) = inner.items()
        names.append(name)
    return names


#: Largest number of mistakes in a message.
MOST_LISTED = 50


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes:
        line: Line of the file, from 1; 0 where there is none.
        place: Name of the place in messages: "line 12", "--set solver.tolerance", "" for a dictionary.
        words: What is needed, what was given, what to do.
    """

    path: Path
    line: int
    place: str
    words: str

    def __str__(self) -> str:
        """Return place and words."""
        return f"{self.place}: {self.words}" if self.place else self.words


class SceneFileError(InvalidInputError):
    """A scene file cannot be used; all mistakes are listed, the first fifty in the message.

    Attributes:
        mistakes: The mistakes in the order of their lines.
    """

    def __init__(self, name: str, mistakes: Iterable[Mistake] = ()) -> None:
        """Build the message from the mistakes."""
        ordered = tuple(sorted(mistakes, key=lambda mistake: mistake.line))
        self.mistakes: tuple[Mistake, ...] = ordered
        if not ordered:
            super().__init__(name)
        elif len(ordered) == 1:
            super().__init__(f"{name}, {ordered[0]}" if ordered[0].place else f"{name}: {ordered[0]}")
        else:
            lines = "".join(f"\n  {mistake}" for mistake in ordered[:MOST_LISTED])
            more = f"\n  and {len(ordered) - MOST_LISTED} more" if len(ordered) > MOST_LISTED else ""
            super().__init__(f"{name} has {len(ordered)} mistakes:{lines}{more}")


def suggestion(given: object, allowed: Iterable[str]) -> str:
    """Return "did you mean ...? " if an allowed name is close to the text given, else ""."""
    close = get_close_matches(given, list(allowed), n=1, cutoff=0.6) if isinstance(given, str) else []
    return f"did you mean {close[0]!r}? " if close else ""


def listed(names: Iterable[str]) -> str:
    """Return a list of names in quotes; "none" for no name."""
    return ", ".join(repr(name) for name in names) or "none"


_OPEN = "; a bracket or quote may be open on a line before"
#: Byte-order mark of some editors, which TOML forbids.
BYTE_ORDER_MARK = "\ufeff"


@dataclass(frozen=True, eq=False)
class Source:
    """The source of a scene.

    `folder`: folder to which its file names are relative; `text`: the file's text, "" for a scene that came
    as a dictionary; `overrides`: overridden keys -> how they were given.
    """

    name: str
    folder: FilePath
    data: Mapping[str, Any]
    text: str = ""
    overrides: Mapping[Path, str] = field(default_factory=dict)

    def place(self, path: Path) -> tuple[int, str]:
        """Return the line of a key, 0 if there is none, and the name of the place in messages."""
        for given, words in self.overrides.items():
            if path[: len(given)] == given:
                return 0, words
        line = nearest(self._lines, path)
        return (line, f"line {line}") if line else (0, "")

    @cached_property
    def _lines(self) -> Mapping[Path, int]:
        return lines_of(self.text)

    def mistake(self, path: Path, words: str) -> Mistake:
        """Return a mistake at a key."""
        line, place = self.place(path)
        return Mistake(path, line, place, words)

    def with_overrides(self, overrides: Sequence[str]) -> Source:
        """Return the source with other values for some keys."""
        data, places = dict(self.data), dict(self.overrides)
        for override in overrides:
            try:
                path, data = replaced(data, *_parsed(override))
            except (KeyError, ValueError) as error:
                reason = error.args[0] if error.args else error
                words = (
                    "must be KEY=VALUE with a key such as contacts.0.friction.coefficient, got "
                    f"{shortened(override)!r}: {reason}"
                )
                raise SceneFileError(self.name, [Mistake((), 0, "--set", words)]) from error
            places[path] = "--set"
        return Source(self.name, self.folder, data, self.text, places)


def parse(text: str, name: str, folder: FilePath) -> Source:
    """Read the text of a scene file."""
    if text.startswith(BYTE_ORDER_MARK):
        words = (
            "must be TOML in UTF-8, which has no byte-order mark, got one before the first character: let "
            "the editor save the file as UTF-8 without BOM"
        )
        raise SceneFileError(name, [Mistake((), 1, "line 1", words)])
    try:
        return Source(name, folder, tomllib.loads(text), text)
    except ValueError as error:
        raise SceneFileError(name, [_no_toml(text, str(error))]) from error
    except RecursionError as error:
        raise SceneFileError(name, [_no_toml(text, "brackets are nested too deeply")]) from error


def _no_toml(text: str, reason: str) -> Mistake:
    """Describe why a text is not TOML, by tomlkit's message if it has one, which is more precise."""
    line = 0
    try:
        tomlkit.parse(text)
    except tomlkit.exceptions.ParseError as better:
        reason, line = str(better).partition(" at line ")[0], better.line
    except Exception:  # otherwise the first parser's message is used
        reason, _, place = reason.partition(" (at ")
        match = re.match(r"line (\d+)", place)
        line = int(match.group(1)) if match else 0
    lines = text.split("\n")
    line = min(line, len(lines))
    content = f", got {shortened(lines[line - 1].strip())!r}" if line else ""
    words = f"must be TOML{content}: {visible(reason)}{_OPEN if 'nexpected' in reason else ''}"
    return Mistake((), line, f"line {line}" if line else "", words)


def _parsed(override: str) -> tuple[list[str], Any]:
    key, equals, value = override.partition("=")
    if not equals:
        raise ValueError("there is no =")
    path = key_parts(key.strip())
    if not path:
        raise ValueError("there is no key before =")
    with suppress(ValueError, RecursionError):
        parsed = tomllib.loads(f"x = {value}")
        if list(parsed) == ["x"]:
            return path, parsed["x"]
    return path, value.strip()


@contextmanager
def located(source: Source, path: Path) -> Iterator[None]:
    """Make an error of the block a mistake at a key."""
    try:
        yield
    except SceneFileError:
        raise
    except InvalidInputError as error:
        mistake = source.mistake(path, f"{written(path)}: {error}")
        raise SceneFileError(source.name, [mistake]) from error


@contextmanager
def collected(source: Source, path: Path, mistakes: list[Mistake]) -> Iterator[None]:
    """Add an error of the block to the mistakes, at a key."""
    try:
        with located(source, path):
            yield
    except SceneFileError as error:
        mistakes.extend(error.mistakes)
