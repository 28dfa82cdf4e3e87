"""Surfaces that a design may move: crowns of chain links, sides of meshes, curves of plane ones."""

from __future__ import annotations

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface, side_of
from fenics_contact.scene_file.placing import Shaped


def design_surface(shape: Shaped, surface: str, body: str) -> DesignSurface:
    """Return a surface with its smooth coordinates.

    Args:
        shape: The body's mesh with its shape.
        surface: "contact" of a chain link, a side of a structured mesh, or a curve of a plane one.
        body: Name of the body, for messages.

    Raises:
        InvalidInputError: If the surface is neither.
    """
    if shape.crown is not None and surface == "contact":
        return shape.crown
    try:
        return side_of(shape.mesh, surface)
    except InvalidInputError as error:
        raise InvalidInputError(f"body {body!r}: {error}") from error
