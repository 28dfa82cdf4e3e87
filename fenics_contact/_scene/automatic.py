"""Contact pairs that a scene finds itself: surfaces of bodies that may meet others or themselves."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.checks import checked
from fenics_contact._base.display import displayed
from fenics_contact._scene.body import Body
from fenics_contact._scene.checks import check_known, check_positive
from fenics_contact._scene.corners import exchanged, is_held, with_corner_as_slave
from fenics_contact._scene.pairs import AnyDiscretisation, ContactPair, Friction, Surface
from fenics_contact._scene.surface_laws import ClosureLaw, check_closing
from fenics_contact._surfaces.true_surface import Geometry
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import safe_log
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import corners_of
from fenics_contact.mesh.near_surfaces import near_surfaces

if TYPE_CHECKING:
    from fenics_contact._scene.parts import SceneParts


_LOG = logging.getLogger(__name__)


@displayed
@dataclass(frozen=True)
@checked()
class AutomaticContact(Sequence[ContactPair]):
    """Contact wherever boundaries of different bodies face each other, in place of a scene's contact pairs.

    The scene looks for facets that face another body within a distance, names them "near B" on A and "near
    A" on B, and makes a pair of them; look at ``scene.contacts`` and at pictures before trusting it. The
    slave is the side with linear cells if the other one has quadratic ones, else that with the smaller
    facets; between facets alike to a tenth, that of the softer body. A side that touches first with a corner
    or an edge, of which no face lies flat on the other side, is the slave. One whose nodes are all held is
    the master. Bodies named in ``self_contact`` may meet themselves wherever
    they fold.

    Attributes:
        friction: The law of all pairs, see `ContactPair`.
        distance: Largest distance across the gap, and how far beyond the facets found so the surfaces reach,
            [length]; by default the size of a facet and the largest displacement that supports prescribe.
            Bodies that loads move farther need more.
        discretisation: As in `ContactPair`.
        geometry: As in `ContactPair`.
        self_contact: Bodies of materials for large deformations that may meet themselves, by nodes. Each gets
            a surface "boundary", all of its facets, that is slave and master at once.
        closure: The law of closure of all pairs, see `ContactPair`. Fluid that enters needs an inlet on the
            slave, so pairs with a fluid are named.

    Raises:
        InvalidInputError: If the distance is not positive; when the scene is made, if it finds no pair, or
            has no body of a name in ``self_contact``.

    Example:
        >>> from fenics_contact.gallery import block
        >>> from fenics_contact import Coulomb, Scene, Support
        >>> from fenics_contact.materials import IsotropicElasticity
        >>> steel = IsotropicElasticity(2.1e5, 0.3)  # N/mm²
        >>> bodies = {
        ...     "plate": Body(block((0, 0, 0), (3, 3, 1), (3, 3, 1)), steel),  # mm
        ...     "punch": Body(block((1, 1, 1), (2, 2, 2), (4, 4, 4)), steel),
        ... }
        >>> scene = Scene(bodies, [Support("plate", "z0")], contacts=AutomaticContact(Coulomb(0.2)))
        >>> [pair.place for pair in scene.contacts]
        ['punch near plate on plate near punch']
    """

    friction: Friction = None
    distance: float | None = None
    discretisation: AnyDiscretisation = "best"
    geometry: Geometry = "best"
    self_contact: tuple[str, ...] = ()
    closure: ClosureLaw | None = None

    def __post_init__(self) -> None:
        """Raise unless the distance is positive and finite, and the closure rises with the pressure."""
        if self.distance is not None:
            remedy = "give the largest gap that may close, or None"
            check_positive("AutomaticContact.distance", self.distance, remedy)
        if self.closure is not None:
            check_closing(self.closure)

    def __len__(self) -> int:
        """Return zero: a scene replaces it by the pairs that it finds."""
        return 0

    @overload
    def __getitem__(self, index: int) -> ContactPair: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[ContactPair]: ...
    def __getitem__(self, index: Any) -> Any:
        """Return a pair; there are none before a scene finds them."""
        return ()[index]

    def found(self, scene: SceneParts) -> tuple[dict[str, Body], tuple[ContactPair, ...]]:
        """Return the bodies of a scene with the surfaces that may meet, and the pairs of these.

        Raises:
            InvalidInputError: If there are none.
        """
        meshes = {name: body.mesh for name, body in scene.bodies.items()}
        size, motion = max(map(_facet_size, meshes.values())), _largest_motion(scene)
        distance = size + motion if self.distance is None else self.distance
        named, near = near_surfaces(meshes, distance, along=distance)
        if not near and not self.self_contact:
            raise InvalidInputError(_nothing_found(meshes, distance))
        named |= {name: self._with_boundary(named, name) for name in self.self_contact}
        bodies = {name: replace(body, mesh=named[name]) for name, body in scene.bodies.items()}
        with_surfaces = replace(scene, bodies=bodies, contacts=())
        pairs = tuple(self._pair(with_surfaces, *names) for names in near)
        for whole in (Surface(name, "boundary") for name in self.self_contact):
            pairs += (ContactPair(whole, whole, self.friction, geometry=self.geometry, closure=self.closure),)
        words = "%d contact pairs are found within a distance of %.4g: %s"
        safe_log(_LOG.info, words, len(pairs), distance, "; ".join(pair.place for pair in pairs))
        return bodies, pairs

    def _with_boundary(self, meshes: dict[str, BodyMesh], name: str) -> BodyMesh:
        """Return a body that has a surface "boundary"."""
        words = f"AutomaticContact.self_contact names body {name!r}, the scene has"
        check_known(name, meshes, words)
        mesh = meshes[name]
        if "boundary" in mesh.surfaces:
            raise InvalidInputError(
                f"body {name!r} must have no surface 'boundary' yet, as AutomaticContact.self_contact names "
                "all of its facets so: rename it"
            )
        facets, _ = mesh.boundary
        return replace(mesh, surfaces={**mesh.surfaces, "boundary": facets})

    def _pair(self, scene: SceneParts, one: str, other: str) -> ContactPair:
        """Return the pair of two bodies with the better slave."""
        from fenics_contact._scene.pair_geometry import master_share

        sides = Surface(one, f"near {other}"), Surface(other, f"near {one}")
        pair = ContactPair(*sides, self.friction, self.discretisation, self.geometry, closure=self.closure)
        sizes = [_size(scene.bodies[side.body].mesh, side.name) for side in sides]
        held = [is_held(scene, side) for side in sides]
        alike = max(sizes) <= 1.1 * min(sizes)
        other_is_better = master_share(scene, pair) > 0.5 if alike else sizes[1] < sizes[0]
        orders = [scene.bodies[side.body].mesh.order for side in sides]
        if orders[0] != orders[1]:  # what a linear master cannot follow, a quadratic slave presses on
            other_is_better = orders[1] < orders[0]
        if held[0] != held[1]:  # nodes that cannot move carry no multipliers
            other_is_better = held[0]
        return with_corner_as_slave(scene, exchanged(pair) if other_is_better else pair)


def _facet_size(mesh: BodyMesh) -> float:
    """Return the mean size of the facets of a body's boundary, [length]."""
    return _mean_size(mesh.points[corners_of(mesh.boundary[0], mesh.dim)])


def _size(mesh: BodyMesh, surface: str) -> float:
    """Return the mean size of the facets of a surface, [length]."""
    return _mean_size(mesh.points[corners_of(mesh.surfaces[surface], mesh.dim)])


def _mean_size(corners: np.ndarray) -> float:
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def _largest_motion(scene: SceneParts) -> float:
    """Return the largest displacement that supports prescribe, [length]."""
    return max([0.0, *(support.largest_motion(scene) for support in scene.supports)])


def _nothing_found(meshes: dict[str, BodyMesh], distance: float) -> str:
    if len(meshes) < 2:
        return (
            "Automatic contact needs two bodies, the scene has one: name the pairs in which it meets "
            "obstacles, or the body in self_contact if it may meet itself"
        )
    names, gaps = list(meshes), []
    for n, name in enumerate(names):
        tree = cKDTree(meshes[name].points)
        gaps += [float(tree.query(meshes[other].points)[0].min()) for other in names[n + 1 :]]
    return (
        f"Automatic contact needs bodies that face each other within its distance, {distance:.6g}, and finds "
        f"none; the nearest nodes of two bodies are {min(gaps):.6g} apart: give a larger distance, name the "
        "pairs, or leave contacts out"
    )
