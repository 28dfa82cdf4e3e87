"""Rows of B at the sections of preloads: u₊ − u₋ = −q n, with the shortening q given, or an unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import counted
from fenics_contact._pairing.points import (
    ContactPoints,
    NodeNumbers,
    join_points,
    reference_axes,
    tangent_frames,
)
from fenics_contact._scene.local_axes import LocalAxes, free_part
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.contact_rows import Relations
from fenics_contact.feti.free_motions import FreeMotions


def section_points(
    scene: Scene,
    ties: ContactPoints,
    numbers: NodeNumbers,
    fixed: np.ndarray,
    axes: LocalAxes | None = None,
    slight: float = 1e-9,
) -> ContactPoints:
    """Return the nodes on both sides of all sections as tied points, whose pairs come after the scene's ties.

    The slave lies behind the section.

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`; `slight`:
    part of a normal that supports may hold: those of planes of symmetry have rounding.
    """
    found = []
    for number, preload in enumerate(scene.preloads):
        mesh = scene.bodies[preload.body].mesh
        behind, before = numbers.global_nodes(preload.body, preload.held_pairs(mesh)).T
        count, normal = len(behind), preload.normal(mesh)
        along = np.tile(normal, (count, 1))
        held = np.zeros(count, dtype=bool)
        for side in (behind, before):
            lost = np.abs(along - free_part(along, side, fixed, axes))
            held |= lost.max(axis=1) > slight
        if held.any():
            raise InvalidInputError(
                f"supports must leave sections of preloads free along their normals, but they hold "
                f"{counted(int(held.sum()), 'node')} of that of body {preload.body!r}: put the section "
                "elsewhere; at a plane of symmetry that contains the axis hold only what is normal to it"
            )
        if np.isin(behind, ties.slave).any() and np.isin(before, ties.slave).any():
            raise InvalidInputError(
                "sections of preloads must not cut slaves of ties, which hold them together, but that of "
                f"body {preload.body!r} does: put the section elsewhere, or make that surface the master"
            )
        normals = np.tile(normal, (count, 1))
        master = sp.csr_matrix((np.ones(count), before, np.arange(count + 1)), shape=(count, numbers.n_nodes))
        nothing = np.zeros(count)
        points = ContactPoints(
            np.full(count, len(scene.ties) + number), behind, master, normals, tangent_frames(normals),
            nothing, nothing, np.full(count, -1), np.zeros((count, scene.components - 1)),
            reference_axes(normals), np.zeros(normals.shape, dtype=bool), nothing, np.ones(count, dtype=bool),
        )  # fmt: skip
        found.append(points)
    return join_points(found, scene.components, numbers.n_nodes)


def shortening_columns(scene: Scene, tied: Relations) -> sp.csr_matrix:
    """Return what unit shortenings are in the rows of ties, shape (n_tied_rows, n_preloads)."""
    number = tied.points.pair[tied.which] - len(scene.ties)
    row = np.flatnonzero((number >= 0) & (number < len(scene.preloads)))  # springs come after
    normal = tied.points.normal[tied.which[row]]
    value = -np.einsum("rd,rd->r", tied.directions[row], normal)
    shape = (tied.count, len(scene.preloads))
    return sp.csr_matrix((value, (row, number[row])), shape=shape)


def given_shortenings(scene: Scene) -> np.ndarray:
    """Return the prescribed shortenings, zero where a force is given and of bolts held as they were made."""
    return np.array([preload.shortening or 0.0 for preload in scene.preloads])


def with_shortenings(free: FreeMotions, scene: Scene, columns: sp.csr_matrix) -> FreeMotions:
    """Return the free motions with the unknown shortenings behind them, scaled as these.

    `columns`: `shortening_columns` on the owned rows, on others zero, shape (n_owned, n_preloads).
    """
    loose = [number for number, preload in enumerate(scene.preloads) if preload.is_free]
    if not loose:
        return free
    size = shortening_scales(scene)[loose]
    force = np.array([preload.force or 0.0 for preload in scene.preloads])[loose]
    own = columns[:, loose] @ sp.diags(1.0 / size)
    columns = sp.hstack([free.columns, own], format="csr")
    return replace(free, columns=columns, load=np.concatenate([free.load, force / size]))


def shortening_scales(scene: Scene) -> np.ndarray:
    """Return the sizes of unit shortenings over all nodes of each section, shape (n_preloads,)."""
    counts = [each.count(scene.bodies[each.body].mesh) for each in scene.preloads]
    return np.sqrt(np.array(counts, dtype=np.float64))


def once_at_sections(
    points: ContactPoints, scene: Scene, numbers: NodeNumbers, across: float = 0.1
) -> ContactPoints:
    """Return the contact points, of two on both sides of a section one with the area of both.

    Their nodes move alike across the section's normal: the force would be split at will.

    `across`: largest cosine between normals of contact and section with which they count as across.
    """
    lost, kept = [], []
    for preload in scene.preloads:
        mesh = scene.bodies[preload.body].mesh
        behind, before = numbers.global_nodes(preload.body, preload.cut(mesh).pairs).T
        along = np.abs(points.normal @ preload.normal(mesh)) < across
        for number, pair in enumerate(scene.contacts):
            if pair.by_mortar or pair.slave.body != preload.body:
                continue
            place = np.full(numbers.n_nodes, -1)
            mine = np.flatnonzero((points.pair == number) & along)
            place[points.slave[mine]] = mine
            both = (place[behind] >= 0) & (place[before] >= 0)
            lost.append(place[behind[both]])
            kept.append(place[before[both]])
    if not lost or not sum(map(len, lost)):
        return points
    dropped, left = np.concatenate(lost), np.concatenate(kept)
    entries = points.slave[dropped] + 1, (left, points.pair[dropped])
    taken = sp.csr_matrix(entries, shape=(points.count, len(scene.contacts)))
    if points.taken is not None:
        taken = points.taken.maximum(taken)
    area = points.area + np.bincount(left, points.area[dropped], points.count)
    rest = np.setdiff1d(np.arange(points.count), dropped)
    return replace(points, area=area, taken=taken).part(rest)
