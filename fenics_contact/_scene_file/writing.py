"""Objects of a scene as tables of a scene file, by the keys with which these are read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import singledispatch
from types import NoneType
from typing import Any

import numpy as np

from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene_file import model
from fenics_contact._scene_file.bodies import MATERIALS
from fenics_contact._scene_file.document import BodyPart, Document
from fenics_contact._scene_file.part import Part, not_in_files
from fenics_contact._scene_file.values import FREE

#: Tables of objects; of two that describe one the last is the more special.
TABLES: tuple[type[Part], ...] = (
    *MATERIALS, *model.SUPPORTS, model.SupportPart, *model.LOADS, *model.FRICTION_LAWS, *model.CLOSURE_LAWS,
    model.SurfaceOfBody, model.ContactPart, model.TiePart, model.CyclicPart, model.PreloadPart,
    model.FoundationPart, model.SpringPart, model.ConstraintPart, model.TermPart,
)  # fmt: skip
#: Writes values at nodes, by a name for them, and returns their table.
WriteField = Callable[[NodeValues, str], dict[str, Any]]


def table_for(made: object) -> type[Part]:
    """Return the table that builds an object, or raise `InvalidInputError` if scene files have none."""
    found = [table for table in TABLES if table.describes(made)]
    if not found:
        raise not_in_files(f"no table for {type(made).__name__}")
    return found[-1]


@singledispatch
def as_toml_value(value: Any, name: str, write: WriteField) -> Any:
    """Return a value as it is written, objects as their tables; `name`: for fields within it."""
    return as_table(value, name, write)


@as_toml_value.register(tuple)
@as_toml_value.register(list)
def _(value: tuple | list, name: str, write: WriteField) -> list[Any]:
    names = [f"{name} {axis}" for axis in "xyz"] if len(value) <= 3 else [name] * len(value)
    return [as_toml_value(each, own, write) for each, own in zip(value, names, strict=False)]


@as_toml_value.register(Mapping)
def _(value: Mapping, name: str, write: WriteField) -> dict[str, Any]:
    return {key: as_toml_value(each, name, write) for key, each in value.items()}


as_toml_value.register(NoneType, lambda value, name, write: FREE)
as_toml_value.register(np.ndarray, lambda value, name, write: value.tolist())
as_toml_value.register(NodeValues, lambda value, name, write: write(value, name))
for _kind in (str, int, float):
    as_toml_value.register(_kind, lambda value, name, write: value)


def as_table(made: object, name: str, write: WriteField) -> dict[str, Any]:
    """Return the table of an object; `name`: for values at nodes, which are written into files."""
    table = table_for(made).written(made)
    return {key: as_toml_value(value, name, write) for key, value in table.items()}


def body_table(body: Any, **own: Any) -> dict[str, Any]:
    """Return the table of a body; `own`: names of its mesh, of the part of it and of materials."""
    return BodyPart.keys({**vars(body), **own})


def lists_of(scene: Any) -> dict[str, tuple[Any, ...]]:
    """Return the parts of a scene by the keys of their lists in a file, in its order."""
    lists = [key for key, field in Document.model_fields.items() if field.default == []]
    return {key: getattr(scene, key) for key in lists if getattr(scene, key, ())}
