"""Line numbers of the keys of a TOML text."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_left
from collections.abc import Mapping
from typing import Any

from fenics_contact.scene_file.places import Path

_BARE = r"[A-Za-z0-9_-]+"
_BASIC, _LITERAL = r'"(?:[^"\\\n]|\\.)*"', r"'[^'\n]*'"
_PART = rf"(?:{_BARE}|{_BASIC}|{_LITERAL})"
_KEY = re.compile(rf"{_PART}(?:[ \t]*\.[ \t]*{_PART})*")
_BARE_KEY = re.compile(rf"{_BARE}(?:\.{_BARE})*")
#: Multi-line strings come first: they begin like the others.
_STRING = re.compile(rf"\"{{3}}(?:[^\\]|\\.)*?\"{{3,5}}|'{{3}}.*?'{{3,5}}|{_BASIC}|{_LITERAL}", re.DOTALL)
_STRING_OR_COMMENT = re.compile(rf"{_STRING.pattern}|#[^\n]*", re.DOTALL)
#: Most names of a dotted key.
DEEPEST = 32
_PARTS, _DEEP = re.compile(r"[A-Za-z0-9_ \t-]+"), re.compile(rf"\.{{{DEEPEST},}}")
_NUMBER_OR_DATE = re.compile(r"[^,\]}#\n]*")
_OPEN_HEAD, _CLOSED_HEAD = re.compile(r"\[+[ \t]*"), re.compile(r"[ \t]*\]+")
_EQUALS = re.compile(r"[ \t]*=[ \t]*")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BLANK_OR_COMMA = re.compile(r"(?:[ \t\r\n,]|#[^\n]*)*")


def lines_of(text: str) -> dict[Path, int]:
    """Return the line, from 1, on which every key, table and entry of a list begins.

    Args:
        text: A valid TOML text; for any other the result is meaningless.
    """
    return _Scanner(text).lines


def too_deep(text: str) -> int | None:
    """Return the line of the first key with more than `DEEPEST` names, None without any.

    Parsers take a time that grows with the square of their number.
    """
    bare = _STRING_OR_COMMENT.sub(lambda match: "\n" * match.group().count("\n"), text)
    run = _DEEP.search(_PARTS.sub("", bare))  # what is left of a key are its dots
    return None if run is None else run.string.count("\n", 0, run.start()) + 1


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
