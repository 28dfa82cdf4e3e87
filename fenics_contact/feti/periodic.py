"""Contact at edges of periodic bodies: of points that equations move alike, one carries the force.

Two points compare the same places if the rows of their jumps are equal but for a sum of equations. Both would
have a point, their forces would be split at will, and friction would follow.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.sparse import ROUNDING
from fenics_contact._pairing.points import HELD, PARALLEL, ContactPoints
from fenics_contact._pairing.sectors import without_repeated
from fenics_contact._scene.scene import Scene
from fenics_contact.feti.constraints import ConstraintRows, factored


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

    `prescribed`: prescribed components of all nodes, NaN where free, shape (n_nodes, components), [length].
    """
    one, other = _candidates(points, constraints, len(scene.contacts if areas else scene.ties))
    if len(one) == 0 or constraints.count == 0:
        return points
    rubs = [pair.has_friction for pair in scene.contacts] if areas else [True] * len(scene.ties)
    own, back = np.unique(np.concatenate([one, other]), return_inverse=True)
    met, both = points.part(own), np.split(back.ravel(), 2)
    moved = _across(met.jump, constraints, scene, prescribed)
    same = _alike(met, scene.points[met.slave], moved, both, np.array(rubs)[points.pair[one]])
    links = sp.coo_matrix((np.ones(same.sum()), (one[same], other[same])), shape=(points.count,) * 2)
    _, number = connected_components(links, directed=False)
    place = np.round(scene.points[points.slave] / (1e-3 * np.ptp(scene.points[points.slave], axis=0).max()))
    order = np.lexsort((*place.T, number))
    first = order[np.r_[True, np.diff(number[order]) != 0]]  # by number, which are all there
    lost = np.setdiff1d(np.arange(points.count), first)
    entries = np.ones(len(lost)), (np.arange(len(lost)), first[number[lost]])
    onto = sp.csr_matrix(entries, shape=(len(lost), points.count))
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


def _alike(
    points: ContactPoints,
    places: np.ndarray,
    across: tuple[sp.csr_matrix, np.ndarray],
    both: Sequence[np.ndarray],
    rubs: np.ndarray,
    same_place: float = 1.0 - 1e-6,
) -> np.ndarray:
    """Return which points compare the same places as others, shape (n,).

    `places`: of the slave nodes, shape (n_points, dim); `across`: see `_across`; `both`: numbers of points
    and of others, shape (n,) each; `rubs`: whether both must slip alike, too, shape (n,); `same_place`:
    cosine between rows less what equations make of them. Where meshes do not match, rows of both edges are
    means over different facets by mortar: these are two points, whose forces are determined.
    """
    (rows, moved), (one, other) = across, both
    width = moved.shape[1]
    left, right = (rows[(width * part[:, None] + np.arange(width)).ravel()] for part in both)

    def products(a: sp.csr_matrix, b: sp.csr_matrix) -> np.ndarray:
        return np.asarray(a.multiply(b).sum(axis=1)).reshape(-1, width).sum(axis=1)

    size = np.sqrt(products(left, left) * products(right, right))
    alike = products(left, right) > same_place * np.maximum(size, np.finfo(float).tiny)
    apart, normal = moved[one] - moved[other], points.normal[one]
    opened = np.einsum("nd,nd->n", apart, normal) + points.gap[one] - points.gap[other]
    slid = np.where(rubs, np.linalg.norm(apart, axis=1), 0.0)
    near = HELD * np.linalg.norm(places[one] - places[other], axis=1)
    parallel = np.einsum("nd,nd->n", normal, points.normal[other]) > PARALLEL
    return np.asarray(alike & parallel & (np.maximum(np.abs(opened), slid) <= near))


def _across(
    jump: sp.csr_matrix,
    constraints: ConstraintRows,
    scene: Scene,
    prescribed: np.ndarray,
    at_once: int = 256,
) -> tuple[sp.csr_matrix, np.ndarray]:
    """Return the rows of jumps on free components across all equations, and what these make of the jumps.

    `at_once`: dense columns.

    Returns shape (n · components, n_nodes · components), and (n, components), [length].
    """
    free, width = constraints.free, constraints.components
    rows = sp.kron(jump, sp.identity(width), format="csr")
    right = constraints.right(scene.constraints) - constraints.of_supports(prescribed)
    moved = rows @ constraints.moved(prescribed)
    rows = (rows @ constraints.projection).tocsr()
    factor, parts = factored((free @ free.T).tocsr()), []
    for start in range(0, rows.shape[0], at_once):
        some = rows[start : start + at_once]
        made = factor.solve((free @ some.T).toarray()).T
        made[np.abs(made) <= ROUNDING * np.abs(made).max(initial=0.0)] = 0.0
        parts.append(some - sp.csr_matrix(made) @ free)
        moved[start : start + at_once] += made @ right
    return sp.vstack(parts, format="csr"), moved.reshape(-1, width)
