"""Smoothing of boundaries between subdomains: protruding cells move to the neighbour."""

from __future__ import annotations

import numpy as np

ROUNDS = 20
"""Largest number of passes; each reduces the boundaries, and a few suffice."""

GAIN = 1e-9
"""A cell moves if the boundaries shrink by more than this fraction of the largest face."""


def smoothed(partition: np.ndarray, pairs: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """Move cells that share more area with another subdomain than with their own.

    In each pass only cells move that gain more than all their neighbours, so that no two moves interfere. A
    cell that shares no face with its own subdomain stays: no subdomain loses its last one.

    Args:
        partition: (n_cells,) subdomain numbers.
        pairs: Pairs of cells that share a face, (n, 2).
        areas: Areas of these faces, (n,).

    Returns:
        (n_cells,) subdomain numbers.
    """
    cell, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    area, parts = np.tile(areas, 2), int(partition.max()) + 1
    for _ in range(ROUNDS):
        gain, better = _gains(partition, cell * parts + partition[other], area)
        wishes = gain > GAIN * areas.max()
        place = np.empty(len(partition), dtype=np.int64)
        place[np.argsort(np.where(wishes, gain, 0.0), kind="stable")] = np.arange(len(partition))
        highest = np.zeros_like(place)
        np.maximum.at(highest, cell, np.where(wishes[other], place[other], 0))
        moves = wishes & (place > highest)
        if not moves.any():
            break
        partition = np.where(moves, better, partition)
    return partition


def _gains(partition: np.ndarray, towards: np.ndarray, area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest gain of each cell by a move, zero if it stays, and the target subdomain.

    Args:
        partition: (n_cells,) subdomain numbers.
        towards: Cell and subdomain beyond every face, from both sides, as one number, (2 n,).
        area: Areas of the faces, (2 n,).
    """
    parts = int(partition.max()) + 1
    unique, where = np.unique(towards, return_inverse=True)
    shared = np.bincount(where.ravel(), area)
    cells, subdomains = unique // parts, unique % parts
    own = np.zeros(len(partition))
    inside = subdomains == partition[cells]
    own[cells[inside]] = shared[inside]
    order = np.argsort(np.where(inside, 0.0, shared), kind="stable")  # the last assignment wins
    gain, better = np.zeros(len(partition)), partition.copy()
    gain[cells[order]] = np.where(inside, 0.0, shared - own[cells])[order]
    better[cells[order]] = subdomains[order]
    return np.where(own > 0.0, gain, 0.0), better
