"""Fields from files in a scene file, read before anything is built from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel

from fenics_contact.errors import together
from fenics_contact.scene import SampledField, read_field
from fenics_contact.scene_file.located import located
from fenics_contact.scene_file.mistakes import Mistake, SceneFileError
from fenics_contact.scene_file.places import branches
from fenics_contact.scene_file.source import Source
from fenics_contact.scene_file.values import FieldFile

if TYPE_CHECKING:
    from mpi4py import MPI

Document = TypeVar("Document", bound=BaseModel)


def with_fields_read(source: Source, document: Document, comm: MPI.Comm) -> Document:
    """Return a document in which every field from a file is a function of position. Collective on ``comm``.

    Each file is read once, on rank 0.

    Raises:
        SceneFileError: Naming every file that cannot be read.
    """
    mistakes: list[Mistake] = []
    read: dict[tuple[Any, ...], SampledField] = {}
    for path, part in branches(document):
        if isinstance(part, FieldFile) and _key(part) not in read:
            with located(source, path, mistakes):
                read[_key(part)] = read_field(source.folder / part.file, part.field, comm=comm)
    with together(comm):
        if mistakes:
            raise SceneFileError(source.name, mistakes)
    return _replaced(document, read) if read else document


def _key(part: FieldFile) -> tuple[Any, ...]:
    return part.file, tuple(part.field) if isinstance(part.field, list) else part.field


def _replaced(value: Any, read: Mapping[tuple[Any, ...], SampledField]) -> Any:
    """Return a copy of a part of a document with its fields."""
    if isinstance(value, FieldFile):
        return read[_key(value)]
    if isinstance(value, BaseModel):
        own = {name: (part, _replaced(part, read)) for name, part in value}
        changed = {name: new for name, (old, new) in own.items() if new is not old}
        return value.model_copy(update=changed) if changed else value
    if isinstance(value, list | tuple):
        parts = [_replaced(part, read) for part in value]
        same = all(new is old for new, old in zip(parts, value, strict=True))
        return value if same else type(value)(parts)
    if isinstance(value, Mapping):
        return {name: _replaced(part, read) for name, part in value.items()}
    return value
