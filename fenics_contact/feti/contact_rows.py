"""Rows of B that keep contact points apart (normal) and measure their slip (tangential)."""

from __future__ import annotations

import numpy as np

from fenics_contact.feti.contact_search import ContactPoints
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.rows import Rows, stack


def normal_rows(points: ContactPoints, tearing: Tearing) -> Rows:
    """Build −n·(u_slave − u_master) ≤ gap, one row for each contact point."""
    return _directed_rows(points, tearing, np.arange(points.count), -points.normal, points.gap)


def tangential_rows(points: ContactPoints, tearing: Tearing, frictional: np.ndarray) -> Rows:
    """Build the slip t_a·(u_slave − u_master), a = 1, 2: two consecutive rows for each frictional point.

    Args:
        points: All contact points.
        tearing: Node numbering and copies.
        frictional: Numbers of the points that have friction.
    """
    which = np.repeat(frictional, 2)
    directions = points.tangents[frictional].reshape(-1, 3)
    return _directed_rows(points, tearing, which, directions, np.zeros(len(which)))


def contact_rows(points: ContactPoints, tearing: Tearing, frictional: np.ndarray) -> Rows:
    """Build all contact rows: the normal ones first, then the tangential ones."""
    return stack([normal_rows(points, tearing), tangential_rows(points, tearing, frictional)])


def _directed_rows(
    points: ContactPoints, tearing: Tearing, which: np.ndarray, directions: np.ndarray, right: np.ndarray
) -> Rows:
    """Build d·(u_slave − Σ w_j u_master,j) for one direction d a row.

    The displacement of a node is the mean of its copies: that makes contact rows orthogonal to gluing rows.
    """
    slave = points.slave[which]
    nodes = np.column_stack([slave, points.master[which]])
    weights = np.column_stack([np.ones(len(which)), -points.weight[which]])
    row, column = np.nonzero(weights)
    node, weight = nodes[row, column], weights[row, column]
    copies = tearing.multiplicity[node]
    within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    copy = np.repeat(tearing.first_copy[node], copies) + within
    row = np.repeat(row, copies)
    value = np.repeat(weight / copies, copies)[:, None] * directions[row]
    # Directions along an axis leave the other components alone: the preconditioner asks what is touched.
    entry, component = np.nonzero(value)
    owner = tearing.subdomain_rank[tearing.copy_subdomain[tearing.first_copy[slave]]]
    return Rows(row[entry], copy[entry], component, value[entry, component], right, owner)
