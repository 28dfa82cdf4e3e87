"""Pairs of facets that may face each other: nearest along the slave's normals, in opposite direction."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.pairing.mortar.planes import Planes

#: Facets face each other if their normals are opposite within 60 degrees: smallest cosine of that angle.
FACING = 0.5
#: Number of steps along a normal towards the master; one suffices for planes.
STEPS = 5
#: Number of nearest master facets, the first of which that faces the slave determines the step.
NEAREST = 4


def candidate_pairs(slave: Planes, master: Planes) -> tuple[np.ndarray, np.ndarray]:
    """Pair slave facets with all master facets that they may overlap along their normals.

    From the centre of every slave facet a search along its normal, in both directions, finds the master at
    any distance; of several layers of the master the nearest one. Facets near that point are candidates:
    facets further away along the normal than twice the sum of both radii (the maximum for an inclination of
    60 degrees) belong to another layer.

    Args:
        slave: Planes of the slave facets.
        master: Planes of the master facets.

    Returns:
        Slave facet, ascending, and master facet of each pair, each shape (n,).
    """
    feet = _feet(slave, master)
    pairs = [_near(slave, master, feet, members) for members in _size_classes(master.radius)]
    pair_slave, pair_master = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    order = np.lexsort((pair_master, pair_slave))
    return pair_slave[order], pair_master[order]


def _feet(slave: Planes, master: Planes) -> np.ndarray:
    """Return where the normals through the centres of slave facets reach the master, shape (n, dim)."""
    tree, feet = cKDTree(master.origin), slave.origin.copy()
    for _ in range(STEPS):
        _, nearest = tree.query(feet, k=np.arange(min(NEAREST, tree.n)) + 1)
        cosine = np.einsum("nd,nkd->nk", slave.normal, master.normal[nearest])
        # The nearest one that faces the slave, or the nearest of all if none does.
        choice = np.argmax(cosine < -FACING, axis=1)[:, None]
        facet = np.take_along_axis(nearest, choice, axis=1)[:, 0]
        cosine = np.take_along_axis(cosine, choice, axis=1)[:, 0]
        away = master.origin[facet] - feet
        facing = cosine < -FACING
        to_plane = np.einsum("nd,nd->n", away, master.normal[facet]) / np.where(facing, cosine, 1.0)
        step = np.where(facing, to_plane, np.einsum("nd,nd->n", away, slave.normal))
        feet += step[:, None] * slave.normal
    return feet


def _size_classes(radius: np.ndarray) -> list[np.ndarray]:
    """Group facets so that no radius is more than twice another, for any grading of the mesh."""
    octave = np.floor(np.log2(radius / radius.min())).astype(np.int64)
    return [np.flatnonzero(octave == which) for which in np.unique(octave)]


def _near(
    slave: Planes, master: Planes, feet: np.ndarray, members: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pair the slave facets with those among ``members`` that lie near their feet and face them."""
    reach = slave.radius + master.radius[members].max()
    lists = cKDTree(master.origin[members]).query_ball_point(feet, reach / FACING)
    pair_slave = np.repeat(np.arange(len(feet)), [len(each) for each in lists])
    pair_master = members[np.concatenate(lists).astype(np.int64)]
    away = master.origin[pair_master] - feet[pair_slave]
    normal = slave.normal[pair_slave]
    along = np.einsum("nd,nd->n", away, normal)
    aside = np.linalg.norm(away - along[:, None] * normal, axis=1)
    both = slave.radius[pair_slave] + master.radius[pair_master]
    facing = np.einsum("nd,nd->n", normal, master.normal[pair_master]) < -FACING
    keep = facing & (aside < both) & (np.abs(along) < both / FACING)
    return pair_slave[keep], pair_master[keep]
