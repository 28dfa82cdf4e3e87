"""Conversion of pydantic's errors to messages."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from fenics_contact.progress import is_visible
from fenics_contact.scene_file.document import Document
from fenics_contact.scene_file.mistakes import Mistake, SceneFileError, listed, suggestion
from fenics_contact.scene_file.places import Path, as_toml, branches, value_at, written
from fenics_contact.scene_file.source import Source
from fenics_contact.scene_file.values import MARK, SEPARATOR

#: What is needed, by pydantic's error type; braces are filled from its context.
NEEDED = {
    "float_type": "a number",
    "int_type": "an integer",
    "int_from_float": "an integer",
    "bool_type": "true or false",
    "string_type": "text in quotes",
    "finite_number": "a finite number",
    "greater_than": "a number greater than {gt:.12g}",
    "greater_than_equal": "a number of at least {ge:.12g}",
    "less_than": "a number less than {lt:.12g}",
    "less_than_equal": "a number of at most {le:.12g}",
    "dict_type": "a table",
    "model_type": "a table",
    "list_type": "a list in brackets",
    "too_short": "at least {min_length} entry",
    "needed": "{needed}",
}


def validated(source: Source) -> Document:
    """Return the checked document of a source.

    Raises:
        SceneFileError: Naming all mistakes.
    """
    unseen = invisible_texts(source)
    if unseen:
        raise SceneFileError(source.name, unseen)
    try:
        return Document.model_validate(source.data)
    except ValidationError as error:
        mistakes = [_mistake(source, each) for each in _without_misspelt(error.errors())]
        raise SceneFileError(source.name, mistakes) from None


def invisible_texts(source: Source) -> list[Mistake]:
    """Return the names and texts that contain control characters."""
    shown = "must be text that can be shown, got {}: leave out control characters"
    return [
        source.mistake(path, f"{written(path)} {shown.format(as_toml(text))}")
        for path, value in branches(source.data)
        for text in (value, *path[-1:])
        if isinstance(text, str) and not is_visible(text)
    ]


def _without_misspelt(errors: Sequence[Any]) -> list[Any]:
    """Omit missing keys that are only misspelt."""
    misspelt = [tuple(error["loc"]) for error in errors if error["ctx"]["kind"] == "extra_forbidden"]

    def explained(error: Any) -> bool:
        *table, key = error["loc"]
        near = [given for *where, given in misspelt if where == table]
        return error["ctx"]["kind"] == "missing" and any(suggestion(str(given), [key]) for given in near)

    return [error for error in errors if not explained(error)]


def _mistake(source: Source, error: Any) -> Mistake:
    context = error["ctx"]
    path = tuple(part for part in error["loc"] if not str(part).startswith(MARK))
    kind, hint = context["kind"], f": {context['hint']}" if context["hint"] else ""
    if kind == "missing":
        return source.mistake(path[:-1], _missing(source, path, hint))
    if kind == "extra_forbidden":
        return source.mistake(path, _unknown(path, context["keys"]))
    if kind == "choice":
        return _wrong_choice(source, path, *context["text"].split(SEPARATOR))
    if kind == "sentence":
        return source.mistake(path, f"{written(path)}: {context['sentence']}")
    value = value_at(source.data, path)
    if kind == "literal_error":
        allowed = re.findall("'([^']*)'", context["expected"])
        meant = suggestion(value if isinstance(value, str) else "", allowed)
        hint = f": {meant}".rstrip(": ") + (hint and f" ({hint[2:]})")
        needed = f"one of {listed(allowed)}"
    elif kind == "float_type" and isinstance(value, int) and not isinstance(value, bool):
        needed = "a number below 1.8e308, the largest that there is"
    else:
        needed = NEEDED[kind].format(**context) if kind in NEEDED else context["text"].lower()
    return source.mistake(path, f"{written(path)} must be {needed}, got {as_toml(value)}{hint}")


def _missing(source: Source, path: Path, hint: str) -> str:
    there = value_at(source.data, path[:-1])
    got = f"got only {', '.join(map(str, there))}" if there else "got nothing"
    owner = f"{written(path[:-1])} must have" if path[:-1] else "the file must have"
    return f"{owner} {path[-1]!r}, {got}{hint}"


def _unknown(path: Path, allowed: list[str]) -> str:
    owner = f"of {written(path[:-1])}" if path[:-1] else "of the file"
    return (
        f"{written(path)} is not known: {suggestion(str(path[-1]), allowed)}the keys {owner} are "
        f"{', '.join(allowed)}"
    )


def _wrong_choice(source: Source, path: Path, key: str, *allowed: str) -> Mistake:
    table = value_at(source.data, path)
    if not isinstance(table, Mapping):
        words = (
            f"{written(path)} must be a table with {key!r}, one of {listed(allowed)}, got {as_toml(table)}"
        )
        return source.mistake(path, words)
    if key not in table:
        words = f"{written(path)} must have {key!r}, one of {listed(allowed)}, got only {', '.join(table)}"
        return source.mistake(path, words if table else words.replace("only ", "nothing"))
    given = table[key]
    meant = suggestion(given if isinstance(given, str) else "", allowed).rstrip()
    words = f"{written((*path, key))} must be one of {listed(allowed)}, got {as_toml(given)}"
    return source.mistake((*path, key), f"{words}: {meant}" if meant else words)
