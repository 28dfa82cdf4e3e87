"""From what pydantic says to sentences of ours."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import Tag, ValidationError
from pydantic.fields import FieldInfo

from fenics_contact.progress.words import is_visible
from fenics_contact.scene_file.document import Document
from fenics_contact.scene_file.mistakes import Mistake, SceneFileError, listed, suggestion
from fenics_contact.scene_file.places import Path, as_toml, value_at, written
from fenics_contact.scene_file.source import Source
from fenics_contact.scene_file.values import SEPARATOR, Part

#: What is needed, by pydantic's name of the error; braces are filled from its context.
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
    "model_attributes_type": "a table",
    "list_type": "a list in brackets",
    "too_short": "at least {min_length} entry",
    "needed": "{needed}",
}


def validated(source: Source) -> Document:
    """Return what a source holds, checked.

    Raises:
        SceneFileError: Naming everything that is wrong.
    """
    unseen = invisible_texts(source)
    if unseen:
        raise SceneFileError(source.name, unseen)
    try:
        return Document.model_validate(source.data)
    except ValidationError as error:
        mistakes = [_mistake(source, each) for each in _told_once(error.errors())]
        raise SceneFileError(source.name, mistakes) from None


def invisible_texts(source: Source) -> list[Mistake]:
    """Return the names and texts that hold what a terminal would obey instead of showing it."""
    found: list[Mistake] = []
    waiting: list[tuple[Path, Any]] = [((), source.data)]
    while waiting:
        path, value = waiting.pop()
        if isinstance(value, Mapping):
            waiting += [((*path, key), part) for key, part in value.items()]
        elif isinstance(value, list | tuple):
            waiting += [((*path, number), part) for number, part in enumerate(value)]
        for text in (value, *path[-1:]):
            if isinstance(text, str) and not is_visible(text):
                words = f"must be text that can be shown, got {as_toml(text)}: leave out control characters"
                found.append(source.mistake(path, f"{written(path)} {words}"))
    return found


def _told_once(errors: Sequence[Any]) -> list[Any]:
    """Leave out keys that are missing only because they are misspelt."""
    misspelt = [tuple(error["loc"]) for error in errors if error["type"] == "extra_forbidden"]

    def explained(error: Any) -> bool:
        *table, key = error["loc"]
        near = [given for *where, given in misspelt if where == table]
        return error["type"] == "missing" and any(suggestion(str(given), [key]) for given in near)

    return [error for error in errors if not explained(error)]


def _mistake(source: Source, error: Any) -> Mistake:
    path, table, field = _field(tuple(error["loc"]))
    kind, context = error["type"], error.get("ctx", {})
    hint = f": {field.description}" if field is not None and field.description else ""
    if kind == "missing":
        return source.mistake(path[:-1], _missing(source, path, hint))
    if kind == "extra_forbidden":
        return source.mistake(path, _unknown(path, table))
    if kind == "choice":
        return _wrong_choice(source, path, *error["msg"].split(SEPARATOR))
    if kind == "sentence":
        return source.mistake(path, f"{written(path)}: {context['sentence']}")
    given = as_toml(value_at(source.data, path))
    if kind == "literal_error":
        allowed = [str(value) for value in _literals(field)]
        meant = suggestion(error["input"] if isinstance(error["input"], str) else "", allowed)
        hint = f": {meant}".rstrip(": ") + (hint and f" ({hint[2:]})")
        return source.mistake(path, f"{written(path)} must be one of {listed(allowed)}, got {given}{hint}")
    needed = NEEDED[kind].format(**context) if kind in NEEDED else error["msg"].lower()
    if kind == "float_type" and isinstance(value_at(source.data, path), int):
        needed = "a number below 1.8e308, the largest that there is"
    return source.mistake(path, f"{written(path)} must be {needed}, got {given}{hint}")


def _missing(source: Source, path: Path, hint: str) -> str:
    there = value_at(source.data, path[:-1])
    got = f"got only {', '.join(map(str, there))}" if there else "got nothing"
    owner = f"{written(path[:-1])} must have" if path[:-1] else "the file must have"
    return f"{owner} {path[-1]!r}, {got}{hint}"


def _unknown(path: Path, table: type[Part] | None) -> str:
    allowed = list(table.model_fields) if table is not None else []
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


def _field(location: tuple[str | int, ...]) -> tuple[Path, type[Part] | None, FieldInfo | None]:
    """Return a location as keys, the table that its last key belongs to, and what is known of the key."""
    kind: Any = Document
    path: Path = ()
    table: type[Part] | None = None
    field: FieldInfo | None = None
    for part in location:
        members = list(_members(kind))
        chosen = next((member for tag, member in members if tag is not None and tag == part), None)
        if chosen is not None:  # not a key: which of several kinds of tables it is
            kind = chosen
            table = kind if _is_part(kind) else table
            continue
        path = (*path, part)
        plain = members[0][1] if members else None
        if plain is not None and _is_part(plain):
            table, field = plain, plain.model_fields.get(str(part))
            kind = None if field is None else field.annotation
        else:
            arguments = get_args(plain)
            kind = arguments[-1] if arguments else None
    return path, table, field


def _is_part(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Part)


def _members(kind: Any, tag: str | None = None) -> Iterator[tuple[str | None, Any]]:
    """Yield the types that an annotation allows, with their tags."""
    if get_origin(kind) is Annotated:
        inner, *marks = get_args(kind)
        tags = [mark.tag for mark in marks if isinstance(mark, Tag)]
        yield from _members(inner, tags[0] if tags else tag)
    elif get_origin(kind) in (Union, types.UnionType):
        for member in get_args(kind):
            if member is not type(None):
                yield from _members(member, tag)
    elif kind is not None:
        yield tag, kind


def _literals(field: FieldInfo | None) -> list[Any]:
    found = [] if field is None else [member for _, member in _members(field.annotation)]
    values: list[Any] = []
    for member in found:
        inner = get_args(member)[0] if get_origin(member) is list else member
        values.extend(get_args(inner))
    return values
