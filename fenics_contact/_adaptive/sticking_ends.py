"""Ends of plane contacts that stick on large cells and may slip on smaller ones."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce

import numpy as np

from fenics_contact._adaptive.refined_scene import SceneRefinement, refined_again
from fenics_contact._adaptive.underresolved_contact import cells_at
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.scene import Scene
from fenics_contact.design.objective import Objective
from fenics_contact.mesh.refinement import halves_together
from fenics_contact.results.contact import Status
from fenics_contact.results.state import State


def depends_on_slip(objective: Objective) -> bool:
    """Return whether a quantity is made of slip, so that a spot of it that no mesh shows is missing in it."""
    return bool(getattr(objective, "is_of_slip", False))


def refined_at_sticking_ends(
    state: State, found: SceneRefinement, halvings: int = 3, finest: float = 1e-7
) -> SceneRefinement:
    """Halve the cells around ends of contact that may slip on smaller cells some more times.

    Towards the corner of a body that presses, friction may need more and more of what the normal force
    allows. Then it slips there, in a zone far smaller than a cell, and estimates see nothing of that: the
    node at the corner sticks. Work of friction was 14 % too small for such a zone of 0.2 % of the surface. An
    end is a node, and these cells are few. `finest`: width of cells that are not halved any more, relative to
    the slave.
    """
    ends = {number: sticking_ends(state, number) for number in range(len(state.scene.contacts))}

    def around(scene: Scene) -> Mapping[str, np.ndarray]:
        marked: dict[str, list[np.ndarray]] = {}
        for number, places in ((n, each) for n, each in ends.items() if len(each)):
            pair = scene.contacts[number]
            least = finest * float(np.ptp(scene.bodies[pair.slave.body].mesh.points, axis=0).max())
            for side in pair.surfaces:
                if not halves_together(mesh := scene.bodies[side.body].mesh):
                    marked.setdefault(side.body, []).append(cells_at(mesh, places, least))
        return {name: reduce(np.union1d, cells) for name, cells in marked.items()}

    return refined_again(found, around, halvings)


def sticking_ends(state: State, number: int, most: float = 10.0) -> np.ndarray:
    """Return the places of the ends of a contact that stick and may slip on smaller cells, (n, dim).

    There friction needs a share q of what the normal force allows, and p < q one node further inside. If q
    rises by q - p again with every halving of the cells, it is 1 after (1 - q) / (q - p) of them. None in
    space, where ends are lines. `most`: number of halvings, beyond which a zone of slip is too small to
    count.
    """
    contact, scene = state.contact, state.scene
    pair = scene.contacts[number]
    mesh = scene.bodies[pair.slave.body].mesh
    if scene.dim > 2 or not pair.has_friction:
        return np.zeros((0, scene.dim))
    nodes, of_point = contact.points.of_surface(number, np.arange(contact.points.count))
    nodes = nodes - NodeNumbers.of(scene).first_of(pair.slave.body)
    status, share = np.zeros(mesh.n_nodes, dtype=int), np.zeros(mesh.n_nodes)
    status[nodes] = contact.status[of_point]
    allowed = np.where(contact.slip_bound > 0.0, contact.slip_bound, np.inf)
    share[nodes] = (np.linalg.norm(contact.friction_force, axis=1) / allowed)[of_point]
    facets = mesh.surfaces[pair.slave.name][:, :2]
    facets = facets[(status[facets] != Status.OPEN).all(axis=1)]
    single = np.bincount(facets.ravel(), minlength=mesh.n_nodes)[facets] == 1
    end, inner = np.concatenate([facets[single[:, 0]], facets[single[:, 1]][:, ::-1]]).T
    sticking = (status[end] == Status.STICK) & (status[inner] == Status.STICK)
    rising = (1.0 - share[end]) < most * (share[end] - share[inner])
    return np.asarray(mesh.points[end[sticking & rising]])
