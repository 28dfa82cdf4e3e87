"""Whether steady temperatures are determined: each body needs a given one, or a way for heat to one."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact._scene.pairs import Surface
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.heat.joints import Joints
from fenics_contact.heat.parts import HeldTemperature
from fenics_contact.heat.scene import HeatScene


def require_agreement(scene: HeatScene) -> None:
    """Raise where temperatures that are held differ at nodes that they share."""
    known: dict[str, list[tuple[HeldTemperature, np.ndarray, np.ndarray]]] = {}
    largest = 0.0
    for held in scene.held:
        mesh = scene.bodies[held.body].mesh
        nodes = mesh.nodes_to_hold(held.surface)
        values = held.values(mesh.points[nodes])
        largest = max(largest, np.abs(values).max())
        for other, theirs, given in known.setdefault(held.body, []):
            _, here, there = np.intersect1d(nodes, theirs, return_indices=True)
            apart = np.abs(values[here] - given[there])
            wrong = np.flatnonzero(apart > 1e-12 * largest)
            if len(wrong):
                at = wrong[0]
                raise InvalidInputError(
                    f"temperatures held at {held.place} and {other.place} must agree where both meet, got "
                    f"{values[here][at]:g} and {given[there][at]:g} at {mesh.points[nodes[here][at]]}: give "
                    "one of them as a function of points, or hold nodes that they do not share"
                )
        known[held.body].append((held, nodes, values))


def require_agreement_across_ties(scene: HeatScene, joints: Joints, held: np.ndarray) -> None:
    """Raise where ties join nodes that are held at different temperatures, and nothing else.

    `held`: temperatures of all nodes, NaN where free, (n_nodes,).
    """
    jump, known = joints.tied.jump, np.isfinite(held)
    free = abs(jump) @ (~known).astype(float) > 1e-9  # what mortar rounds to is nothing
    apart = np.where(free, 0.0, jump @ np.where(known, held, 0.0))
    wrong = np.flatnonzero(np.abs(apart) > 1e-12 * np.abs(held[known]).max(initial=0.0))
    if len(wrong):
        tie, node = scene.ties[joints.tied.pair[wrong[0]]], joints.tied.slave[wrong[0]]
        raise InvalidInputError(
            f"temperatures that are held must agree where the tie of {tie.place} joins them, got "
            f"{held[node]:g} and {held[node] - apart[wrong[0]]:g} at {scene.geometry.points[node]}: hold "
            "nodes that the tie does not reach, or give one of them as a function of points"
        )


def require_temperatures(scene: HeatScene, joints: Joints, conductance: np.ndarray) -> None:
    """Raise `InfeasibleError` where nothing gives a temperature to bodies that heat joins.

    `conductance`: h at the points of contacts, (n,), [power / (length² · degree)].
    """
    through = [scene.contacts[number] for number in np.unique(joints.points.pair[conductance > 0.0])]
    between = [each for each in through if isinstance(each.master, Surface)]
    tied = [scene.ties[number] for number in np.unique(joints.tied.pair)]
    given = {part.body for part in (*scene.held, *scene.loads) if part.gives_temperature}
    given |= {each.slave.body for each in through if each not in between}
    names = list(scene.bodies)
    joined = [[names.index(side.body) for side in (each.slave, each.master)] for each in (*between, *tied)]
    ends = np.array(joined, dtype=int).reshape(-1, 2).T
    _, island = connected_components(sp.coo_matrix((np.ones(ends.shape[1]), ends), (len(names),) * 2))
    lost = [name for name, own in zip(names, island, strict=True) if own not in
            {island[names.index(known)] for known in given}]  # fmt: skip
    if lost:
        heating = [f"{type(each).__name__} {each.place}" for each in scene.loads if each.body in lost]
        blocked = [each.place for each in scene.contacts if each not in through]
        raise InfeasibleError(
            f"a steady state needs a temperature that is given to each body, {' and '.join(map(repr, lost))} "
            + (f"have none and heat of {' and '.join(heating)} has no way out" if heating else
               "have none and no heat: any temperature would do")
            + ": hold a temperature there, add Convection, Radiation or an obstacle, or join what has one"
            + (f"; no heat passes through {' and '.join(blocked)}, by conductance, pressure and gap"
               if blocked else "")
        )  # fmt: skip
