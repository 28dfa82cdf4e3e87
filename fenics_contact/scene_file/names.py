"""Names that parts of a scene file use of each other must be there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fenics_contact.scene_file.contacts import SurfaceOfBody
from fenics_contact.scene_file.document import Document
from fenics_contact.scene_file.mistakes import Mistake, listed, suggestion
from fenics_contact.scene_file.places import Path, as_toml, written
from fenics_contact.scene_file.source import Source
from fenics_contact.scene_file.values import FREE


@dataclass(frozen=True)
class Reference:
    """A name that a part uses.

    Attributes:
        path: Where.
        given: The name.
        what: What it must be a name of.
    """

    path: Path
    given: str
    what: str

    def wrong(self, source: Source, known: Iterable[str]) -> Mistake:
        """Return the mistake of a name that is not known."""
        names = list(known)
        words = f"{written(self.path)} must be {self.what}, one of {listed(names)}, got {as_toml(self.given)}"
        meant = suggestion(self.given, names).rstrip()
        return source.mistake(self.path, f"{words}: {meant}" if meant else words)


def wrong_names(source: Source, document: Document) -> list[Mistake]:
    """Return every name that leads nowhere, as far as no mesh need be built to know it."""
    known: dict[str, Iterable[str]] = {
        "a mesh": document.meshes,
        "a material": document.materials,
        "a body": document.bodies,
        "the name of a support": _names(document.supports),
        "the name of a load": _names(document.loads),
    }
    used = [*_of_bodies(document), *body_references(document), *_of_steps(document)]
    wrong = [one.wrong(source, known[one.what]) for one in used if one.given not in known[one.what]]
    return wrong or [*_twice(source, document), *_unlike(source, document)]


def _names(parts: Iterable[Any]) -> list[str]:
    return [part.name for part in parts if part.name]


def _of_bodies(document: Document) -> Iterator[Reference]:
    for name, body in document.bodies.items():
        yield Reference(("bodies", name, "mesh"), body.mesh, "a mesh")
        if isinstance(body.material, str):
            yield Reference(("bodies", name, "material"), body.material, "a material")
        else:
            for region, material in body.material.items():
                yield Reference(("bodies", name, "material", region), material, "a material")


def body_references(document: Document) -> Iterator[Reference]:
    """Yield every name of a body that supports, loads, pairs, solver and design use."""
    for path, part in surface_parts(document):
        yield Reference((*path, "body"), part.body, "a body")
    for number, load in enumerate(document.loads):
        if not hasattr(load, "surface"):
            yield Reference(("loads", number, "body"), load.body, "a body")
    if isinstance(document.solver.subdomains, Mapping):
        for name in document.solver.subdomains:
            yield Reference(("solver", "subdomains", name), name, "a body")
    for number, surface in enumerate(document.design.surfaces if document.design else ()):
        yield Reference(("design", "surfaces", number, "body"), surface.body, "a body")


def surface_parts(document: Document) -> Iterator[tuple[Path, Any]]:
    """Yield every part that names a surface of a body, with its path."""
    for key in ("supports", "loads"):
        for number, part in enumerate(getattr(document, key)):
            if hasattr(part, "surface"):
                yield (key, number), part
    for key in ("contacts", "ties"):
        for number, pair in enumerate(getattr(document, key)):
            yield (key, number, "slave"), pair.slave
            if isinstance(pair.master, SurfaceOfBody):
                yield (key, number, "master"), pair.master


def _of_steps(document: Document) -> Iterator[Reference]:
    for number, step in enumerate(document.steps):
        for name in step.supports:
            yield Reference(("steps", number, "supports", name), name, "the name of a support")
        for name in step.loads:
            yield Reference(("steps", number, "loads", name), name, "the name of a load")


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
    """Yield values of load steps that have another form than those of their supports and loads."""
    values: dict[str, dict[str, Any]] = {
        "supports": {part.name: part.value for part in document.supports if part.name},
        "loads": {part.name: part.size for part in document.loads if part.name},
    }
    for number, step in enumerate(document.steps):
        for key in ("supports", "loads"):
            for name, value in getattr(step, key).items():
                path, own = ("steps", number, key, name), values[key][name]
                if own is not None and _form(own) != _form(value):
                    words = (
                        f"{written(path)} must have the form of {name!r} itself, {as_toml(_plain(own))}, "
                        f"with the same components free, got {as_toml(_plain(value))}"
                    )
                    yield source.mistake(path, words)


def _form(value: Any) -> Any:
    return tuple(entry == FREE for entry in value) if isinstance(value, tuple) else None


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
