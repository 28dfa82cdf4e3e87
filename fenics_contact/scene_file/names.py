"""Checks that names to which parts of a scene file refer exist."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from fenics_contact.scene_file.document import Document
from fenics_contact.scene_file.expression import Expression
from fenics_contact.scene_file.mistakes import Mistake, listed, suggestion
from fenics_contact.scene_file.part import Part
from fenics_contact.scene_file.places import Path, as_toml, branches, written
from fenics_contact.scene_file.source import Source
from fenics_contact.scene_file.values import FREE, FieldFile


def unknown(source: Source, path: Path, given: str, what: str, known: Iterable[str]) -> Mistake:
    """Return the mistake of an unknown name.

    Args:
        source: Source of the scene.
        path: Path of the name.
        given: The name.
        what: What it must name.
        known: Existing names.
    """
    names = list(known)
    words = f"{written(path)} must be {what}, one of {listed(names)}, got {as_toml(given)}"
    meant = suggestion(given, names).rstrip()
    return source.mistake(path, f"{words}: {meant}" if meant else words)


def wrong_names(source: Source, document: Document) -> list[Mistake]:
    """Return every unresolved name that can be detected without building meshes."""
    known: dict[str, Collection[str]] = {
        "a mesh": document.meshes,
        "a material": document.materials,
        "a body": document.bodies,
        "the name of a support": _names(document.supports),
        "the name of a load": _names(document.loads),
    }
    used = _references(document)
    wrong = [
        unknown(source, path, name, what, known[what]) for path, name, what in used if name not in known[what]
    ]
    return wrong or [*_twice(source, document), *_unlike(source, document), *_wrong_pairs(source, document)]


def _names(parts: Iterable[Any]) -> list[str]:
    return [part.name for part in parts if part.name]


def _references(document: Document) -> Iterator[tuple[Path, str, str]]:
    """Yield every name that is used, with its path and what it must name."""
    for name, body in document.bodies.items():
        yield ("bodies", name, "mesh"), body.mesh, "a mesh"
        made_of: Any = body.material
        for region in made_of if isinstance(made_of, Mapping) else ():
            yield ("bodies", name, "material", region), made_of[region], "a material"
        if isinstance(made_of, str):
            yield ("bodies", name, "material"), made_of, "a material"
    for path, part in branches(document):
        if isinstance(part, Part) and hasattr(part, "body"):
            yield (*path, "body"), part.body, "a body"
    cuts = document.solver.subdomains
    for name in cuts if isinstance(cuts, Mapping) else ():
        yield ("solver", "subdomains", name), name, "a body"
    for number, step in enumerate(document.steps):
        for key, named in (("supports", step.supports), ("loads", step.loads)):
            for name in named:
                yield ("steps", number, key, name), name, f"the name of a {key[:-1]}"


def surface_parts(document: Document) -> Iterator[tuple[Path, Any]]:
    """Yield every part that names a surface of a body's mesh, with its path."""
    for path, part in branches(document):
        if isinstance(part, Part) and hasattr(part, "surface") and path[0] != "design":
            yield path, part


def _wrong_pairs(source: Source, document: Document) -> Iterator[Mistake]:
    """Yield numbers of contact pairs that are not there."""
    count = len(document.contacts)
    if document.automatic_contact is not None:
        return  # they are not known yet
    for path, part in branches(document):
        pair = getattr(part, "pair", None) if isinstance(part, Part) else None
        if pair is not None and pair >= count:
            known = f"0 to {count - 1}" if count else "but it has none"
            words = (
                f"{written((*path, 'pair'))} must be the number of a contact of the file, {known}, got {pair}"
            )
            yield source.mistake((*path, "pair"), words)


def _twice(source: Source, document: Document) -> Iterator[Mistake]:
    for key in ("supports", "loads"):
        seen: set[str] = set()
        for number, part in enumerate(getattr(document, key)):
            if part.name in seen:
                path: Path = (key, number, "name")
                words = f"{written(path)} must be a name of its own, got {as_toml(part.name)} twice"
                yield source.mistake(path, words)
            seen |= {part.name} - {None}


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
    """Return whether values have the same components; those of a field from a file are not known yet."""
    return isinstance(own, FieldFile) or isinstance(value, FieldFile) or _form(own) == _form(value)


def _form(value: Any) -> Any:
    return tuple(entry is None for entry in value) if isinstance(value, tuple) else None


def _plain(value: Any) -> Any:
    """Return a value as in the file."""
    if isinstance(value, tuple):
        return [FREE if entry is None else _plain(entry) for entry in value]
    return value.text if isinstance(value, Expression) else value
