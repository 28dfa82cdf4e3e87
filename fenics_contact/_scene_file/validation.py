"""Conversion of pydantic's errors to messages."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import singledispatch
from types import NoneType
from typing import Any

from pydantic import ValidationError

from fenics_contact._base.progress import is_visible
from fenics_contact._scene_file.document import Document, MadeOf
from fenics_contact._scene_file.part import Part, values_of
from fenics_contact._scene_file.source import (
    Mistake,
    Path,
    SceneFileError,
    Source,
    as_toml,
    branches,
    listed,
    parts_of,
    suggestion,
    value_at,
    written,
)
from fenics_contact._scene_file.values import FREE, MARK, SEPARATOR, Expression, FieldFile


def unknown(source: Source, path: Path, given: str, what: str, known: Iterable[str]) -> Mistake:
    """Return the mistake of an unknown name."""
    names = list(known)
    words = f"{written(path)} must be {what}, one of {listed(names)}, got {as_toml(given)}"
    meant = suggestion(given, names).rstrip()
    if not names and what.startswith("the name of"):
        meant = f"give it name = {as_toml(given)} there"
    return source.mistake(path, f"{words}: {meant}" if meant else words)


def wrong_names(source: Source, document: Document) -> list[Mistake]:
    """Return every unresolved name that can be detected without building meshes."""
    known: dict[str, Collection[str]] = {
        "a mesh": document.meshes,
        "a material": document.materials,
        "a body": document.bodies,
        "the name of a support": _names(document.supports),
        "the name of a load": _names(document.loads),
        "the name of a preload": _names(document.preloads),
        "the name of a constraint": _names(document.constraints),
        "the name of a fluid": _names(part.fluid for part in document.contacts if part.fluid),
        **document.known,
    }
    used = _references(document)
    wrong = [
        unknown(source, path, name, what, known[what]) for path, name, what in used if name not in known[what]
    ]
    return wrong or [
        *_twice(source, document), *_unlike(source, document), *_wrong_pairs(source, document),
        *_not_halved(source, document),
        *(source.mistake(path, f"{written(path)} {words}") for path, words in document.misfits()),
    ]  # fmt: skip


#: Parts of a scene file that do not go with halved cells, and why.
NOT_HALVED = {
    "steps": "load steps have a history on their meshes",
    "accuracy": "it refines where that pays",
    "design": "control points belong to a mesh",
}


def _not_halved(source: Source, document: Document) -> Iterator[Mistake]:
    """Yield the keys that cannot be kept where all cells are halved."""
    if not document.solver.halvings:
        return
    for key, why in NOT_HALVED.items():
        if getattr(document, key):
            words = f"{written((key,))} does not go with solver.halvings: {why}, leave one of both out"
            yield source.mistake((key,), words)
    if document.solver.subdomains != "auto":
        path: Path = ("solver", "subdomains")
        words = f"{written(path)} does not go with solver.halvings: every mesh is cut anew, leave it out"
        yield source.mistake(path, words)


def _names(parts: Iterable[Any]) -> list[str]:
    return [part.name for part in parts if part.name]


def _references(document: Document) -> Iterator[tuple[Path, str, str]]:
    """Yield every name that is used, with its path and what it must name."""
    for name, body in document.bodies.items():
        yield ("bodies", name, "mesh"), body.mesh, "a mesh"
    for place, made in parts_of(document, MadeOf):
        of: Any = made.material
        for path, material in parts_of(of, str, (*place, "material")):
            yield path, material, made.kind_of_material
    for path, body in values_of(document, "body"):
        yield path, body, "a body"
    cuts = document.solver.subdomains
    for name in cuts if isinstance(cuts, Mapping) else ():
        yield ("solver", "subdomains", name), name, "a body"
    for number, step in enumerate(document.steps):
        changed: dict[str, Iterable[str]] = {
            "supports": step.supports, "loads": step.loads, "preloads": step.preloads or (),
            "fluids": step.fluids, "constraints": step.constraints,
        }  # fmt: skip
        for key, its in changed.items():
            for name in its:
                yield ("steps", number, key, name), name, f"the name of a {key[:-1]}"


def surface_parts(document: Document) -> Iterator[tuple[Path, Any]]:
    """Yield every part that names a surface of a body's mesh, with its path."""
    for path, part in parts_of(document, Part):
        if hasattr(part, "surface") and path[0] not in ("design", "accuracy"):
            yield path, part


def _wrong_pairs(source: Source, document: Document) -> Iterator[Mistake]:
    """Yield numbers of contact pairs that are not there."""
    count = len(document.contacts)
    if document.automatic_contact is not None:
        return  # they are not known yet
    for path, pair in values_of(document, "pair"):
        if pair >= count:
            known = f"0 to {count - 1}" if count else "but it has none"
            words = f"{written(path)} must be the number of a contact of the file, {known}, got {pair}"
            yield source.mistake(path, words)


def _twice(source: Source, document: Document) -> Iterator[Mistake]:
    for key in ("supports", "loads", "preloads", "constraints"):
        seen: set[str] = set()
        for number, part in enumerate(getattr(document, key)):
            if part.name in seen:
                path: Path = (key, number, "name")
                words = f"{written(path)} must be a name of its own, got {as_toml(part.name)} twice"
                yield source.mistake(path, words)
            seen |= {part.name} - {""}


def _unlike(source: Source, document: Document) -> Iterator[Mistake]:
    """Yield values of load steps whose form differs from that of their supports and loads."""
    for number, step in enumerate(document.steps):
        for key in ("supports", "loads"):
            own = {part.name: part.size for part in getattr(document, key) if part.size is not None}
            for name, value in getattr(step, key).items():
                if name in own and not _alike(own[name], value):
                    path: Path = ("steps", number, key, name)
                    words = (
                        f"{written(path)} must have the form of {name!r} itself, "
                        f"{as_toml(_plain(own[name]))}, with the same components free, got "
                        f"{as_toml(_plain(value))}"
                    )
                    yield source.mistake(path, words)


def _alike(own: Any, value: Any) -> bool:
    """Return whether values have the same components."""
    forms = _form(own), _form(value)
    return forms[0] == forms[1] or _UNKNOWN in forms


#: Form of a field from a file that is not read yet.
_UNKNOWN = "unknown"


@singledispatch
def _form(value: Any) -> Any:
    """Return which components of a value are free, None for a value without components."""
    return None


_form.register(tuple, lambda value: tuple(entry is None for entry in value))
_form.register(FieldFile, lambda value: _UNKNOWN)


@singledispatch
def _plain(value: Any) -> Any:
    """Return a value as in the file."""
    return value


_plain.register(NoneType, lambda value: FREE)
_plain.register(Expression, lambda value: value.text)
_plain.register(tuple, lambda value: list(map(_plain, value)))


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of scene files (Draft 2020-12), with descriptions and units.

    Editors that know TOML by schema (taplo, Even Better TOML) complete and check a file whose first line is
    ``#:schema scene_file.schema.json``; ``fenics-contact schema`` writes it.
    """
    from fenics_contact._scene_file.heat_tables import HeatDocument  # not for scenes without heat

    schema = HeatDocument.model_json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "Scene file of fenics_contact",
        "required": ["meshes", "bodies"],
        "anyOf": [{"required": ["materials"]}, {"required": ["heat"]}],
    }


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


def validated(source: Source, kind: type[Document] = Document) -> Document:
    """Return the checked document of a source."""
    unseen = invisible_texts(source)
    if unseen:
        raise SceneFileError(source.name, unseen)
    try:
        return kind.model_validate(source.data)
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
        meant = suggestion(value, allowed)
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
    meant = suggestion(given, allowed).rstrip()
    words = f"{written((*path, key))} must be one of {listed(allowed)}, got {as_toml(given)}"
    return source.mistake((*path, key), f"{words}: {meant}" if meant else words)
