"""Bodies: which mesh, of what."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, PlainValidator, WithJsonSchema

from fenics_contact.scene_file.values import Part, needs


def _materials(value: Any) -> str | dict[str, str]:
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping) and value and all(isinstance(name, str) for name in value.values()):
        return dict(value)
    raise needs("the name of a material, or a table: region = material")


_JSON = {"anyOf": [{"type": "string"}, {"type": "object", "additionalProperties": {"type": "string"}}]}


class BodyPart(Part):
    """A body: a mesh and what it is made of."""

    mesh: str = Field(description="name of a mesh of [meshes]")
    part: str | None = Field(
        None, description="which body of a mesh that has several, such as a group of a file"
    )
    material: Annotated[str | dict[str, str], PlainValidator(_materials), WithJsonSchema(_JSON)] = Field(
        description="name of a material of [materials], or one for each region of the mesh"
    )
