"""Contact points whose condition a tie beside the contact, or another contact pair, has as well."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import tell
from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.scene import Scene

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
    if not len(point):
        return points
    if not told:
        for pair, tie, which in _by_pairs(points.pair[point], ties.pair[tied]):
            tell(
                _LOG.info,
                "%d nodes of the contact of %s are tied by %s: the tie has their force, they are no contact "
                "points",
                len(np.unique(point[which])), scene.contacts[pair].place, scene.ties[tie].place,
            )  # fmt: skip
    return points.part(np.setdiff1d(np.arange(points.count), point))


def tied_keys(
    points: ContactPoints, ties: ContactPoints, scene: Scene, fixed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return pair and slave node of the points that `without_tied` leaves out."""
    point = np.unique(_tied(points, ties, scene, fixed)[0])
    return points.pair[point], points.slave[point]


def _tied(
    points: ContactPoints, ties: ContactPoints, scene: Scene, fixed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of contact points and tied ones that hold the same displacement."""
    point, tied = _same_places(points, ties)
    normal, axis = points.normal[point], ties.normal[tied]
    sliding = np.array([tie.sliding for tie in scene.ties], dtype=bool)[ties.pair[tied]]
    along = np.abs(np.einsum("nd,nd->n", normal, axis))
    # A fixed tie holds all components but those that a support has on its slave.
    bonded = np.linalg.norm(np.where(fixed[ties.slave[tied]], 0.0, normal), axis=1)
    held = np.where(sliding, along, bonded) > PARALLEL
    return point[held], tied[held]


def warn_of_shared(points: ContactPoints, scene: Scene) -> None:
    """Warn where two contact pairs with different friction hold the same displacement."""
    left, right = _same_places(points, points)
    along = np.abs(np.einsum("nd,nd->n", points.normal[left], points.normal[right]))
    chosen = (points.pair[left] < points.pair[right]) & (along > PARALLEL)
    left, pairs = left[chosen], points.pair[np.column_stack([left, right])[chosen]]
    for one, other, which in _by_pairs(*pairs.T):
        first, second = scene.contacts[one], scene.contacts[other]
        if first.friction != second.friction:
            tell(
                _LOG.warning,
                "%d nodes belong to the contacts of both %s and %s, whose friction differs: how these share "
                "the normal force is not determined, and friction there follows; make them one contact pair "
                "whose friction is a function of position",
                len(np.unique(left[which])), first.place, second.place,
            )  # fmt: skip


def _same_places(points: ContactPoints, others: ContactPoints) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of points and others that compare displacements of the same places."""
    left, right = (_unit_rows(each.jump) for each in (points, others))
    cosine = (left @ right.T).tocoo()
    same = np.abs(cosine.data) > SAME_PLACE
    return cosine.row[same].astype(np.int64), cosine.col[same].astype(np.int64)


def _unit_rows(jump: sp.csr_matrix) -> sp.csr_matrix:
    size = np.sqrt(np.asarray(jump.multiply(jump).sum(axis=1)).ravel())
    return sp.diags(1.0 / np.maximum(size, np.finfo(float).tiny)) @ jump


def _by_pairs(left: np.ndarray, right: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """Yield each combination of pairs that occurs, with its places in the lists."""
    for one, other in np.unique(np.column_stack([left, right]), axis=0):
        yield int(one), int(other), (left == one) & (right == other)
