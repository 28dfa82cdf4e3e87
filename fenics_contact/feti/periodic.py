"""Contact at edges of periodic bodies: of points that equations move alike, one carries the force.

Two points are one if equations move their slave nodes alike, and what these nodes meet along the same way,
or if the rows of their jumps are equal but for a sum of equations. Both would have a point, their forces
would be split at will, and friction would follow. By mortar their rows are means over different facets, on
either side of the edge: the row of the one point is the mean over both sides, as of any node inside a
surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import SuperLU

from fenics_contact._base.sparse import ROUNDING
from fenics_contact._pairing.points import HELD, PARALLEL, ContactPoints
from fenics_contact._scene.scene import Scene
from fenics_contact.feti.constraints import ConstraintRows, factored


class PeriodicRows(ConstraintRows):
    """Rows of linear constraints, which may move points of contacts and ties as others."""

    def once(
        self, points: ContactPoints, ties: ContactPoints, scene: Scene, prescribed: np.ndarray
    ) -> tuple[ContactPoints, ContactPoints]:
        """Return points without those that equations move as others."""
        ties = once_at_periodic_edges(ties, self, scene, prescribed, areas=False)
        return once_at_periodic_edges(points, self, scene, prescribed), ties


def once_at_periodic_edges(
    points: ContactPoints,
    constraints: ConstraintRows,
    scene: Scene,
    prescribed: np.ndarray,
    *,
    areas: bool = True,
) -> ContactPoints:
    """Return points without those that equations move as others; with `areas` these get theirs.

    Of several the first by its place stays, whatever the numbers of nodes.
    """
    from fenics_contact._pairing.sectors import without_repeated

    one, other = _candidates(points, constraints, len(scene.contacts if areas else scene.ties))
    if len(one) == 0 or constraints.count == 0:
        return points
    rubs = [pair.has_friction for pair in scene.contacts] if areas else [True] * len(scene.ties)
    across, slides = _Across.of(constraints, scene, prescribed), np.array(rubs)[points.pair[one]]
    equal = _equal(points, scene.points[points.slave], across, (one, other), slides)
    joined = _joined(points, scene.points, across, (one, other), slides)
    same = equal | joined
    links = sp.coo_matrix((np.ones(same.sum()), (one[same], other[same])), shape=(points.count,) * 2)
    _, number = connected_components(links, directed=False)
    place = np.round(scene.points[points.slave] / (1e-3 * np.ptp(scene.points[points.slave], axis=0).max()))
    order = np.lexsort((*place.T, number))
    first = order[np.r_[True, np.diff(number[order]) != 0]]  # by number, which are all there
    lost = np.setdiff1d(np.arange(points.count), first)
    entries = np.ones(len(lost)), (np.arange(len(lost)), first[number[lost]])
    onto = sp.csr_matrix(entries, shape=(len(lost), points.count))
    points = _over_both_sides(points, first[number], np.unique(number[one[joined & ~equal]]), number)
    return without_repeated(points, scene, lost, onto, areas=areas)


def _candidates(
    points: ContactPoints, constraints: ConstraintRows, pairs: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return points of one of the first pairs whose slave nodes, and no others of it, share an equation."""
    width = constraints.components
    onto = sp.kron(sp.identity(points.master.shape[1]), np.ones((width, 1)), format="csr")
    acts = (abs(constraints.equations) @ onto > 0).tocsc()
    found = [np.zeros((0, 2), dtype=np.int64)]
    for pair in range(pairs):
        mine = np.flatnonzero(points.pair == pair)
        own = acts[:, points.slave[mine]].tocsr()
        two = own[np.flatnonzero(np.diff(own.indptr) == 2)]
        found.append(np.unique(mine[two.indices.reshape(-1, 2)], axis=0))
    one, other = np.concatenate(found).T
    return one, other


@dataclass(frozen=True, eq=False)
class _Across:
    """What equations leave of rows of nodes, with the motions that they prescribe along these.

    `right`: right sides of the equations less what supports prescribe; `known`: prescribed displacements of
    nodes.
    """

    constraints: ConstraintRows
    factor: SuperLU
    right: np.ndarray
    known: np.ndarray
    at_once: int = 256

    @classmethod
    def of(cls, constraints: ConstraintRows, scene: Scene, prescribed: np.ndarray) -> _Across:
        """Factor the equations of a scene."""
        right = constraints.right(scene, prescribed) - constraints.of_supports(prescribed)
        factor = factored((constraints.free @ constraints.free.T).tocsr())
        return cls(constraints, factor, right, constraints.moved(prescribed))

    def __call__(self, weights: sp.csr_matrix) -> tuple[sp.csr_matrix, np.ndarray]:
        """Return weights of nodes on free components across all equations, and what these make of them.

        Returns shape (n · components, n_nodes · components), and (n, components), [length].
        """
        free, width = self.constraints.free, self.constraints.components
        rows = sp.kron(weights, sp.identity(width), format="csr")
        moved = rows @ self.known
        rows, parts = (rows @ self.constraints.projection).tocsr(), [sp.csr_matrix((0, rows.shape[1]))]
        for start in range(0, rows.shape[0], self.at_once):
            some = rows[start : start + self.at_once]
            made = self.factor.solve((free @ some.T).toarray()).T
            made[np.abs(made) <= ROUNDING * np.abs(made).max(initial=0.0)] = 0.0
            parts.append(some - sp.csr_matrix(made) @ free)
            moved[start : start + self.at_once] += made @ self.right
        return sp.vstack(parts, format="csr"), moved.reshape(-1, width)

    def determined(self, weights: sp.csr_matrix) -> tuple[np.ndarray, np.ndarray]:
        """Return which weighted displacements equations and supports determine, (n,), and these as above."""
        rows, moved = self(weights)
        left = np.asarray(rows.multiply(rows).sum(axis=1)).reshape(moved.shape).sum(axis=1)
        return left <= HELD**2 * np.asarray(weights.multiply(weights).sum(axis=1)).ravel(), moved


def _equal(
    points: ContactPoints,
    places: np.ndarray,
    across: _Across,
    both: Sequence[np.ndarray],
    rubs: np.ndarray,
    same_place: float = 1.0 - 1e-6,
) -> np.ndarray:
    """Return which points have the same rows and gaps as others, shape (n,).

    `both`: numbers of points and of others; `rubs`: whether both must slip alike, too; `same_place`: cosine
    between rows less what equations make of them.
    """
    own, back = np.unique(np.concatenate(both), return_inverse=True)
    rows, moved = across(points.jump[own])
    one, other = np.split(back.ravel(), 2)
    width = moved.shape[1]
    left, right = (rows[(width * part[:, None] + np.arange(width)).ravel()] for part in (one, other))

    def products(a: sp.csr_matrix, b: sp.csr_matrix) -> np.ndarray:
        return np.asarray(a.multiply(b).sum(axis=1)).reshape(-1, width).sum(axis=1)

    size = np.sqrt(products(left, left) * products(right, right))
    alike = products(left, right) > same_place * np.maximum(size, np.finfo(float).tiny)
    gap = points.gap[both[0]] - points.gap[both[1]]
    near = np.linalg.norm(places[both[0]] - places[both[1]], axis=1)
    return alike & _move_alike(points, both, moved[one] - moved[other], gap, near, rubs)


def _move_alike(
    points: ContactPoints,
    both: Sequence[np.ndarray],
    apart: np.ndarray,
    gap: np.ndarray | float,
    distance: np.ndarray,
    rubs: np.ndarray,
) -> np.ndarray:
    """Return which points with parallel normals open, and slip where they rub, as others, shape (n,)."""
    normal, theirs = (points.normal[part] for part in both)
    opened = np.einsum("nd,nd->n", apart, normal) + gap
    slid = np.where(rubs, np.linalg.norm(apart, axis=1), 0.0)
    parallel = np.einsum("nd,nd->n", normal, theirs) > PARALLEL
    return np.asarray(parallel & (np.maximum(np.abs(opened), slid) <= HELD * distance))


def _joined(
    points: ContactPoints, places: np.ndarray, across: _Across, both: Sequence[np.ndarray], rubs: np.ndarray
) -> np.ndarray:
    """Return which points are those of others on a surface that is periodic as what it meets, shape (n,)."""
    one, other = both
    own = points.own[one] - points.own[other]
    way, (alike, moved) = own @ places, across.determined(own)
    joins = _ways(across.constraints)
    length = np.linalg.norm(way, axis=1)
    met = [(abs(points.master[part]) @ abs(joins).T).tocsr() for part in both]
    which, equation = met[0].multiply(met[1]).nonzero()
    # The equation joins nodes of the master along the way from one slave node to the other, or back.
    theirs = (joins @ places)[equation]
    sign = np.where(np.einsum("nd,nd->n", theirs, way[which]) < 0.0, -1.0, 1.0)
    same = np.linalg.norm(sign[:, None] * theirs - way[which], axis=1) <= HELD * length[which]
    which, equation, sign = (each[same & alike[which]] for each in (which, equation, sign))
    needed, back = np.unique(equation, return_inverse=True)
    held, along = across.determined(joins[needed])
    apart = moved[which] - sign[:, None] * along[back]
    pairs = one[which], other[which]
    good = held[back] & _move_alike(points, pairs, apart, 0.0, length[which], rubs[which])
    result = np.zeros(len(one), dtype=bool)
    result[which[good]] = True
    return result


def _ways(constraints: ConstraintRows) -> sp.csr_matrix:
    """Return the weights of nodes in equations that compare places, empty in others, (n_equations, n_nodes).

    Those of the component with the largest factors, such that each of both places has the weight one.
    """
    width, equations = constraints.components, constraints.equations.tocsc()
    parts = [equations[:, axis::width].tocsr() for axis in range(width)]
    size = 0.5 * np.column_stack([np.asarray(abs(part).sum(axis=1)).ravel() for part in parts])
    largest = np.argmax(size, axis=1)
    chosen = [sp.diags((largest == axis).astype(float)) @ part for axis, part in enumerate(parts)]
    whole, size = sp.csr_matrix(sum(chosen)), size.max(axis=1)
    compares = np.abs(np.asarray(whole.sum(axis=1)).ravel()) <= HELD * size
    factor = np.divide(compares, size, out=np.zeros(len(size)), where=size > 0.0)
    return sp.csr_matrix(sp.diags(factor) @ whole)


def _over_both_sides(
    points: ContactPoints, first: np.ndarray, groups: np.ndarray, number: np.ndarray
) -> ContactPoints:
    """Return points of which the first of some groups have the means of rows and gaps over their areas.

    `first`: the first of each point's group; `groups`: their numbers; `number`: that of each point's group.
    """
    mine = np.flatnonzero(np.isin(number, groups))
    if len(mine) == 0:
        return points
    total = np.bincount(number[mine], points.area[mine])[number[mine]]
    keep = np.ones(points.count)
    keep[mine] = 0.0
    shares = sp.csr_matrix((points.area[mine] / total, (first[mine], mine)), shape=(points.count,) * 2)
    mean = sp.diags(keep) + shares
    return replace(
        points, master=(points.own - mean @ points.jump).tocsr(), gap=mean @ points.gap,
        distance=mean @ points.distance,
    )  # fmt: skip
