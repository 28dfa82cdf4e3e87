"""Bodies that nothing keeps from passing through each other, for want of a pair or of a larger surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.display import counted
from fenics_contact.mesh import BodyMesh, boundary_faces, cell_type_of, corners_of, vector_areas
from fenics_contact.scene.kernels import rigid_body_modes
from fenics_contact.scene.pairs import ContactPair, Surface, Tie

if TYPE_CHECKING:
    from fenics_contact.scene.parts import SceneParts

#: Part of a facet within which surfaces touch, and by which they overlap before loads more than facets do.
TOUCHING, OVERLAPPING = 1e-3, 0.05
#: Part of the largest displacement by which a facet counts as inside another body.
DEEP = 1e-3
#: Barycentric coordinates down to this are inside.
ROUNDING = -1e-12

#: The boundary of a body, in linear facets, with the cell behind each, and its inside, in simplices.
Outline: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Unpaired:
    """Two bodies that no pair or tie keeps apart, or whose surfaces of these are too small.

    Attributes:
        bodies: Their names.
        paired: Whether a pair or tie names surfaces of both.
        counts: Facets outside of these surfaces that touch the other body before loads, those that lie in it,
            and those that displacements move into it.
    """

    bodies: tuple[str, str]
    paired: bool
    counts: tuple[int, int, int]

    def in_words(self, entering: str = "pass into each other") -> str:
        """Return what is wrong and what to do, or "" if nothing is."""
        touching, overlapping, entered = self.counts
        if self.paired:
            touching = 0
        count, what = next(
            (each for each in ((entered, entering), (overlapping, "overlap unloaded")) if each[0]),
            (touching, "touch"),
        )
        if not count:
            return ""
        where, mend = (
            ("outside the surfaces of their pairs and ties", "name more of their facets in these")
            if self.paired
            else (
                "without a pair or tie between them",
                "add a ContactPair or a Tie, or take AutomaticContact()",
            )
        )
        one, other = self.bodies
        return f"bodies {one!r} and {other!r} {what} at {counted(count, 'facet')}, {where}: {mend}"


def outline_of(mesh: BodyMesh) -> Outline:
    """Return the boundary and the inside of a body, which depend on its cells alone."""
    cells = mesh.linear.cells
    facets, behind = boundary_faces(cells, mesh.dim)
    return facets, cells[behind], cells[:, cell_type_of(cells, mesh.dim).simplices].reshape(-1, mesh.dim + 1)


def unpaired_bodies(scene: SceneParts) -> tuple[str, ...]:
    """Return in words which bodies nothing keeps apart, unloaded or where supports move them as if rigid.

    Bodies with a pair are looked at unloaded, as it keeps them from moving as if rigid.
    """
    moved = {name: _moved_by_supports(scene, name) for name in scene.body_names}
    reach = max(float(np.linalg.norm(each, axis=1).max()) for each in moved.values())
    near = bodies_near(scene, reach)
    names = {name for both in near for name in both}
    outlines = {name: outline_of(scene.bodies[name].mesh) for name in names}
    found = (unpaired(scene, both, outlines, moved, reach) for both in near)
    entering = "pass into each other as their supports move them"
    told = (replace(each, counts=(*each.counts[:2], 0)) if each.paired else each for each in found)
    return tuple(words for each in told if (words := each.in_words(entering)))


def bodies_near(scene: SceneParts, reach: float) -> list[tuple[str, str]]:
    """Return the bodies whose bounding boxes meet, where each moves by no more than a reach, [length]."""
    boxes = {
        name: (body.mesh.points.min(axis=0) - reach, body.mesh.points.max(axis=0) + reach)
        for name, body in scene.bodies.items()
    }
    slack = TOUCHING * max(float(np.max(high - low)) for low, high in boxes.values())

    def meet(one: str, other: str) -> bool:
        return bool((boxes[one][0] <= boxes[other][1] + slack).all())

    return [(a, b) for a, b in combinations(boxes, 2) if meet(a, b) and meet(b, a)]


def unpaired(
    scene: SceneParts,
    both: tuple[str, str],
    outlines: Mapping[str, Outline],
    moved: Mapping[str, np.ndarray],
    reach: float,
    share: slice = slice(None),
) -> Unpaired:
    """Count the facets of two bodies that nothing keeps out of each other.

    Only facets outside of the surfaces that pairs and ties of the two name are looked for in the cells of the
    other. Those that go there behind a named surface are left out: how far that passes is the pair's matter.

    Args:
        scene: The scene.
        both: Names of the bodies.
        outlines: Body name -> its boundary and inside.
        moved: Body name -> displacement of its nodes, shape (n_nodes, dim), [length].
        reach: The largest displacement of all bodies, [length].
        share: Which of the facets are looked at, for ranks to share them.
    """
    named = _named(scene, both)
    counts, deep = np.zeros(3, dtype=int), DEEP * reach
    for body, into in (both, both[::-1]):
        before, wall = scene.bodies[body].mesh.points, scene.bodies[into].mesh.points
        facets, behind, _ = outlines[body]
        mine = np.isin(facets, named[body]).all(axis=1)
        own, mine = facets[mine], np.flatnonzero(~mine)[share]
        facets, behind, inside = facets[mine], behind[mine], outlines[into][2]
        size = np.ptp(before[facets], axis=1).max(axis=1)
        here, there = _Facets.of(before, facets, behind), _Facets.of(before + moved[body], facets, behind)
        passed = wall + moved[into]
        touching = here.within(TOUCHING * size, wall, inside)
        overlapping = here.within(-OVERLAPPING * size, wall, inside)
        overlapping &= ~here.follow(_Facets.of(before, own), overlapping, wall, inside)
        entered = there.within(-deep, passed, inside) & ~here.within(-deep, wall, inside)
        entered &= ~there.follow(_Facets.of(before + moved[body], own), entered, passed, inside)
        counts += [np.count_nonzero(each) for each in (touching, overlapping, entered)]
    return Unpaired(both, any(len(nodes) for nodes in named.values()), tuple(counts.tolist()))


def _moved_by_supports(scene: SceneParts, name: str) -> np.ndarray:
    """Return the rigid motion of a body's nodes nearest to what its supports prescribe, (n_nodes, dim)."""
    points = scene.bodies[name].mesh.points
    modes = rigid_body_modes(points)
    prescribed = scene.prescribed(name)
    given = ~np.isnan(prescribed)
    motion = np.linalg.lstsq(modes[given], prescribed[given], rcond=None)[0]
    return np.asarray(modes @ motion)


def _named(scene: SceneParts, both: tuple[str, str]) -> dict[str, np.ndarray]:
    """Return for each of two bodies its nodes on surfaces of the pairs and ties between them."""
    nodes: dict[str, list[np.ndarray]] = {name: [] for name in both}
    pairs: list[ContactPair | Tie] = [*scene.contacts, *scene.ties]
    for pair in pairs:
        sides = [side for side in (pair.slave, pair.master) if isinstance(side, Surface)]
        if {side.body for side in sides} == set(both):
            for side in sides:
                nodes[side.body].append(np.unique(scene.bodies[side.body].mesh.surfaces[side.name]))
    return {name: np.concatenate([*found, np.zeros(0, dtype=np.int64)]) for name, found in nodes.items()}


@dataclass(frozen=True, eq=False)
class _Facets:
    """Facets of a body.

    Attributes:
        middle: Shape (n, dim), [length].
        normal: Outwards, of unit length, shape (n, dim).
        depth: How far they are from the middles of their cells, shape (n,), [length].
    """

    middle: np.ndarray
    normal: np.ndarray
    depth: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, facets: np.ndarray, cells: np.ndarray | None = None) -> _Facets:
        """Return facets, with the cells behind them, given by their nodes."""
        area = vector_areas(points, facets)
        normal = area / np.linalg.norm(area, axis=1)[:, None]
        middle = points[corners_of(facets, points.shape[1])].mean(axis=1)
        inner = middle if cells is None else points[cells].mean(axis=1)
        return cls(middle, normal, np.einsum("nd,nd->n", middle - inner, normal))

    def within(self, out: np.ndarray | float, wall: np.ndarray, simplices: np.ndarray) -> np.ndarray:
        """Return which middles, moved outwards, are inside a body; inwards only as far as their cells go."""
        places = self.middle + np.maximum(out, -self.depth)[:, None] * self.normal
        found: np.ndarray = ((places >= wall.min(axis=0)) & (places <= wall.max(axis=0))).all(axis=1)
        if found.any():
            found[found] = _in_simplices(places[found], wall, simplices)
        return found

    def follow(
        self, leading: _Facets, chosen: np.ndarray, wall: np.ndarray, simplices: np.ndarray
    ) -> np.ndarray:
        """Return which of the chosen facets are behind leading ones that go as deep into a body as they do.

        Those beside them, in one surface with them, lead themselves.
        """
        found = np.zeros(len(chosen), dtype=bool)
        at = np.flatnonzero(chosen)
        if len(at) and len(leading.middle):
            near = cKDTree(leading.middle).query(self.middle[at])[1]
            middle, normal = leading.middle[near], leading.normal[near]
            behind = np.maximum(np.einsum("nd,nd->n", middle - self.middle[at], normal), 0.0)
            found[at] = np.einsum("nd,nd->n", self.normal[at], normal) < 0.5
            found[at] &= _in_simplices(middle - behind[:, None] * normal, wall, simplices)
        return found


def _in_simplices(places: np.ndarray, points: np.ndarray, simplices: np.ndarray) -> np.ndarray:
    """Return which places are in simplices, (n,)."""
    low, high = places.min(axis=0), places.max(axis=0)
    for axis in np.argsort((high - low) / np.ptp(points, axis=0)):  # what leaves out most comes first
        along = points[simplices.T, axis]
        simplices = simplices[(along.min(axis=0) <= high[axis]) & (along.max(axis=0) >= low[axis])]
    inside = np.zeros(len(places), dtype=bool)
    if not len(simplices):
        return inside
    corners = points[simplices]
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
