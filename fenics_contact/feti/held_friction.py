"""Friction at nodes of a slave that supports hold, of which there are more than the master has nodes.

It acts on the master alone, and bodies are the same with all forces of one effect: those at single nodes are
determined up to parts that cancel. Of all these the most even ones are the answer, whatever the partition and
the numbers of nodes: Σ ‖τ‖²/A is least.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from fenics_contact._pairing.points import HELD
from fenics_contact._scene.local_axes import free_part
from fenics_contact.feti.constraints import independent_rows
from fenics_contact.feti.torn import TornSystem


def even_friction(torn: TornSystem, multiplier: np.ndarray) -> np.ndarray:
    """Return multipliers of the same effect with even friction where supports hold the slave. Collective."""
    rows = _held_rows(torn)
    if len(rows) == 0:
        return multiplier
    width, friction = torn.components - 1, torn.tangential_rows.ravel()
    normal, tau = (torn.numbering.gather(multiplier, part) for part in (torn.normal_rows, friction))
    bound = torn.groups.slips.slip_bound(normal[torn.frictional])
    size = np.linalg.norm(tau.reshape(-1, width), axis=1)
    rows = rows[(size < bound * (1.0 - HELD))[rows // width]]
    if len(rows) == 0:
        return multiplier
    ways = _cancelling(_on_nodes(torn, rows))
    if ways.shape[1] == 0:
        return multiplier
    tau = _evened(tau, ways, torn.points.area[torn.frictional][rows // width], rows, bound)
    place = torn.numbering.owned_index(friction)
    result = multiplier.copy()
    result[place[place >= 0]] = tau[place >= 0]
    return result


def _held_rows(torn: TornSystem) -> np.ndarray:
    """Return the friction rows, by number, along which the slave is held and the master is not."""
    slips, fixed = torn.groups.slips, torn.decomposition.fixed
    own = free_part(slips.directions, torn.points.slave[slips.which], fixed, slips.axes)
    held = (np.linalg.norm(own, axis=1) <= HELD) & ~slips.held(fixed)
    stiff = np.repeat(slips.elastic_slip == 0.0, torn.components - 1)
    return np.flatnonzero(held & stiff)


def _on_nodes(torn: TornSystem, rows: np.ndarray) -> sp.csr_matrix:
    """Return friction rows on free components of nodes and free motions of rigid surfaces. Collective."""
    slips, width = torn.groups.slips, torn.components
    row, node, weight, along = torn.points.entries(slips.which[rows], slips.directions[rows])
    value = weight[:, None] * free_part(along, node, torn.decomposition.fixed, slips.axes)
    entries = value.ravel(), (np.repeat(row, width), (width * node[:, None] + np.arange(width)).ravel())
    on_nodes = sp.csr_matrix(entries, shape=(len(rows), width * torn.points.jump.shape[1]))
    chosen = torn.tangential_rows.ravel()[rows]
    free = [torn.numbering.gather(column, chosen) for column in torn.free.columns.T.toarray()]
    return sp.hstack([on_nodes, *(sp.csr_matrix(column[:, None]) for column in free)], format="csr")


def _cancelling(rows: sp.csr_matrix) -> np.ndarray:
    """Return forces on rows that have no effect, N with rowsᵀ N = 0, shape (n_rows, k)."""
    size = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
    kept, made = independent_rows((sp.diags(1.0 / size) @ rows).tocsr())
    ways = np.zeros((len(size), made.shape[0]))
    ways[kept] = -made.toarray().T
    ways[~kept] = np.eye(made.shape[0])
    return ways / size[:, None]


def _evened(
    tau: np.ndarray,
    ways: np.ndarray,
    area: np.ndarray,
    rows: np.ndarray,
    bound: np.ndarray,
    near: float = 1e-10,
    most: int = 500,
) -> np.ndarray:
    """Return the most even friction, near the bounds where it is beyond them; as it is if none is within.

    `tau`: of all rows; `ways`: N on some rows; `area`: A of their points; `bound`: Ψ; `near`: excess relative
    to the largest bound that is none; `most`: steps between what has the effect and what is within the
    bounds.
    """
    weighted, width, wanted = ways / area[:, None], len(tau) // len(bound), np.zeros(len(rows))
    gram, found = cho_factor(weighted.T @ ways), tau.copy()
    mine = np.zeros(len(tau), dtype=bool)
    mine[rows] = True
    others = np.where(mine, 0.0, tau).reshape(-1, width)
    room = np.sqrt(np.maximum(bound**2 - np.einsum("na,na->n", others, others), 0.0))
    for _ in range(most):
        found[rows] += ways @ cho_solve(gram, weighted.T @ (wanted - found[rows]))
        size = np.linalg.norm(np.where(mine, found, 0.0).reshape(-1, width), axis=1)
        if (size - room).max() <= near * bound.max():
            return found
        shrink = np.minimum(np.divide(room, size, out=np.ones(len(size)), where=size > room), 1.0)
        wanted = found[rows] * shrink[rows // width]
    return tau
