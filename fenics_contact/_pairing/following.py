"""Points at hanging nodes: these follow their masters, which carry the constraint in their place.

A pressure with values at nodes that do not hang, and at those that do the means of their masters, does work
on the gaps of a surface as the rows r of all slave nodes say, with the areas A:

    Ã_a = A_a + Σ_h w_ha A_h,    r̃_a = (A_a r_a + Σ_h w_ha A_h r_h) / Ã_a.

Means of the dual basis are combined like this, which keeps an even pressure even. By nodes, the constraint of
a node is that of its place: there r̃_a = r_a, with the area Ã_a.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._pairing.points import ContactPoints, NodeNumbers
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError


def on_masters(points: ContactPoints, scene: Scene, body: str, means: bool) -> ContactPoints:
    """Return the points of a pair without those at hanging nodes, unless none of their masters has one.

    `body`: that of the slave; `means`: whether points have rows by the dual basis, not by nodes.
    """
    followed = followed_nodes(scene)
    points = replace(points, master=(points.master @ followed).tocsr())
    hanging, numbers = scene.bodies[body].mesh.hanging, NodeNumbers.of(scene)
    if not hanging:
        return points
    point_of = np.full(numbers.n_nodes, -1)
    point_of[points.slave] = np.arange(points.count)
    mine = point_of[numbers.global_nodes(body, hanging.nodes)]
    there = point_of[numbers.global_nodes(body, hanging.masters)]
    leaves = (mine >= 0) & (there >= 0).any(axis=1)
    alone = mine[(mine >= 0) & ~leaves]
    if points.are_rotated.any() and (len(alone) or (means and leaves.any())):
        raise InvalidInputError(
            f"sides of sectors by mortar must have no hanging nodes, that of body {body!r} has some: refine "
            "the cells at its sides evenly"
        )
    rest = np.setdiff1d(np.arange(points.count), mine[leaves])
    share = _shares(mine[leaves], there[leaves], points.count)
    area = share @ points.area
    if means:
        weights = sp.diags(1.0 / np.where(area > 0.0, area, 1.0)) @ share @ sp.diags(points.area)
        jump = weights @ (points.jump @ followed)
        points = replace(
            points,
            master=(points.own - jump).tocsr(),
            gap=weights @ points.gap,
            distance=weights @ points.distance,
        )
    elif len(alone):  # the point stays that of the node, which moves as its masters do
        own = points.own[alone]
        entries = np.ones(len(alone)), (alone, np.arange(len(alone)))
        spread = sp.csr_matrix(entries, shape=(points.count, len(alone)))
        points = replace(points, master=(points.master + spread @ (own - own @ followed)).tocsr())
    return replace(points, area=area).part(rest)


def means_on_masters(points: ContactPoints, scene: Scene) -> ContactPoints:
    """Return points that are means over surfaces, in terms of the nodes that do not hang."""
    return replace(points, master=(points.own - points.jump @ followed_nodes(scene)).tocsr())


def _shares(leaving: np.ndarray, there: np.ndarray, count: int) -> sp.csr_matrix:
    """Return the weights by which points take over from those that leave, and keep their own, (n, n).

    `leaving`: the latter, shape (k,); `there`: points of their masters, −1 without, shape (k, n_masters).
    """
    has = there >= 0
    weight = has / has.sum(axis=1, keepdims=True)
    row, column = np.nonzero(has)
    taken = sp.csr_matrix((weight[row, column], (there[row, column], leaving[row])), shape=(count, count))
    return (sp.identity(count) + taken).tocsr()


def followed_nodes(scene: Scene) -> sp.csr_matrix:
    """Return T on the nodes of all bodies, dependent ones by their masters'."""
    meshes = [body.mesh for body in scene.bodies.values()]
    parts = [mesh.followers.followed(mesh.n_nodes) for mesh in meshes]
    return sp.block_diag(parts, format="csr")
