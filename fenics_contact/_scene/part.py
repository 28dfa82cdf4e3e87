"""What each part of a scene answers, and what it asks of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np

from fenics_contact._scene.checks import check_known
from fenics_contact._scene.effects import EffectName
from fenics_contact._surfaces.facets import surface_moments
from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    from fenics_contact._kinematics.base import Kinematics
    from fenics_contact._scene.body import Body


class Around(Protocol):
    """What a part needs to know of its scene."""

    @property
    def bodies(self) -> Mapping[str, Body]:
        """Bodies by name."""

    @property
    def kinematics(self) -> Kinematics:
        """The kinematics of its bodies, which are all alike."""

    @property
    def supports(self) -> Sequence[Any]:
        """What holds them."""

    @property
    def ties(self) -> Sequence[Any]:
        """Pairs that stay together."""

    @property
    def deforms_much(self) -> bool:
        """Whether one of its bodies does."""

    @property
    def is_nonlinear(self) -> bool:
        """Whether some material's stress is no linear function of the displacement."""


class Part:
    """A load, a support, a pair or another part: the scene asks all of them alike.

    Attributes:
        effect: The physical effect that it calls for.
    """

    effect: ClassVar[EffectName]

    def check(self, scene: Around) -> None:
        """Reject a part that does not suit the bodies of its scene."""

    def in_scene(self, scene: Around) -> Self:
        """Return the part as its scene holds it, with all that follows from the kinematics."""
        return self

    def effects(self, scene: Around) -> tuple[EffectName, ...]:
        """Return the physical effects that the part calls for."""
        return (self.effect,)


def centroid(scene: Around, body: str, surface: str) -> np.ndarray:
    """Return the centroid of a surface, of a node set the mean of its points, shape (dim,)."""
    mesh = scene.bodies[body].mesh
    if surface in mesh.node_sets:
        return np.asarray(mesh.points[mesh.node_sets[surface]].mean(axis=0))
    return surface_moments(mesh.points, mesh.surfaces[surface], scene.kinematics.measure).centroid


def body_of(scene: Around, name: str, user: str) -> Body:
    """Return a body by its name."""
    check_known(name, scene.bodies, f"{user} names body {name!r}, the scene has")
    return scene.bodies[name]


def require_surface(scene: Around, body: str, surface: str, user: str) -> None:
    """Reject a surface that is not there."""
    known = body_of(scene, body, user).mesh.surfaces
    check_known(surface, known, f"{user} names surface {surface!r} of body {body!r}, which has")


def require_nodes(scene: Around, body: str, name: str, user: str) -> None:
    """Reject a name of neither a surface nor a node set."""
    mesh = body_of(scene, body, user).mesh
    if name not in mesh.node_sets:
        require_surface(scene, body, name, user)


def require_linear(scene: Around, user: str, remedy: str) -> None:
    """Reject a scene in which some material is nonlinear."""
    if scene.is_nonlinear:
        raise InvalidInputError(f"{user} needs linear materials in all bodies: {remedy}")


def require_vector(value: object, count: int, words: str, user: str, body: str) -> None:
    """Reject a vector of numbers for another number of components."""
    if isinstance(value, tuple) and len(value) != count:
        raise InvalidInputError(
            f"{user}.value of body {body!r} must hold {words}, got {value!r}: give {count} of them"
        )
