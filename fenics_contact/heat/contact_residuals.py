"""What contacts that pass heat at points miss of an integral over their surfaces."""

from __future__ import annotations

import numpy as np

from fenics_contact._adaptive.contact_residuals import Places
from fenics_contact._scene.parts import slave_of, surface_of
from fenics_contact._surfaces.projection import node_weights, project
from fenics_contact.errors import together
from fenics_contact.heat.curvature import stretch
from fenics_contact.heat.joints import opposite_at
from fenics_contact.heat.state import HeatState
from fenics_contact.mesh.faces import corners_of, match_faces


def between_points(state: HeatState, weight: np.ndarray) -> tuple[float, dict[str, np.ndarray]]:
    """Return Σ A q w − ∫ q w of the heat q that passes through contacts, w the jump of weights. Collective.

    And by body the shares of its cells, (n_cells,), those whose facets sum to another value.
    """
    scene, total = state.scene, 0.0
    shares = {name: np.zeros(body.mesh.n_cells) for name, body in scene.bodies.items()}
    for number, contact in enumerate(scene.contacts):
        missed, mesh = _of_contact(state, number, weight), scene.bodies[contact.slave.body].mesh
        boundary, cells = mesh.boundary
        facets = mesh.surfaces[contact.slave.name]
        own = np.unique(cells[match_faces(corners_of(facets, mesh.dim), corners_of(boundary, mesh.dim))])
        around = np.maximum(np.bincount(mesh.cells[own].ravel(), minlength=mesh.n_nodes), 1)
        # Nodes of quadratic facets miss much with opposite signs.
        shares[contact.slave.body][own] += np.abs((missed / around)[mesh.cells[own]].sum(axis=1))
        total += float(missed.sum())
    return total, shares


def _of_contact(state: HeatState, number: int, weight: np.ndarray) -> np.ndarray:
    """Return Σ A q w − ∫ q w of a contact by nodes of the slave's body, (n_nodes,). Collective.

    Where facets face the master with a part alone, points there have weights such that all of the area is
    that of the points of contact; what their nodes miss is known of all of them together.
    """
    scene, points, comm = state.scene, state.joints.points, state.torn.decomposition.comm
    pair, through = scene.geometry.contacts[number], state.contacts[number]
    surface = slave_of(scene.geometry, pair, pair.slave_geometry)
    nodes = state.torn.decomposition.tearing.global_nodes(pair.slave.body, surface.nodes)
    mine, fields = np.flatnonzero(points.pair == number), np.column_stack([state.values, weight])
    place = np.searchsorted(nodes, points.slave[mine])
    conductance, known, result = np.zeros((3, len(nodes)))
    conductance[place], known[place] = through.conductance, 1.0
    with together(comm):
        facets = np.flatnonzero(known[surface.facets].any(axis=1))[comm.rank :: comm.size]
        at = Places.of(surface, facets, degree=4)
        facing, theirs = _opposite(state, number, at, fields)
        facet = np.repeat(np.arange(len(facets)), len(at.weight) // max(len(facets), 1))
        counts = (np.bincount(each, minlength=len(facets)) for each in (facet, facet[facing]))
        whole = np.equal(*counts) & known[surface.facets[facets]].all(axis=1)
        cut = np.bincount(surface.facets[facets[~whole]].ravel(), minlength=len(nodes))
        at, whole = at.part(facing), whole[facet[facing]]
        area = at.weight * (at.values @ stretch(surface)) * scene.bodies[pair.slave.body].thickness
        jump, share = at.values @ fields[nodes] - theirs, at.values @ known
        h = np.divide(at.values @ conductance, share, out=np.zeros_like(share), where=share > 0.0)
    inside, partly = comm.allreduce(np.array([area[whole].sum(), area[~whole].sum()]))
    scale = (state.joints.area[mine].sum() - inside) / partly if partly > 0.0 else 1.0
    area = np.where(whole, 1.0, scale) * area
    integral = comm.allreduce(at.values.T @ (area * h * jump[:, 0] * jump[:, 1]))
    result[place] = through.heat * (points.jump @ weight)[mine]
    missed, cut = result - integral, np.flatnonzero(comm.allreduce(cut))
    missed[cut] = missed[cut].sum() / max(len(cut), 1)
    by_node = np.zeros(scene.bodies[pair.slave.body].mesh.n_nodes)
    by_node[surface.nodes] = missed
    return by_node


def _opposite(state: HeatState, number: int, at: Places, fields: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which points face the master, and fields there, (n, 2): the temperature and another one."""
    scene, contact = state.scene, state.scene.contacts[number]
    pair = scene.geometry.contacts[number]
    if pair.between_bodies:
        master = surface_of(scene.geometry, pair.master_surface, pair.geometry)
        nodes = state.torn.decomposition.tearing.global_nodes(pair.master_surface.body, master.nodes)
        hit = project(at.points, at.normal, master)
        return hit.point, np.asarray(node_weights(master, hit) @ fields[nodes])
    given = opposite_at(contact, at.points)
    return np.arange(len(at.points)), np.column_stack([given, np.zeros_like(given)])
