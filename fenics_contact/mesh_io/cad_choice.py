"""Which faces of a CAD model are which surfaces: by name, by number, or by where they lie."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from fenics_contact.checks import checked, unit_vector
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh_io.cad_faces import CadFace
from fenics_contact.mesh_io.tagged_mesh import Label
from fenics_contact.surface_shapes import Cylinder, Plane, Sphere

Vector: TypeAlias = tuple[float, float, float]
#: Largest sine of the angle between directions that count as parallel.
_PARALLEL = 1e-6


@displayed
@dataclass(frozen=True)
@checked()
class InBox:
    """Chooses the faces that lie wholly in a box along the axes.

    Attributes:
        lower: Least coordinates, [length].
        upper: Largest coordinates, [length].
    """

    lower: Vector
    upper: Vector

    def __call__(self, face: CadFace) -> bool:
        """Return whether the face is chosen."""
        above = face.lower >= np.array(self.lower) - face.near
        below = face.upper <= np.array(self.upper) + face.near
        return bool((above & below).all())


@displayed
@dataclass(frozen=True)
@checked()
class OnPlane:
    """Chooses the plane faces that lie in a plane; of a plane part, the straight edges on a line.

    Attributes:
        point: A point of the plane, [length].
        normal: Its normal, to either side; scaled to unit length.
    """

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        """Scale the normal; reject a zero one."""
        object.__setattr__(self, "normal", unit_vector("OnPlane.normal", self.normal, 3))

    def __call__(self, face: CadFace) -> bool:
        """Return whether the face is chosen."""
        shape = face.shape
        if not isinstance(shape, Plane):
            return False
        normal, point = np.array(self.normal)[: shape.dim], np.array([self.point])[:, : shape.dim]
        aside = np.linalg.norm(normal - (normal @ shape.normal) * np.array(shape.normal))
        return bool(aside < _PARALLEL and abs(shape.distance(point)[0]) < face.near)


@displayed
@dataclass(frozen=True)
@checked()
class OnCylinder:
    """Chooses the faces on a cylinder, of holes and of pins; of a plane part, the arcs of a circle.

    Attributes:
        radius: Its radius, [length].
        axis: Direction of its axis, to either side; any unless given.
        point: A point of its axis, [length]; anywhere unless given.
    """

    radius: float
    axis: Vector | None = None
    point: Vector | None = None

    def __post_init__(self) -> None:
        """Scale the axis; reject a zero one."""
        if self.axis is not None:
            object.__setattr__(self, "axis", unit_vector("OnCylinder.axis", self.axis, 3))

    def __call__(self, face: CadFace) -> bool:
        """Return whether the face is chosen."""
        shape = face.shape
        if isinstance(shape, Cylinder):
            axis, centre = np.array(shape.axis), np.array(shape.point)
        elif isinstance(shape, Sphere) and shape.dim == 2:
            axis, centre = np.array([0.0, 0.0, 1.0]), np.array([*shape.centre, 0.0])
        else:
            return False
        wanted = np.array(axis if self.axis is None else self.axis)
        away = np.array(centre if self.point is None else self.point) - centre
        return bool(
            abs(shape.radius - self.radius) < face.near
            and np.linalg.norm(np.cross(axis, wanted)) < _PARALLEL
            and np.linalg.norm(np.cross(away, axis)) < face.near
        )


Chosen: TypeAlias = Label | InBox | OnPlane | OnCylinder | Callable[[CadFace], bool]
"""Name or number of a face or of a group of the file, or what says of a face whether it is chosen."""
FaceChoice: TypeAlias = Sequence[Label] | Mapping[str, Chosen | Sequence[Chosen]]
"""Names or numbers, or surface to what is chosen of the faces for it."""


def chosen_faces(
    faces: Sequence[CadFace], groups: Mapping[Label, Sequence[int]], surfaces: Any, source: str
) -> dict[str, list[int]]:
    """Resolve the caller's choice of surfaces.

    Args:
        faces: All faces.
        groups: Name of a group of the file, or of a face, to numbers of faces.
        surfaces: The choice.
        source: The file, for messages.

    Returns:
        Name of the surface to numbers of its faces.

    Raises:
        InvalidInputError: If a choice finds no face, or two choose the same; the message lists the faces.
    """
    if isinstance(surfaces, str | int):
        surfaces = [surfaces]
    if not isinstance(surfaces, Mapping):
        surfaces = {str(label): label for label in surfaces}
    known = {str(face.number): [face.number] for face in faces} | {str(k): list(v) for k, v in groups.items()}
    found: dict[str, list[int]] = {}
    owner: dict[int, str] = {}
    for name, wanted in surfaces.items():
        several = [wanted] if isinstance(wanted, str | int) or callable(wanted) else wanted
        found[name] = sorted({n for each in several for n in _found(each, name, faces, known, source)})
        for number in found[name]:
            if (other := owner.setdefault(number, name)) != name:
                raise InvalidInputError(
                    f"a face must belong to one surface, face {number} of {source} is chosen for {other!r} "
                    f"and for {name!r}: choose less for one of them. {_listed(faces)}"
                )
    return found


def _found(
    wanted: Chosen, name: str, faces: Sequence[CadFace], known: Mapping[str, list[int]], source: str
) -> list[int]:
    found = [f.number for f in faces if wanted(f)] if callable(wanted) else known.get(str(wanted), [])
    if not found:
        raise InvalidInputError(
            f"surface {name!r} must have a face, none of {source} is {_in_words(wanted)}: {_listed(faces)}"
        )
    return found


def _in_words(wanted: Chosen) -> str:
    if isinstance(wanted, InBox):
        return f"wholly in the box from {wanted.lower} to {wanted.upper}"
    if isinstance(wanted, OnPlane):
        return f"on the plane through {wanted.point} with the normal {wanted.normal}"
    if isinstance(wanted, OnCylinder):
        where = [] if wanted.axis is None else [f" along {wanted.axis}"]
        where += [] if wanted.point is None else [f" through {wanted.point}"]
        return f"on a cylinder of radius {wanted.radius:g}" + (
            f" about the axis{''.join(where)}" * bool(where)
        )
    return "chosen by its function" if callable(wanted) else f"called {wanted!r}"


def _listed(faces: Sequence[CadFace], most: int = 60) -> str:
    """Return all faces in words; of very many the first."""
    more = f"; and {len(faces) - most} more" if len(faces) > most else ""
    return "it has " + "; ".join(face.in_words for face in faces[:most]) + more
