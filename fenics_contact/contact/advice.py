"""Words for load steps that end: what a scene has that often ends them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.display import counted
from fenics_contact.mesh import vector_areas
from fenics_contact.scene import ContactPair, Scene, Surface
from fenics_contact.surfaces import outside

if TYPE_CHECKING:
    from fenics_contact.contact.state import State

#: Facets lie in one plane if the cosine of the angle between them differs from one by no more than this.
FLAT = 1e-9


def advice(scene: Scene, last: State | None = None, *, moves: bool) -> str:
    """Return words to append to the message of a load step that ends, empty where there is nothing to say.

    Args:
        scene: The scene.
        last: The last state that was reached, or None.
        moves: Whether contact is that of bodies that move far.
    """
    moving = _on_contact(scene) + ("" if last is None else _on_ends(last)) if moves else ""
    return moving + _on_symmetry(scene)


def _on_ends(last: State) -> str:
    """Return words on nodes that press on masters from beyond their ends, empty if there are none.

    Where such a node is lost, its force ends at once, and it may come back: no equilibrium is near.
    """
    contact, points, found = last.contact, last.contact.points, []
    total = contact.normal_force.sum()
    for index, pair in enumerate(last.scene.contacts):
        mine = np.flatnonzero((points.pair == index) & (points.facet >= 0) & (contact.normal_force > 0.0))
        if isinstance(pair.master, Surface) and len(mine):
            corners = last.scene.facets(pair.master).shape[1]
            beyond = mine[outside(points.local[mine], corners) > 0.0]
            share = contact.normal_force[beyond].sum() / total
            if share > 0.0:
                surface = f"of surface {pair.slave.name!r}"
                nodes = counted(len(beyond), f"node {surface} presses", f"nodes {surface} press")
                found.append(
                    f"; {nodes} on {pair.master.name!r} from beyond its end with {share:.1%} of the normal "
                    "force, which ends where the master is left: let that reach further there"
                )
    return "".join(found)


def _on_contact(scene: Scene) -> str:
    """Return words on surfaces that slide by nodes and could by mortar, empty if there are none.

    Slave nodes rest in hollows between nodes of the master; where they leave them together, as two bodies
    that are pressed in perfect symmetry, no equilibrium may be near that mortar has.
    """

    def by_nodes(pair: ContactPair) -> bool:
        if pair.by_mortar or pair.within_body or not isinstance(pair.master, Surface):
            return False
        return all(scene.bodies[side.body].mesh.order == 1 for side in (pair.slave, pair.master))

    if not any(map(by_nodes, scene.contacts)):
        return ""
    return "; surfaces of bodies meet more smoothly with discretisation='mortar' than by nodes"


def _on_symmetry(scene: Scene) -> str:
    """Return words on flat sides beside contact on which nothing acts, as on a forgotten plane of symmetry.

    A side with another one parallel to it is more likely to be free.
    """
    acting = [*scene.supports, *(load for load in scene.loads if hasattr(load, "surface"))]
    used = {(each.body, each.surface) for each in acting}
    sides = [side for pair in scene.contacts for side in (pair.slave, pair.master)]
    sides += [side for tie in scene.ties for side in (tie.slave, tie.master)]
    used |= {(side.body, side.name) for side in sides if isinstance(side, Surface)}
    found = []
    for name, body in scene.bodies.items():
        mesh = body.mesh
        touching = [mesh.surfaces[side].ravel() for side in mesh.surfaces if _meets(scene, name, side)]
        flat = {side: normal for side in mesh.surfaces if (normal := _normal(scene, name, side)) is not None}
        for side, normal in flat.items():
            alone = sum(abs(normal @ other) > 1.0 - FLAT for other in flat.values()) == 1
            beside = touching and np.isin(mesh.surfaces[side], np.concatenate(touching)).any()
            if alone and beside and (name, side) not in used:
                found.append(f"surface {side!r} of body {name!r}")
    if not found:
        return ""
    which = f"{', '.join(found)}, on which nothing acts"
    return f"; where a flat side is a plane of symmetry it needs a support along its normal: see {which}"


def _meets(scene: Scene, body: str, side: str) -> bool:
    """Return whether a surface is one of a contact pair."""
    return any(Surface(body, side) in (pair.slave, pair.master) for pair in scene.contacts)


def _normal(scene: Scene, body: str, side: str) -> np.ndarray | None:
    """Return the normal of a surface, shape (dim,), None where it is not flat."""
    mesh = scene.bodies[body].mesh
    areas = vector_areas(mesh.points, mesh.surfaces[side])
    normals = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    return normals[0] if len(normals) and np.all(normals @ normals[0] >= 1.0 - FLAT) else None
