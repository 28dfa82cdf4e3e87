"""The text of a scene file: what it holds, and on which line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

import tomlkit
import tomlkit.exceptions

from fenics_contact.scene_file.lines import line_of
from fenics_contact.scene_file.mistakes import Mistake, SceneFileError
from fenics_contact.scene_file.places import Path, replaced, value_at

_OPEN = "; a bracket or quote may be open on a line before"


@dataclass(frozen=True, eq=False)
class Source:
    """Where a scene comes from.

    Attributes:
        name: How messages call it.
        folder: Folder to which files that it names are relative.
        data: What it holds, overrides included.
        text: The file's text, "" for a scene that came as a dictionary.
        overrides: Keys that were given elsewhere -> how.
    """

    name: str
    folder: FilePath
    data: Mapping[str, Any]
    text: str = ""
    overrides: Mapping[Path, str] = field(default_factory=dict)

    def place(self, path: Path) -> tuple[int, str]:
        """Return the line of a key, 0 where there is none, and how messages name the place."""
        for given, words in self.overrides.items():
            if path[: len(given)] == given:
                return 0, words
        line = line_of(self.text, path) if self.text else 0
        return (line, f"line {line}") if line else (0, "")

    def mistake(self, path: Path, words: str) -> Mistake:
        """Return a mistake at a key."""
        line, place = self.place(path)
        return Mistake(path, line, place, words)

    def with_overrides(self, overrides: Sequence[str]) -> Source:
        """Return the source with other values for some keys.

        Args:
            overrides: ``KEY=VALUE``, such as ``contacts.0.friction.coefficient=0.2``; a value that is no TOML
                is a text.

        Raises:
            SceneFileError: If one has another form or its key leads nowhere.
        """
        data, places = dict(self.data), dict(self.overrides)
        for override in overrides:
            try:
                path, value = _parsed(override)
                path = _resolved(data, path)
                data = replaced(data, path, value)
            except (KeyError, tomlkit.exceptions.TOMLKitError, ValueError) as error:
                reason = error.args[0] if error.args else error
                words = (
                    "must be KEY=VALUE with a key such as contacts.0.friction.coefficient, got "
                    f"{override!r}: {reason}"
                )
                raise SceneFileError(self.name, [Mistake((), 0, "--set", words)]) from error
            places[path] = "--set"
        return Source(self.name, self.folder, data, self.text, places)


def parse(text: str, name: str, folder: FilePath) -> Source:
    """Read the text of a scene file.

    Raises:
        SceneFileError: If it is no TOML, with the line.
    """
    try:
        data = tomlkit.parse(text).unwrap()
    except tomlkit.exceptions.ParseError as error:
        reason = str(error).partition(" at line ")[0]
        line = min(error.line, text.count("\n") + 1)
        content = text.splitlines()[line - 1].strip() if text.splitlines() else ""
        words = f"must be TOML, got {content!r}: {reason}{_OPEN if 'nexpected' in reason else ''}"
        raise SceneFileError(name, [Mistake((), line, f"line {line}", words)]) from error
    return Source(name, folder, data, text)


def _parsed(override: str) -> tuple[Path, Any]:
    key, equals, value = override.partition("=")
    if not equals:
        raise ValueError("there is no =")
    path: list[str] = []
    inner: Any = tomlkit.parse(f"{key} = ''").unwrap()
    while isinstance(inner, Mapping):
        ((part, inner),) = inner.items()
        path.append(part)
    try:
        return tuple(path), tomlkit.parse(f"x = {value}").unwrap()["x"]
    except tomlkit.exceptions.ParseError:
        return tuple(path), value.strip()


def _resolved(data: Any, path: Path) -> Path:
    """Return a path with numbers for the entries of lists."""
    found: list[str | int] = []
    for part in path:
        numbered = isinstance(data, Sequence) and not isinstance(data, str) and str(part).isdecimal()
        found.append(int(part) if numbered else part)
        data = value_at(data, (found[-1],))
    return tuple(found)
