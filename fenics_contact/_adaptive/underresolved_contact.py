"""Spots of contact that are smaller than the cells around them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.pair_geometry import hertz_spot, modulus_of, whole_force
from fenics_contact._scene.parts import surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.results.resolution import BetweenNodes, CoarsePeak
from fenics_contact.results.state import State

#: Halves marked cells of bodies.
Refine = Callable[[Scene, Mapping[str, np.ndarray]], SceneRefinement]


def underresolved_pairs(state: State) -> list[int]:
    """Return the numbers of the contact pairs whose spot is too small for its cells, or but one facet.

    Also of those that touch between nodes.
    """
    places = {each.place for each in state.peak_uncertainties if isinstance(each, CoarsePeak | BetweenNodes)}
    closed = state.contact.points.pair[state.contact.normal_force > 0.0]
    pressing = np.bincount(closed, minlength=len(state.scene.contacts))
    few = (pressing > 0) & (pressing <= 2 ** (state.scene.dim - 1))
    return [n for n, pair in enumerate(state.scene.contacts) if few[n] or pair.place in places]


def refined_at_spots(
    state: State, pairs: Sequence[int], across: float = 2.0, most: int = 8, *,
    scene: Scene | None = None, refine: Refine = refine_scene,
) -> SceneRefinement:  # fmt: skip
    """Halve the cells at the spots of some contact pairs until a spot is wider than they are.

    Where but one facet presses and Hertz's theory gives the size of the spot under the force that it
    transmits, cells are halved until so many lie across its half width; else once. `across`: number of cells;
    `scene`: the scene in another shape, with the same cells, that is refined in place of the state's.
    """
    scene = state.scene if scene is None else scene
    spots = [_Spot.of(state, number, scene) for number in pairs]
    found = SceneRefinement(scene, {})
    for again in range(most):
        marked: dict[str, np.ndarray] = {}
        for spot in spots:
            if again and spot.half_width == 0.0:
                continue
            wide = spot.half_width / across if again else 0.0
            for name in spot.bodies:
                cells = cells_at(found.scene.bodies[name].mesh, spot.points, wide, spot.half_width)
                marked[name] = np.union1d(marked.get(name, cells), cells)
        marked = {name: cells for name, cells in marked.items() if len(cells)}
        if not marked:
            break
        found = refine(found.scene, marked).after(found)
    return found


@dataclass(frozen=True, eq=False)
class _Spot:
    """Where a pair presses.

    `points`: places of the points that press, or of the one that comes nearest; `half_width`: half the width
    of the spot, zero where it is not known.
    """

    bodies: tuple[str, ...]
    points: np.ndarray
    half_width: float

    @classmethod
    def of(cls, state: State, number: int, scene: Scene) -> _Spot:
        """Return the spot of a pair, at its place in another shape of the scene."""
        contact, pair = state.contact, state.scene.contacts[number]
        mine, first = contact.on_pair(number), NodeNumbers.of(scene).first_of(pair.slave.body)
        nodes, name = contact.points.slave[mine] - first, pair.slave.body
        places, shown = (each.bodies[name].mesh.points[nodes] for each in (state.scene, scene))
        pressing = contact.normal_force[mine] > 0.0
        if not pressing.any():  # it touches between nodes: those that come nearest are around
            pressing[np.argmin(contact.gap[mine])] = True
        bodies = tuple(dict.fromkeys(side.body for side in pair.surfaces))
        return cls(bodies, shown[pressing], _half_width(state, number, places))


def cells_at(mesh: BodyMesh, places: np.ndarray, wide: float, around: float = 0.0) -> np.ndarray:
    """Return the cells that may reach some places and are wider than some length."""
    corners = mesh.points[mesh.cells]
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    away, _ = cKDTree(places).query(middle)
    width = 2.0 * reach / np.sqrt(mesh.dim)  # the edge of squares and cubes
    return np.flatnonzero((away <= reach + around) & (width > wide))


def _half_width(state: State, number: int, places: np.ndarray) -> float:
    """Return half the width, by Hertz's theory, of a contact of one facet at most; zero if unknown."""
    contact, scene, pair = state.contact, state.scene, state.scene.contacts[number]
    mine, modulus = contact.on_pair(number), modulus_of(scene, pair)
    force = contact.normal_force[mine]
    if modulus is None or np.count_nonzero(force) > 2 ** (scene.dim - 1):
        return 0.0
    slave, points = surface_of(scene, pair.slave, "faceted"), contact.points
    node = points.slave[mine[np.argmax(force)]] - NodeNumbers.of(scene).first_of(pair.slave.body)
    whole, radius = whole_force(scene, slave, int(np.searchsorted(slave.nodes, node)), float(force.sum()))
    spot = hertz_spot(whole, modulus, places, points.normal[mine], points.gap[mine], radius=radius)
    return spot.half_width if spot else 0.0
