"""The text of a scene file: its data and their lines."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any, TypeAlias

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
        str(part) if isinstance(part, int) or _BARE_PART.fullmatch(part) else f'"{shortened(visible(part))}"'
        for part in path
    )


def shortened(text: str) -> str:
    """Return a text, cut to the length allowed in messages."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def as_toml(value: Any) -> str:
    """Return a value in TOML's form, shortened if it is long."""
    if isinstance(value, Mapping):
        text = f"a table with {', '.join(map(str, value))}" if value else "an empty table"
    elif value is None:
        text = "nothing"
    else:
        text = _as_toml(value)
    return shortened(visible(" ".join(text.split())))


def _as_toml(value: Any) -> str:
    if isinstance(value, str | list | tuple):
        value = value[:LONGEST]
    if isinstance(value, int) and value.bit_length() > _MOST_BITS:
        return "an integer of more than 1000 digits"  # Python refuses to convert it
    try:
        return tomlkit.item(value).as_string()
    except (TypeError, ValueError):
        return repr(value)


def branches(data: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield plain data or a table and everything in it, with paths."""
    waiting = [(path, data)]
    while waiting:  # data may be nested deeper than Python's recursion limit
        path, data = waiting.pop()
        yield path, data
        inner: Any = ()
        if isinstance(data, list | tuple):
            inner = enumerate(data)
        elif isinstance(data, Mapping | BaseModel):
            inner = data.items() if isinstance(data, Mapping) else data
        waiting += [((*path, key), part) for key, part in inner]


def value_at(data: Any, path: Path) -> Any:
    """Return the value at a path; None if there is none."""
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def replaced(data: Any, path: Path, value: Any) -> Any:
    """Return a copy of the data with another value at a path."""
    if not path:
        return value
    first, rest = path[0], path[1:]
    if isinstance(data, Mapping):
        return {**data, str(first): replaced(data.get(str(first), {}), rest, value)}
    if isinstance(data, Sequence) and not isinstance(data, str):
        if not str(first).isdecimal() or int(first) >= len(data):
            raise KeyError(f"{first} of {len(data)} entries, numbered from 0")
        changed = list(data)
        changed[int(first)] = replaced(data[int(first)], rest, value)
        return changed
    raise KeyError(f"{first}, but there is {as_toml(data)}")


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
    while isinstance(inner, Mapping):
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

    def __init__(self, name: str, mistakes: Iterable[Mistake] | str = ()) -> None:
        """Build the message from the mistakes."""
        ordered = (
            () if isinstance(mistakes, str) else tuple(sorted(mistakes, key=lambda mistake: mistake.line))
        )
        self.mistakes: tuple[Mistake, ...] = ordered
        if not ordered:
            super().__init__(name)
        elif len(ordered) == 1:
            super().__init__(f"{name}, {ordered[0]}" if ordered[0].place else f"{name}: {ordered[0]}")
        else:
            lines = "".join(f"\n  {mistake}" for mistake in ordered[:MOST_LISTED])
            more = f"\n  and {len(ordered) - MOST_LISTED} more" if len(ordered) > MOST_LISTED else ""
            super().__init__(f"{name} has {len(ordered)} mistakes:{lines}{more}")


def suggestion(given: str, allowed: Iterable[str]) -> str:
    """Return "did you mean ...? " if an allowed name is close to the one given, else ""."""
    close = get_close_matches(given, list(allowed), n=1, cutoff=0.6)
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
                path, value = _parsed(override)
                path = _resolved(data, path)
                data = replaced(data, path, value)
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
    except (ValueError, RecursionError) as error:
        raise SceneFileError(name, [_no_toml(text, error)]) from error


def _no_toml(text: str, error: Exception) -> Mistake:
    """Describe why a text is not TOML, by tomlkit's message if it has one, which is more precise."""
    reason, line = str(error), 0
    if isinstance(error, RecursionError):
        reason = "brackets are nested too deeply"
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


def _parsed(override: str) -> tuple[Path, Any]:
    key, equals, value = override.partition("=")
    if not equals:
        raise ValueError("there is no =")
    path = key_parts(key.strip())
    if not path:
        raise ValueError("there is no key before =")
    with suppress(ValueError, RecursionError):
        parsed = tomllib.loads(f"x = {value}")
        if list(parsed) == ["x"]:
            return tuple(path), parsed["x"]
    return tuple(path), value.strip()


def _resolved(data: Any, path: Path) -> Path:
    """Return a path with numbers for list entries."""
    resolved: list[str | int] = []
    for part in path:
        numbered = isinstance(data, Sequence) and not isinstance(data, str) and str(part).isdecimal()
        resolved.append(int(part) if numbered else part)
        data = value_at(data, (resolved[-1],))
    return tuple(resolved)


@contextmanager
def located(source: Source, path: Path, mistakes: list[Mistake] | None = None) -> Iterator[None]:
    """Make an error of the block a mistake at a key.

    `mistakes`: collects the mistake, which is raised unless given.
    """
    try:
        yield
    except SceneFileError as error:
        if mistakes is None:
            raise
        mistakes.extend(error.mistakes)
    except InvalidInputError as error:
        mistake = source.mistake(path, f"{written(path)}: {error}")
        if mistakes is None:
            raise SceneFileError(source.name, [mistake]) from error
        mistakes.append(mistake)
