"""The text of a scene file: its data and their lines."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import tomlkit
import tomlkit.exceptions

from fenics_contact.progress import visible
from fenics_contact.scene_file.lines import DEEPEST, key_parts, lines_of, nearest, too_deep
from fenics_contact.scene_file.mistakes import Mistake, SceneFileError
from fenics_contact.scene_file.places import Path, replaced, shortened, value_at

_OPEN = "; a bracket or quote may be open on a line before"
#: Byte-order mark of some editors, which TOML forbids.
BYTE_ORDER_MARK = "\ufeff"


@dataclass(frozen=True, eq=False)
class Source:
    """The source of a scene.

    Attributes:
        name: Its name in messages.
        folder: Folder to which its file names are relative.
        data: Its data, including overrides.
        text: The file's text, "" for a scene that came as a dictionary.
        overrides: Overridden keys -> how they were given.
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
        """Return the source with other values for some keys.

        Args:
            overrides: ``KEY=VALUE``, such as ``contacts.0.friction.coefficient=0.2``; a value that is not
                TOML is a string.

        Raises:
            SceneFileError: If one has another form or its key does not exist.
        """
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
    """Read the text of a scene file.

    Raises:
        SceneFileError: If it is not TOML, with the line.
    """
    if text.startswith(BYTE_ORDER_MARK):
        words = (
            "must be TOML in UTF-8, which has no byte-order mark, got one before the first character: let "
            "the editor save the file as UTF-8 without BOM"
        )
        raise SceneFileError(name, [Mistake((), 1, "line 1", words)])
    if (line := too_deep(text)) is not None:
        words = (
            f"must have keys of at most {DEEPEST} names between dots, got "
            f"{shortened(text.splitlines()[line - 1].strip())!r}: no key of a scene file is as deep"
        )
        raise SceneFileError(name, [Mistake((), line, f"line {line}", words)])
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
        raise ValueError("what stands before = is no key")
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
