"""Contact points whose condition a tie beside the contact, or another contact pair, has as well."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import counted
from fenics_contact.errors import safe_log
from fenics_contact.pairing.contact_points import HELD, ContactPoints
from fenics_contact.scene import ContactPair, Scene, Surface, Tie

#: Cosine between weights of nodes above which two points compare the same places.
SAME_PLACE = 0.95
#: Cosine between normals above which two points act in the same direction: corners stay what they are.
PARALLEL = 0.9

_LOG = logging.getLogger(__name__)


def without_tied(
    points: ContactPoints, ties: ContactPoints, scene: Scene, fixed: np.ndarray, *, told: bool
) -> ContactPoints:
    """Return the contact points that no tie has as well.

    Where an edge belongs to a tie and to a contact, both hold the same relative displacement. Their normal
    forces would be split at will, and friction would follow. The tie alone has them: it keeps closed.

    Args:
        points: The contact points.
        ties: Points of the ties.
        scene: Their scene.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
        told: Whether nothing is to be logged.
    """
    point, tied = _tied(points, ties, scene, fixed)
    if not told:
        words = "the contact of %s leaves out %s, where the force is that of %s, which ties the same places"
        _tell(words, (scene.contacts, points, point), (scene.ties, ties, tied))
    return points.part(np.setdiff1d(np.arange(points.count), point))


def tied_keys(
    points: ContactPoints, ties: ContactPoints, scene: Scene, fixed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return pair and slave node of the points that `without_tied` leaves out."""
    point = np.unique(_tied(points, ties, scene, fixed)[0])
    return points.pair[point], points.slave[point]


def tied_once(ties: ContactPoints, scene: Scene, fixed: np.ndarray) -> ContactPoints:
    """Return the points of ties without those of which another tie holds all, the first one of equals.

    Where an edge belongs to two ties, their forces would be split at will.
    """
    one, other, _ = _same_places(ties, ties)
    sliding = np.array([tie.sliding for tie in scene.ties], dtype=bool)[ties.pair]
    held = _held(ties.normal[one], ties, other, scene, fixed)
    first = np.where(sliding[one] == sliding[other], ties.pair[other] < ties.pair[one], sliding[one])
    lost = one[held & first & (sliding[one] | ~sliding[other])]
    return ties.part(np.setdiff1d(np.arange(ties.count), lost))


def shared_once(points: ContactPoints, scene: Scene, *, told: bool) -> ContactPoints:
    """Return the contact points, of those that compare the same places in one direction only one.

    Where an edge belongs to two contact pairs, or two pairs have the same surfaces, their normal forces would
    be split at will, and friction would follow. The pair whose gap is smaller has them, of equal ones the
    one named first, with its friction and the area of the surfaces of both.

    Args:
        points: The contact points.
        scene: Their scene.
        told: Whether nothing is to be logged.
    """
    kept, lost = _shared(points, scene)
    if not told:
        words = "the contact of %s leaves out %s, where force and friction are those of %s at the same places"
        _tell(words, (scene.contacts, points, lost), (scene.contacts, points, kept))
    area, taken = areas_taken(points, (kept, lost), scene)
    points = replace(points, area=points.area + area, taken=taken)
    return points.part(np.setdiff1d(np.arange(points.count), lost))


def areas_taken(
    points: ContactPoints, couples: tuple[np.ndarray, np.ndarray], scene: Scene
) -> tuple[np.ndarray, sp.csr_matrix]:
    """Return the areas that points take over from others, and whose they are, see `ContactPoints.taken`.

    Args:
        points: All points.
        couples: Numbers of points and of those that they stand for, shape (n,) each.
        scene: Their scene.
    """
    kept, lost = couples
    beside = np.zeros(len(kept), dtype=bool)
    for one, other, which in _by_pairs(points.pair[kept], points.pair[lost]):
        beside[which] = are_beside(scene, scene.contacts[one], scene.contacts[other])
    # A node that two points could stand for gives its area to one of them.
    _, first = np.unique(np.where(beside, lost, -1), return_index=True)
    first = first[beside[first]]
    kept, lost = kept[first], lost[first]
    area = np.bincount(kept, points.area[lost], points.count)
    entries = points.slave[lost] + 1, (kept, points.pair[lost])
    return area, sp.csr_matrix(entries, shape=(points.count, len(scene.contacts)))


def are_beside(scene: Scene, pair: ContactPair, other: ContactPair) -> bool:
    """Return whether the slave surface of another pair has no facet of the surfaces of a pair."""
    mesh = scene.bodies[other.slave.body].mesh
    theirs = np.sort(mesh.surfaces[other.slave.name], axis=1)
    for side in (pair.slave, pair.master):
        if isinstance(side, Surface) and side.body == other.slave.body:
            every = np.vstack([theirs, np.sort(mesh.surfaces[side.name], axis=1)])
            if len(np.unique(every, axis=0)) < len(every):
                return False
    return True


def _shared(points: ContactPoints, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of points, and of others for which each of them stands."""
    if points.count == 0:
        return points.pair, points.pair
    one, other, sign = _same_places(points, points)
    towards = sign[:, None] * points.normal[other]
    cosine = np.einsum("nd,nd->n", points.normal[one], towards)
    # Of two in one direction the one with the larger gap never closes; turned ones differ by their facets.
    size = points.area ** (1.0 / (scene.dim - 1))
    equal = HELD * size.mean()
    turned = np.linalg.norm(points.normal[one] - towards, axis=1)
    as_far = np.abs(points.gap[one] - points.gap[other]) <= equal + turned * size[one]
    rank = np.argsort(np.lexsort((points.pair, np.round(points.gap / (2.0 * equal)))))
    differ = points.pair[one] != points.pair[other]
    chosen = differ & (cosine > PARALLEL) & as_far & (rank[one] < rank[other])
    one, other = one[chosen], other[chosen]
    kept, lost = [one[:0]], [one[:0]]
    while len(one):
        stays = ~np.isin(one, other)
        kept.append(one[stays])
        lost.append(other[stays])
        left = ~np.isin(one, lost[-1]) & ~np.isin(other, lost[-1])
        one, other = one[left], other[left]
    return np.concatenate(kept), np.concatenate(lost)


def _tied(
    points: ContactPoints, ties: ContactPoints, scene: Scene, fixed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of contact points and tied ones that hold the same displacement."""
    point, tied, _ = _same_places(points, ties)
    held = _held(points.normal[point], ties, tied, scene, fixed)
    return point[held], tied[held]


def _held(
    normal: np.ndarray, ties: ContactPoints, tied: np.ndarray, scene: Scene, fixed: np.ndarray
) -> np.ndarray:
    """Return whether tied points hold displacements along normals, shape (n, dim)."""
    sliding = np.array([tie.sliding for tie in scene.ties], dtype=bool)[ties.pair[tied]]
    along = np.abs(np.einsum("nd,nd->n", normal, ties.normal[tied]))
    # A fixed tie holds all components but those that a support has on its slave.
    bonded = np.linalg.norm(np.where(fixed[ties.slave[tied]], 0.0, normal), axis=1)
    return np.asarray(np.where(sliding, along, bonded) > PARALLEL)


def _same_places(points: ContactPoints, others: ContactPoints) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the numbers of points and others that compare the same places, and −1 where slaves swap."""
    left, right = (_unit_rows(each.jump) for each in (points, others))
    cosine = (left @ right.T).tocoo()
    same = np.abs(cosine.data) > SAME_PLACE
    row, column = cosine.row[same].astype(np.int64), cosine.col[same].astype(np.int64)
    return row, column, np.sign(cosine.data[same])


def _unit_rows(jump: sp.csr_matrix) -> sp.csr_matrix:
    size = np.sqrt(np.asarray(jump.multiply(jump).sum(axis=1)).ravel())
    return sp.diags(1.0 / np.maximum(size, np.finfo(float).tiny)) @ jump


#: Pairs, their points, and numbers of some of them.
_Side = tuple[Sequence[ContactPair | Tie], ContactPoints, np.ndarray]


def _tell(words: str, lost: _Side, kept: _Side) -> None:
    """Log how many points of which pair are left out for which other pair."""
    (pairs, points, one), (others, those, other) = lost, kept
    for here, there, which in _by_pairs(points.pair[one], those.pair[other]):
        left_out = counted(len(np.unique(one[which])), "node")
        safe_log(_LOG.info, words, pairs[here].place, left_out, others[there].place)


def _by_pairs(left: np.ndarray, right: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """Yield each combination of pairs that occurs, with its places in the lists."""
    for one, other in np.unique(np.column_stack([left, right]), axis=0):
        yield int(one), int(other), (left == one) & (right == other)
