"""Both sides of a sector: whether they are one surface, and contact at edges that both have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import counted
from fenics_contact._pairing.points import HELD, PARALLEL, ContactPoints
from fenics_contact._scene.local_axes import LocalAxes, free_part
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import CyclicSymmetry
from fenics_contact._surfaces.facets import FacetedSurface, corner_products
from fenics_contact._surfaces.projection import project
from fenics_contact.errors import InvalidInputError


def check_sides(
    sector: CyclicSymmetry,
    angle: float,
    slave: FacetedSurface,
    master: FacetedSurface,
    off: float = 1e-3,
) -> None:
    """Reject sides that are not the same surface once the master is turned onto the slave.

    `off`: distance of nodes from the other side, relative to the size of facets, up to which flat ones are;
    of curved sides facets are farther apart, by no more than half of the angle between them.
    """
    tilt = max(_tilt(slave), _tilt(master))
    for one, other in ((slave, master), (master, slave)):
        hit = project(one.points, one.normals, other)
        size = float(np.sqrt(other.sizes.mean() * one.sizes.mean()))
        far = np.abs(hit.gap).max(initial=0.0)
        lost = len(one.points) - len(np.unique(hit.point))
        if far > (off + 0.5 * tilt) * size or lost:
            nodes = counted(lost, "node does", "nodes do") + " not face it" if lost else ""
            away = f"others lie up to {far:.3g} off" if lost else f"nodes lie up to {far:.3g} off"
            what = f"{nodes}, {away}" if nodes else away
            raise InvalidInputError(
                "the sides of a sector must be the same surface once the master is turned, but with the "
                f"angle {np.degrees(angle):.6g}° of {sector.place} {what}, facets having the size "
                f"{size:.3g}: check the surfaces, at, axis and angle of CyclicSymmetry"
            )


def _tilt(surface: FacetedSurface) -> float:
    """Return the largest difference between unit normals of facets and those of their nodes."""
    own = corner_products(surface.points, surface.facets)
    own = own / np.linalg.norm(own, axis=2)[:, :, None]
    return float(np.linalg.norm(own - surface.averaged[surface.facets], axis=2).max())


def check_supports_of_sides(
    ties: ContactPoints,
    scene: Scene,
    fixed: np.ndarray,
    axes: LocalAxes,
    slight: float = 0.05,
) -> None:
    """Reject supports that hold a slave of a sector in a direction in which its master is free.

    A tie leaves what a support holds on the slave to it.

    `slight`: part of a direction in which the master may be free: normals of curved rollers have errors.
    """
    cyclic = np.array([bool(tie.sectors) for tie in scene.ties])
    tied = ties.part(cyclic[ties.pair])
    which = np.flatnonzero(fixed[tied.slave].any(axis=1))
    if len(which) == 0:
        return
    dim = fixed.shape[1]
    for axis in range(dim):
        own = axes.along(tied.slave[which], np.full(len(which), axis), dim)
        held = np.flatnonzero(fixed[tied.slave[which], axis])
        row, node, weight, along = tied.entries(which[held], own[held])
        free = np.linalg.norm(weight[:, None] * free_part(along, node, fixed, axes), axis=1)
        loose = np.unique(row[free > slight])
        if len(loose):
            sector = scene.ties[int(tied.pair[which[held[loose[0]]]])]
            raise InvalidInputError(
                f"supports must hold both sides of a sector alike, but of {sector.place} they hold "
                f"{counted(len(loose), 'node')} of the slave where the master is free: support both or none"
            )


def around_once(
    points: ContactPoints, ties: ContactPoints, scene: Scene, same_place: float = 0.95
) -> tuple[np.ndarray, sp.csr_matrix]:
    """Return points that repeat others on the other side of a sector, and the others that they repeat.

    An edge of a contact surface on the slave side moves as that on the master side: both would have a point,
    and their forces would be split at will, and friction would follow.

    `same_place`: cosine between weights of nodes above which points compare the same places.

    Returns the numbers of the points, shape (k,), and the weights of all points in each, shape (k, n).
    """
    cyclic = np.array([bool(tie.sectors) for tie in scene.ties])
    tied = ties.part(cyclic[ties.pair])
    n_nodes = points.master.shape[1]
    number = np.full(n_nodes, -1)
    number[tied.slave] = np.arange(tied.count)
    here = np.flatnonzero(number[points.slave] >= 0)
    if len(here) == 0:
        return here, sp.csr_matrix((0, points.count))
    by = number[points.slave[here]]
    weights = tied.master[by].tocoo()
    strong = np.abs(weights.data) > HELD
    row, node, weight = weights.row[strong], weights.col[strong], weights.data[strong]
    key = points.pair * np.int64(n_nodes) + points.slave
    order = np.argsort(key)
    wanted = points.pair[here[row]] * np.int64(n_nodes) + node
    place = np.minimum(np.searchsorted(key[order], wanted), points.count - 1)
    found = key[order][place] == wanted
    every = np.bincount(row, found, len(here)) == np.bincount(row, minlength=len(here))
    shape = (len(here), points.count)
    onto = sp.csr_matrix((weight * found, (row, order[place])), shape=shape)
    free = np.ones(n_nodes)
    free[tied.slave] = 0.0
    moved = sp.diags(free) + tied.own.T @ tied.master
    mine, theirs = points.jump[here] @ moved, onto @ points.jump @ moved
    lengths = [np.sqrt(np.asarray(each.multiply(each).sum(axis=1)).ravel()) for each in (mine, theirs)]
    cosine = np.asarray(mine.multiply(theirs).sum(axis=1)).ravel() / np.maximum(
        lengths[0] * lengths[1], np.finfo(float).tiny
    )
    normal = tied.onto_slave(by, onto @ points.normal)
    along = np.einsum("nd,nd->n", normal, points.normal[here])
    lost = np.flatnonzero(every & (cosine > same_place) & (along > PARALLEL))
    return here[lost], onto[lost]


def joined_around(
    points: ContactPoints, ties: ContactPoints, scene: Scene, *, areas: bool = True
) -> ContactPoints:
    """Return points without those of `around_once`, whose areas are part of those that they repeat."""
    return without_repeated(points, scene, *around_once(points, ties, scene), areas=areas)


def without_repeated(
    points: ContactPoints, scene: Scene, lost: np.ndarray, onto: sp.csr_matrix, *, areas: bool = True
) -> ContactPoints:
    """Return points without those that repeat others, see `around_once`; with `areas` these get theirs."""
    if len(lost) == 0:
        return points
    if areas:
        area = points.area + onto.T @ points.area[lost]
        largest = np.asarray(onto.argmax(axis=1)).ravel()
        count = len(scene.contacts)
        entries = points.slave[lost] + 1, (largest, points.pair[lost])
        merged_nodes = points.merged_nodes.maximum(sp.csr_matrix(entries, shape=(points.count, count)))
        points = replace(points, area=area, merged_nodes=merged_nodes)
    return points.part(np.setdiff1d(np.arange(points.count), lost))
