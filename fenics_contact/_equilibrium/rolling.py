"""Rounded surfaces that roll where they should slide, as normals of small displacements stay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.parts import surface_of
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import project
from fenics_contact.results.state import State


@dataclass(frozen=True)
class Rolling:
    """How far gaps change by slip s over a surface of curvature κ, ½ κ s², as if its body rolled.

    `surface`: the surface along whose normals gaps are measured; `gap`: the largest change, `slip`: the slip
    there, [length].
    """

    surface: Surface
    gap: float
    slip: float


def rolling(state: State, number: int, least: float, loaded: float = 0.1, sharp: float = 0.5) -> Rolling:
    """Return how gaps of a pair between bodies change by slip, at most; zero where that is at most ``least``.

    Gaps are measured along normals of the slave by mortar, of the master by nodes. Where both surfaces are
    curved alike, as a shaft in its hole, slip changes nothing. Collective. `loaded`: pressure, relative to
    the largest one, from which a point counts; `sharp`: change of a normal from which it is that of an edge.
    """
    contact, scene, pair = state.contact, state.scene, state.scene.contacts[number]
    surface = pair.surfaces[0 if pair.by_mortar else -1]
    nothing, mine = Rolling(surface, 0.0, 0.0), contact.on_pair(number)
    pressed = mine[contact.pressure[mine] > loaded * contact.pressure[mine].max(initial=0.0)]
    if not pair.between_bodies or pair.is_self_contact or not len(pressed):
        return nothing
    slip = np.einsum("na,nad->nd", contact.total_slip[pressed], contact.points.tangents[pressed])
    slip = slip[:, : scene.dim]  # around an axis of revolution surfaces are alike
    if 0.5 * sharp * np.linalg.norm(slip, axis=1).max() <= least:
        return nothing
    slave, master = (surface_of(scene, side, pair.geometry) for side in pair.surfaces)
    first = NodeNumbers.of(scene).first_of(pair.slave.body)
    at = np.searchsorted(slave.nodes, contact.points.slave[pressed] - first)
    points, normals = slave.points[at], slave.normals[at]
    over_slave, over_master = (
        -0.5 * np.einsum("nd,nd->n", slip, _turned(surface, points, facing, shift, sharp))
        for surface, facing, shift in ((slave, -normals, -slip), (master, normals, slip))
    )
    own = over_slave if pair.by_mortar else over_master
    change = np.minimum(np.abs(own), np.abs(over_slave - over_master))
    worst = int(np.argmax(change))
    found = Rolling(surface, float(change[worst]), float(np.linalg.norm(slip[worst])))
    return found if found.gap > least else nothing


def _turned(
    surface: FacetedSurface, points: np.ndarray, facing: np.ndarray, shift: np.ndarray, sharp: float
) -> np.ndarray:
    """Return how normals of a surface change where points that face it are shifted, shape (n, dim).

    Zero where it ends and at edges.
    """
    here, there = (project(each, facing, surface) for each in (points, points + shift))
    both, i, j = np.intersect1d(here.point, there.point, return_indices=True)
    change = np.zeros_like(points)
    change[both] = there.normal[j] - here.normal[i]
    change[np.linalg.norm(change, axis=1) > sharp] = 0.0
    return change
