"""What a scene file chooses for surfaces: groups of a mesh file, or faces of a CAD file by where they lie."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag

from fenics_contact import mesh_io
from fenics_contact.scene_file.part import Part, keys_of
from fenics_contact.scene_file.values import MARK, Read, one_of, with_message


@keys_of(mesh_io.InBox)
class InBox(Part):
    """The faces of a CAD file that lie wholly in a box along the axes."""

    faces: Literal["in_box"]


@keys_of(mesh_io.OnPlane)
class OnPlane(Part):
    """The plane faces of a CAD file that lie in a plane; of a plane part, the straight edges on a line."""

    faces: Literal["on_plane"]


@keys_of(mesh_io.OnCylinder)
class OnCylinder(Part):
    """The faces of a CAD file on a cylinder; of a plane part, the arcs of a circle."""

    faces: Literal["on_cylinder"]


def _either(kind: type, this: Any, other: Any) -> Any:
    """Read values of a Python type as one annotation, all others as another."""
    tag = Discriminator(lambda value: f"{MARK}this" if isinstance(value, kind) else f"{MARK}other")
    return Annotated[Annotated[this, Tag(f"{MARK}this")] | Annotated[other, Tag(f"{MARK}other")], tag]


_LABEL = Annotated[
    str | int,
    with_message("the name or number of a group or face, a list of them, or a table that chooses faces"),
]
_ONE: Any = _either(dict, Annotated[Any, one_of("faces", InBox, OnPlane, OnCylinder)], _LABEL)
_SEVERAL = Annotated[list[Annotated[Any, Read(_ONE)]], Field(min_length=1, strict=False)]
_LIST = Annotated[
    list[str | int],
    Field(min_length=1, strict=False),
    with_message("a list of groups, or a table: surface = group, or surface = [groups]"),
]
_OF_SURFACES = dict[str, Annotated[Any, Read(_either(list, _SEVERAL, _ONE))]]
#: A list of groups, or surface to group, groups, or tables that choose faces.
SurfaceGroups: TypeAlias = Annotated[Any, Read(_either(dict, _OF_SURFACES, _LIST))]


def made_choice(given: Any) -> Any:
    """Return what the readers of meshes take."""
    if isinstance(given, Mapping):
        return {name: made_choice(wanted) for name, wanted in given.items()}
    if isinstance(given, list):
        return [made_choice(wanted) for wanted in given]
    return given.made() if isinstance(given, Part) else given


def by_place(given: Any) -> bool:
    """Return whether any face is chosen by where it lies."""
    if isinstance(given, Mapping):
        return any(map(by_place, given.values()))
    return any(map(by_place, given)) if isinstance(given, list) else isinstance(given, Part)
