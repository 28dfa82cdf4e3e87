"""Facets of surfaces in contact or tied, with their centres as unknowns.

By the functions of 8 nodes a uniform pressure pulls at the corners of a facet, by 1/12 of the force each, by
those of 9 nodes it presses at all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from weakref import WeakKeyDictionary

from fenics_contact._scene.body import Body
from fenics_contact._scene.pairs import PairPart, Surface
from fenics_contact._scene.parts import SceneParts
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.serendipity_cells import completed

_FREED: WeakKeyDictionary[BodyMesh, dict[tuple[str, ...], BodyMesh]] = WeakKeyDictionary()
"""Meshes with centres as unknowns: scenes made of the same bodies have the same meshes."""


def _pressed(pair: PairPart) -> tuple[Surface, ...]:
    """Return the sides of a pair on which pressures act: none on a slave of which single nodes touch."""
    return pair.surfaces[1:] if pair.single_nodes else pair.surfaces


def with_free_centres(scene: SceneParts) -> Mapping[str, Body]:
    """Return the bodies of a scene, the centres of facets in contact or tied as unknowns."""
    bodies = dict(scene.bodies)
    for name, body in scene.bodies.items():
        if not body.mesh.centres:
            continue
        sides = (side for pair in (*scene.contacts, *scene.ties) for side in _pressed(pair))
        touching = tuple(sorted({side.name for side in sides if side.body == name}))
        if touching:
            known = _FREED.setdefault(body.mesh, {})
            if touching not in known:
                known[touching] = completed(body.mesh, *touching)
            if known[touching] is not body.mesh:
                bodies[name] = replace(body, mesh=known[touching])
    return bodies
