"""Bodies of a scene from the meshes of a file, materials by name."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import BodyMesh
from fenics_contact.scene.body import Body
from fenics_contact.scene.materials import Material

OfBody = Material | Mapping[str, Material]
"""A material, or a mapping from region to material."""


def bodies_from(
    meshes: Mapping[str, BodyMesh], materials: Material | Mapping[str, OfBody]
) -> dict[str, Body]:
    """Give the meshes of a file their materials.

    Example:
        >>> meshes = read_msh("chain.msh")  # doctest: +SKIP
        >>> of = {"link *": steel, "pin": {"core": steel, "coat": zinc}}  # doctest: +SKIP
        >>> bodies = bodies_from(meshes, of)  # doctest: +SKIP

    Args:
        meshes: Name to mesh.
        materials: One material for all bodies; or name of the body, or pattern of names with ``*`` and ``?``,
            to its material, or to a mapping from its regions to theirs. Names take precedence over patterns,
            earlier patterns over later ones.

    Returns:
        Name to body, in the order of the meshes.

    Raises:
        InvalidInputError: If a body has no material, or a material no body.
    """
    if not isinstance(materials, Mapping):
        return {name: Body(mesh, materials) for name, mesh in meshes.items()}
    chosen = {}
    for name in meshes:
        fitting = [key for key in materials if key == name] or [k for k in materials if fnmatchcase(name, k)]
        if not fitting:
            raise InvalidInputError(
                f"every body must have a material, {name!r} has none of {list(materials)}: name it, or give "
                "a pattern such as 'link *' or '*'"
            )
        chosen[name] = fitting[0]
    for key in materials:
        if key not in chosen.values():
            raise InvalidInputError(
                f"materials must be those of bodies, {key!r} matches none of {list(meshes)}: check its "
                "spelling, or leave it out"
            )
    return {name: Body(mesh, materials[chosen[name]]) for name, mesh in meshes.items()}
