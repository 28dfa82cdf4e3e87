"""Rows of B at the sections of preloads: u₊ − u₋ = −q n, with the shortening q given, or an unknown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import counted
from fenics_contact._base.sparse import scaled_columns
from fenics_contact._pairing.points import (
    ContactPoints,
    NodeNumbers,
    join_points,
)
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes, free_part
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sections import held_at
from fenics_contact.errors import InfeasibleError, InvalidInputError, together
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.row_groups import Unknowns
from fenics_contact.feti.ties import BondedPoints, bonded_rows


@dataclass(frozen=True, eq=False)
class SectionRows(BondedPoints):
    """Rows of the nodes on both sides of sections, whose slaves lie behind them.

    `shortenings`: what unit shortenings of all preloads are in the rows.
    """

    draws = True

    shortenings: sp.csr_matrix

    @classmethod
    def key(cls, scene: Scene) -> Sequence[object]:
        """Return where the sections are."""
        return [preload.key for preload in scene.preloads]

    @classmethod
    def of(
        cls, scene: Scene, decomposition: Decomposition, ties: ContactPoints, known: Sequence[SectionRows]
    ) -> Sequence[SectionRows]:
        """Return those of a scene with preloads. Collective."""
        if not scene.preloads:
            return ()
        with together(decomposition.comm):
            tearing, fixed, axes = decomposition.tearing, decomposition.fixed, decomposition.axes
            points = _section_points(scene, ties, tearing, fixed, axes)
        which, along = bonded_rows(points, decomposition)
        value = -np.einsum("rd,rd->r", along, points.normal[which])
        entries = value, (np.arange(len(which)), points.pair[which])
        drawn = sp.csr_matrix(entries, shape=(len(which), len(scene.preloads)))
        return (cls(points, which, along, drawn, axes=axes),)

    @classmethod
    def stored(cls, scene: Scene) -> Mapping[str, np.ndarray]:
        """Return the lengths at which bolts are held."""
        return {"lengths": _given_shortenings(scene)} if scene.preloads else {}

    @classmethod
    def continued(cls, scene: Scene, kept: Mapping[str, np.ndarray]) -> Scene:
        """Return the scene with the lengths of bolts that are held as they were, or as they were made."""
        lengths = kept.get("lengths", np.zeros(len(scene.preloads)))
        return replace(scene, preloads=held_at(scene, lengths)) if scene.preloads else scene

    def at_end(self, jump: np.ndarray) -> Mapping[str, np.ndarray]:
        """Return the lengths of all bolts."""
        return {"lengths": self.lengths(jump)}

    def right(self, scene: Scene, prescribed: np.ndarray) -> np.ndarray:
        """Return the given shortenings along the rows, shape (n_rows,), [length]."""
        return np.asarray(self.shortenings @ _given_shortenings(scene))

    def unknowns(self, scene: Scene) -> Unknowns:
        """Return the shortenings of preloads that have a force, in units of equal size over all nodes."""
        free, size = _free(scene), shortening_scales(scene)
        force = np.array([preload.force or 0.0 for preload in scene.preloads])
        columns = scaled_columns(self.shortenings[:, free], 1.0 / size[free])
        return Unknowns(columns, force[free] / size[free])

    def once(
        self, points: ContactPoints, ties: ContactPoints, scene: Scene, prescribed: np.ndarray
    ) -> tuple[ContactPoints, ContactPoints]:
        """Return the contact points, of two on both sides of a section one with the area of both."""
        return _once_at_sections(points, scene, NodeNumbers.of(scene)), ties

    def lengths(self, jump: np.ndarray) -> np.ndarray:
        """Return the shortening of each preload for values of B u, shape (n_preloads,), [length]."""
        drawn = self.shortenings
        return np.asarray((drawn.T @ jump) / np.asarray(drawn.power(2).sum(axis=0)).ravel())

    def begun(
        self, before: SectionRows, scene: Scene, jump: np.ndarray, multiplier: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the lengths of bolts that are held now, and the forces that were in those drawn now."""
        free = _free(scene)
        lengths, forces = before.lengths(jump), -np.asarray(before.shortenings.T @ multiplier)
        lengths[free] = 0.0
        crossed = np.diff(self.shortenings.indptr) > 0
        right = np.where(crossed, self.shortenings @ lengths, np.nan)
        return right, forces[free] / shortening_scales(scene)[free]

    def released(self, scene: Scene) -> tuple[sp.csr_matrix, np.ndarray]:
        """Return the normals over all nodes of sections that forces draw together, and these forces.

        They transmit nothing else along their normals.
        """
        points, free, dim = self.points, _free(scene), self.components
        scale = shortening_scales(scene)[free]
        mine = np.flatnonzero(np.isin(points.pair, free))
        column = np.searchsorted(free, points.pair[mine])
        value = points.normal[mine] / scale[column, None]
        row = dim * mine[:, None] + np.arange(dim)
        entries = value.ravel(), (row.ravel(), np.repeat(column, dim))
        forces = np.array([scene.preloads[number].force or 0.0 for number in free])
        return sp.csr_matrix(entries, shape=(dim * points.count, len(free))), -forces / scale

    def require_resisted(self, scene: Scene, moved: np.ndarray, least: float) -> None:
        """Reject forces that draw parts together between which nothing resists."""
        for number, way in zip(_free(scene), np.abs(moved), strict=True):
            preload = scene.preloads[number]
            if preload.force and way > least:
                raise InfeasibleError(
                    f"a preload must draw parts together, that of body {preload.body!r} acts against an open "
                    f"joint, force {preload.force:g}: add contacts or ties, or give a shortening"
                )


def _free(scene: Scene) -> np.ndarray:
    """Return the numbers of preloads whose shortening is unknown."""
    return np.flatnonzero([preload.is_free for preload in scene.preloads])


def _given_shortenings(scene: Scene) -> np.ndarray:
    """Return the prescribed shortenings, zero where a force is given and of bolts held as they were made."""
    return np.array([preload.shortening or 0.0 for preload in scene.preloads])


def shortening_scales(scene: Scene) -> np.ndarray:
    """Return the sizes of unit shortenings over all nodes of each section, shape (n_preloads,)."""
    counts = [each.count(scene.bodies[each.body].mesh) for each in scene.preloads]
    return np.sqrt(np.array(counts, dtype=np.float64))


def _section_points(
    scene: Scene,
    ties: ContactPoints,
    numbers: NodeNumbers,
    fixed: np.ndarray,
    axes: LocalAxes = NO_AXES,
    slight: float = 1e-9,
) -> ContactPoints:
    """Return the nodes on both sides of all sections as tied points, whose slaves lie behind them.

    `slight`: part of a normal that supports may hold: those of planes of symmetry have rounding.
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
                f"supports must leave sections of preloads free, hold {counted(int(held.sum()), 'node')} "
                f"of body {preload.body!r}: put it elsewhere, or hold only what is normal to it"
            )
        if np.isin(behind, ties.slave).any() and np.isin(before, ties.slave).any():
            raise InvalidInputError(
                f"a section must not cut slaves of ties, that of body {preload.body!r} does: put it elsewhere"
            )
        normals = np.tile(normal, (count, 1))
        master = sp.csr_matrix((np.ones(count), before, np.arange(count + 1)), shape=(count, numbers.n_nodes))
        nothing = np.zeros(count)
        given, pair = np.ones(count, dtype=bool), np.full(count, number)
        found.append(ContactPoints.at_nodes(pair, behind, master, normals, nothing, nothing, given=given))
    return join_points(found, scene.components, numbers.n_nodes)


def _once_at_sections(
    points: ContactPoints, scene: Scene, numbers: NodeNumbers, across: float = 0.1
) -> ContactPoints:
    """Return the contact points, of two on both sides of a section one with the area of both.

    Their nodes move alike across the section's normal: the force would be split at will. `across`: largest
    cosine between normals of contact and section with which they count as across.
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
    merged_nodes = points.merged_nodes.maximum(sp.csr_matrix(entries, shape=points.merged_nodes.shape))
    area = points.area + np.bincount(left, points.area[dropped], points.count)
    rest = np.setdiff1d(np.arange(points.count), dropped)
    return replace(points, area=area, merged_nodes=merged_nodes).part(rest)
