"""Rows of B at contact points: apart along the normal, slip along the tangents, all components where tied."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenics_contact.feti.contact_points import ContactPoints
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.rows import Rows, stack
from fenics_contact.scene import Tie


def normal_rows(points: ContactPoints, tearing: Tearing) -> Rows:
    """Build −n·(u_slave − u_master) ≤ gap, one row for each contact point."""
    return _directed_rows(points, tearing, np.arange(points.count), -points.normal, points.gap)


def tangential_rows(points: ContactPoints, tearing: Tearing, frictional: np.ndarray) -> Rows:
    """Build the slip t_a·(u_slave − u_master): dim − 1 consecutive rows for each frictional point.

    Args:
        points: All contact points.
        tearing: Node numbering and copies.
        frictional: Numbers of the points that have friction.
    """
    dim = points.normal.shape[1]
    which = np.repeat(frictional, dim - 1)
    directions = points.tangents[frictional].reshape(-1, dim)
    return _directed_rows(points, tearing, which, directions, np.zeros(len(which)))


def contact_rows(points: ContactPoints, tearing: Tearing, frictional: np.ndarray) -> Rows:
    """Build all contact rows: the normal ones first, then the tangential ones."""
    return stack([normal_rows(points, tearing), tangential_rows(points, tearing, frictional)])


def tied_rows(points: ContactPoints, ties: Sequence[Tie], tearing: Tearing, fixed: np.ndarray) -> Rows:
    """Build u_slave − u_master = 0 at tied points, along the normal alone where the tie may slide.

    A component that a support prescribes on the slave node is left to the support.

    Args:
        points: Points of the ties, see `find_tied_points`.
        ties: The ties.
        tearing: Node numbering and copies.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
    """
    dim = points.normal.shape[1]
    sliding = np.array([tie.sliding for tie in ties], dtype=bool)[points.pair]
    bonded, component = np.nonzero(~sliding[:, None] & ~fixed[points.slave])
    gliding = np.flatnonzero(sliding)
    which = np.concatenate([bonded, gliding])
    directions = np.concatenate([np.eye(dim)[component], -points.normal[gliding]])
    return _directed_rows(points, tearing, which, directions, np.zeros(len(which)))


def _directed_rows(
    points: ContactPoints, tearing: Tearing, which: np.ndarray, directions: np.ndarray, right: np.ndarray
) -> Rows:
    """Build d·(u_slave − Σ w_j u_master,j) for one direction d a row.

    The displacement of a node is the mean of its copies, weighted as the gluing rows are: that makes contact
    rows orthogonal to them.
    """
    jump = points.jump[which].tocoo()
    # Ascending by row: every rank builds the same rows, and the owner's copy is that of the slave node.
    order = np.lexsort((jump.col, jump.row))
    row, node, weight = jump.row[order], jump.col[order], jump.data[order]
    copies = tearing.multiplicity[node]
    within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    copy = np.repeat(tearing.first_copy[node], copies) + within
    row = np.repeat(row, copies)
    value = (np.repeat(weight, copies) * tearing.copy_share[copy])[:, None] * directions[row]
    # Directions along an axis leave the other components alone: the preconditioner asks what is touched.
    entry, component = np.nonzero(value)
    owner = tearing.subdomain_rank[tearing.copy_subdomain[tearing.first_copy[points.slave[which]]]]
    return Rows(row[entry], copy[entry], component, value[entry, component], right, owner)
