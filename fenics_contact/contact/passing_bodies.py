"""Bodies that nothing keeps from passing through each other, for want of a pair or of a larger surface."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.contact.state import State
from fenics_contact.errors import tell, together
from fenics_contact.mesh import BodyMesh, boundary_faces, corners_of, vector_areas
from fenics_contact.scene import ContactPair, Scene, Surface, Tie

_LOG = logging.getLogger(__name__)
#: Part of a facet within which surfaces touch, and by which they overlap before loads more than facets do.
TOUCHING, OVERLAPPING = 1e-3, 0.05
#: Part of the largest displacement by which a facet counts as inside another body.
DEEP = 1e-3
#: Barycentric coordinates down to this are inside.
ROUNDING = -1e-12
#: Simplices that make up linear cells, by dimension and number of vertices.
_SIMPLICES = {
    (2, 3): [[0, 1, 2]],
    (2, 4): [[0, 1, 2], [0, 2, 3]],
    (3, 4): [[0, 1, 2, 3]],
    (3, 8): [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
}


@dataclass(frozen=True, eq=False)
class _Outside:
    """The boundary of a body, in linear facets, and its inside, in simplices."""

    facets: np.ndarray
    simplices: np.ndarray

    @classmethod
    def of(cls, mesh: BodyMesh) -> _Outside:
        cells = mesh.linear.cells
        facets, _ = boundary_faces(cells, mesh.dim)
        pieces = np.array(_SIMPLICES[mesh.dim, cells.shape[1]])
        return cls(facets, cells[:, pieces].reshape(-1, mesh.dim + 1))


class PassingBodies:
    """Bodies that touch, overlap or pass through each other unseen; each two are warned of once."""

    def __init__(self) -> None:
        """Start without any."""
        self._outsides: dict[str, tuple[BodyMesh, _Outside]] = {}
        self._told: set[tuple[str, str]] = set()

    def warn(self, state: State) -> None:
        """Warn of bodies with facets in one another, or that touch without a pair or tie. Collective.

        Only bodies whose bounding boxes come near each other are gathered, and only facets outside of the
        surfaces that pairs and ties of the two bodies name are looked for in the cells of the other.

        Args:
            state: The state; places before and after its loads are compared.
        """
        scene, comm = state.scene, state.torn.decomposition.comm
        moved = state.torn_displacement.reshape(-1, scene.dim)
        reach = max(comm.allgather(float(np.linalg.norm(moved, axis=1).max(initial=0.0))))
        near = _near(scene, reach)
        names = sorted({name for both in near for name in both})
        displacement = {name: state.gather_displacement(name) for name in names}
        with together(comm):
            for both in near if comm.rank == 0 else ():
                if both not in self._told and (words := self._words(scene, both, displacement, DEEP * reach)):
                    self._told.add(both)
                    tell(_LOG.warning, "%s", words)

    def _words(
        self, scene: Scene, both: tuple[str, str], moved: Mapping[str, np.ndarray], deep: float
    ) -> str:
        """Return what is wrong between two bodies, or ""."""
        one, other = both
        named = _named(scene, both)
        touching, overlapping, entered = 0, 0, 0
        for body, into in (both, both[::-1]):
            before, wall = scene.bodies[body].mesh.points, scene.bodies[into].mesh.points
            outside, inside = self._outside(scene, body), self._outside(scene, into).simplices
            facets = outside.facets[~np.isin(outside.facets, named[body]).all(axis=1)]
            size = np.ptp(before[facets], axis=1).max(axis=1)
            touching += np.count_nonzero(_within(before, facets, TOUCHING * size, wall, inside))
            overlapping += np.count_nonzero(_within(before, facets, -OVERLAPPING * size, wall, inside))
            after = _within(before + moved[body], facets, -deep, wall + moved[into], inside)
            entered += np.count_nonzero(after & ~_within(before, facets, -deep, wall, inside))
        paired = any(len(nodes) for nodes in named.values())
        where, mend = (
            ("outside the surfaces of their pairs and ties", "name more of their facets in these")
            if paired
            else ("without a pair or tie between them", "add a ContactPair or a Tie, or take Automatic()")
        )
        if entered:
            return f"{entered} facets of bodies {one!r} and {other!r} pass into each other, {where}: {mend}"
        if overlapping:
            return f"{overlapping} facets of bodies {one!r} and {other!r} overlap unloaded, {where}: {mend}"
        if touching and not paired:
            return f"{touching} facets of bodies {one!r} and {other!r} touch, {where}: {mend}"
        return ""

    def _outside(self, scene: Scene, name: str) -> _Outside:
        """Return the boundary of a body, which meshes of the same cells share."""
        mesh = scene.bodies[name].mesh
        known = self._outsides.get(name)
        if known is None or known[0].cells is not mesh.cells:
            known = self._outsides[name] = (mesh, _Outside.of(mesh))
        return known[1]


def _near(scene: Scene, reach: float) -> list[tuple[str, str]]:
    """Return the bodies whose bounding boxes meet, where each moves by no more than a reach."""
    boxes = {
        name: (body.mesh.points.min(axis=0) - reach, body.mesh.points.max(axis=0) + reach)
        for name, body in scene.bodies.items()
    }
    slack = TOUCHING * max(float(np.max(high - low)) for low, high in boxes.values())

    def meet(one: str, other: str) -> bool:
        return bool((boxes[one][0] <= boxes[other][1] + slack).all())

    return [(a, b) for a, b in combinations(boxes, 2) if meet(a, b) and meet(b, a)]


def _named(scene: Scene, both: tuple[str, str]) -> dict[str, np.ndarray]:
    """Return for each of two bodies its nodes on surfaces of the pairs and ties between them."""
    nodes: dict[str, list[np.ndarray]] = {name: [] for name in both}
    pairs: list[ContactPair | Tie] = [*scene.contacts, *scene.ties]
    for pair in pairs:
        sides = [side for side in (pair.slave, pair.master) if isinstance(side, Surface)]
        if {side.body for side in sides} == set(both):
            for side in sides:
                nodes[side.body].append(np.unique(scene.bodies[side.body].mesh.surfaces[side.name]))
    return {name: np.concatenate([*found, np.zeros(0, dtype=np.int64)]) for name, found in nodes.items()}


def _within(
    points: np.ndarray, facets: np.ndarray, out: np.ndarray | float, wall: np.ndarray, simplices: np.ndarray
) -> np.ndarray:
    """Return which facets' middles, moved outwards by a distance, are inside the simplices of a body."""
    found = np.zeros(len(facets), dtype=bool)
    if not len(facets):
        return found
    area = vector_areas(points, facets)
    places = points[corners_of(facets, points.shape[1])].mean(axis=1)
    places += np.reshape(out, (-1, 1)) * area / np.linalg.norm(area, axis=1)[:, None]
    here = np.flatnonzero(((places >= wall.min(axis=0)) & (places <= wall.max(axis=0))).all(axis=1))
    if len(here):
        found[here] = _in_simplices(places[here], wall, simplices)
    return found


def _in_simplices(places: np.ndarray, points: np.ndarray, simplices: np.ndarray) -> np.ndarray:
    """Return which places are in simplices, (n,)."""
    corners = points[simplices]
    low, high = places.min(axis=0), places.max(axis=0)
    corners = corners[((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)]
    inside = np.zeros(len(places), dtype=bool)
    if not len(corners):
        return inside
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    close = cKDTree(places).query_ball_point(middle, radius)
    count = np.array([len(each) for each in close])
    place = np.concatenate([*close, np.zeros(0)]).astype(np.int64)
    start, sides = corners[:, 0], np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    simplex = np.repeat(np.arange(len(corners)), count)
    full = np.abs(np.linalg.det(sides)) > 0.0
    kept = full[simplex]
    place, simplex = place[kept], simplex[kept]
    rest = np.linalg.solve(sides[simplex], (places[place] - start[simplex])[..., None])[..., 0]
    inside[place[np.minimum(rest.min(axis=1), 1.0 - rest.sum(axis=1)) >= ROUNDING]] = True
    return inside
