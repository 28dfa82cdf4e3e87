"""The state at the end of a load step on the rows of the next, with other supports or contact pairs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.local_axes import same_axes
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene.supports import AnySupport
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.carried import carried_over
from fenics_contact.feti.decomposition import Decomposition, prescribed_along
from fenics_contact.feti.joints import JOINTS
from fenics_contact.feti.torn import TornSystem, build_torn_system, contacts_alike, with_points_inside
from fenics_contact.results.state import State


def prescribed_as_is(torn: TornSystem, displacement: np.ndarray, after: Decomposition) -> np.ndarray:
    """Return what supports would prescribe that hold nodes where those of a state have them. Collective.

    What both hold keeps its numbers, so that what rests does so exactly; what is held newly has the
    displacement of the state. Returns shape (n_nodes, dim), NaN where free, along the axes of nodes,
    [length].
    """
    known, axes = prescribed_along(torn.scene, torn.decomposition.tearing)
    there, nodes = np.zeros_like(known), np.flatnonzero(after.fixed.any(axis=1))
    there[nodes] = nodal_mean_at(after, displacement, nodes)
    there = after.axes.to_local(there)
    kept = ~np.isnan(known) & ~_moving(torn)[:, None]
    if not same_axes(axes, after.axes):
        for each in (axes, after.axes):
            kept[each.nodes] = False
    return np.where(after.fixed, np.where(kept, known, there), np.nan)


def _moving(torn: TornSystem) -> np.ndarray:
    """Return the nodes of rigid surfaces whose motion is not prescribed, shape (n_nodes,)."""
    marks = np.zeros(torn.decomposition.tearing.n_nodes, dtype=bool)
    for surface in torn.scene.rigid_surfaces:
        if surface.free.any():
            own = torn.scene.bodies[surface.body].mesh.nodes_to_hold(surface.surface)
            marks[torn.decomposition.tearing.global_nodes(surface.body, own)] = True
    return marks


def with_kept(scene: Scene, before: State | None) -> Scene:
    """Return the scene of a load step with the displacements that its supports keep. Collective."""
    if before is None or not any(support.keeps for support in scene.supports):
        return scene
    return replace(scene, supports=[_kept(support, scene, before) for support in scene.supports])


def require_values_to_keep(step: LoadStep, scene: Scene) -> None:
    """Reject supports that are functions of time and keep what nodes have: they are asked on the way, too."""
    if callable(step.supports) and any(support.keeps for support in scene.supports):
        raise InvalidInputError(
            f"supports of LoadStep {step.name!r} as functions of time cannot HoldCurrent: give them in a list"
        )


def _kept(support: AnySupport, scene: Scene, before: State) -> AnySupport:
    """Return a support with displacements of a state where it keeps them. Collective."""
    if not support.keeps:
        return support
    mesh, tearing = scene.bodies[support.body].mesh, before.torn.decomposition.tearing
    for roller in support.rollers:
        held = scene.directions_of(roller)
        moved = _moved_at(before, tearing.global_nodes(roller.body, held.nodes))
        along = np.einsum("nd,nd->n", moved, held.directions)
        return replace(roller, displacement=NodeValues(mesh.points[held.nodes], along))
    nodes = mesh.nodes_to_hold(support.surface)
    every = tearing.global_nodes(support.body, nodes)
    moved = _moved_at(before, every)
    known, axes = prescribed_along(before.torn.scene, tearing)
    plain = ~_moving(before.torn)
    plain[axes.nodes] = False
    moved = np.where(~np.isnan(known[every]) & plain[every, None], known[every], moved)
    return support.keeping(mesh.points[nodes], moved)


def _moved_at(before: State, nodes: np.ndarray) -> np.ndarray:
    """Return the displacements of nodes of a state, (n, components), [length]. Collective."""
    return nodal_mean_at(before.torn.decomposition, before.torn_displacement, nodes)


def kept_by_joints(before: State) -> dict[str, np.ndarray]:
    """Return what the joints of a state keep for the next load step, by name. Collective."""
    torn, kept = before.torn, dict[str, np.ndarray]()
    drawn = [joint for joint in torn.groups.joints if joint.draws]
    jump = torn.jump(before.torn_displacement) if drawn else np.zeros(0)
    for joint in drawn:
        kept |= joint.at_end(torn.gathered(jump, joint))
    return kept


def continued(scene: Scene, kept: Mapping[str, np.ndarray]) -> Scene:
    """Return the scene of a load step with what its joints have kept of the one before."""
    for kind in JOINTS:
        scene = kind.continued(scene, kept)
    return scene


def has_rows_of(state: State, after: TornSystem) -> bool:
    """Return whether the rows of a state are those of a system, which holds the same, with the same pairs."""
    same = state.torn.decomposition is after.decomposition
    same = same and state.torn.points.are_at_nodes and after.points.are_at_nodes
    return same and contacts_alike(state.scene, after.scene)


def on_rows_of(state: State, after: TornSystem) -> tuple[TornSystem, np.ndarray]:
    """Return the system of a state on other rows, where its supports are, and its multipliers. Collective."""
    decomposition, displacement = after.decomposition, state.torn_displacement
    scene = replace(state.scene, supports=after.scene.supports, contacts=after.scene.contacts)
    torn = with_points_inside(build_torn_system(scene, decomposition, overlap=True, previous=after), after)
    now, _ = prescribed_along(scene, decomposition.tearing)
    was = prescribed_as_is(state.torn, displacement, decomposition)
    torn = torn.moved_further(np.nan_to_num(was - now))
    return torn, carried_over(state.torn, state.solution.multiplier, torn)
