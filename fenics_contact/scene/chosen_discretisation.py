"""Where contact and ties are enforced, by nodes or by mortar: the choice of a scene, with its reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.mesh import BodyMesh, coordinate_rounding
from fenics_contact.scene.pairs import ContactPair, Discretisation, Surface, Tie
from fenics_contact.surfaces import FacetedSurface, faceted_surface, project

if TYPE_CHECKING:
    from fenics_contact.scene.parts import SceneParts

#: Nodes match where they lie over each other within this fraction of the shortest edge of their facets.
MATCHING = 1e-3
#: Number of nodes that are projected first, those nearest to the master: one that meets it decides.
FIRST = 50
#: Why every contact with an obstacle is by nodes.
RIGID = "as the master is rigid"
#: Reason of a choice that other meshes do not change.
REMESHED = "as on the meshes before the last one"

Pair = TypeVar("Pair", ContactPair, Tie)
AnyScene = TypeVar("AnyScene", bound="SceneParts")

_KNOWN: WeakKeyDictionary[BodyMesh, WeakKeyDictionary[BodyMesh, dict[tuple[str, str], bool]]] = (
    WeakKeyDictionary()
)
"""Whether surfaces of two meshes match, shared with reshaped meshes."""


def with_discretisation(scene: SceneParts, pairs: Sequence[Pair]) -> tuple[Pair, ...]:
    """Return pairs with the discretisation that they were given, or with the better one of the scene.

    It is that of the undeformed meshes before any design moved them, the same for all loads.

    Args:
        scene: The scene.
        pairs: Its contact pairs or ties.
    """
    return tuple(_with_choice(scene, pair) for pair in pairs)


def keeping_discretisation(scene: AnyScene) -> AnyScene:
    """Return the scene with choices that stay when its bodies get other meshes."""
    return replace(scene, contacts=[*map(_kept, scene.contacts)], ties=[*map(_kept, scene.ties)])


def in_words(pair: ContactPair | Tie) -> str:
    """Return the discretisation of a pair and, where the scene chose it, why."""
    if not isinstance(pair.master, Surface):
        return f"node, {RIGID}"
    return pair.reason or pair.discretisation


def _with_choice(scene: SceneParts, pair: Pair) -> Pair:
    chosen = pair.discretisation == "best" or bool(pair.reason)
    if not chosen or pair.reason.endswith(REMESHED):
        return pair
    found, why = _choice(scene, pair)
    reason = f"{found}, {why}"
    return pair if pair.reason == reason else replace(pair, discretisation=found, reason=reason)


def _kept(pair: Pair) -> Pair:
    """Return a pair whose choice does not depend on meshes any more."""
    return replace(pair, reason=f"{pair.discretisation}, {REMESHED}") if pair.reason else pair


def _choice(scene: SceneParts, pair: ContactPair | Tie) -> tuple[Discretisation, str]:
    """Return the better discretisation of a pair, and why."""
    if not isinstance(pair.master, Surface):
        return "node", RIGID
    if pair.master.body == pair.slave.body:
        return "node", "as the body meets itself"
    sides = pair.slave, pair.master
    slave, master = (scene.bodies[side.body].mesh.origin for side in sides)
    if max(slave.order, master.order) > 1:
        return "node", "as there is no mortar for quadratic cells"
    known = _KNOWN.setdefault(slave, WeakKeyDictionary()).setdefault(master, {})
    names = pair.slave.name, pair.master.name
    if names not in known:
        known[names] = surfaces_match(*map(_faceted, (slave, master), names))
    return ("node", "as the meshes match") if known[names] else ("mortar", "as the meshes do not match")


def _faceted(mesh: BodyMesh, surface: str) -> FacetedSurface:
    return faceted_surface(mesh.points, mesh.surfaces[surface])


def surfaces_match(slave: FacetedSurface, master: FacetedSurface) -> bool:
    """Return whether the facets of two surfaces are the same where the surfaces meet.

    Their nodes lie over each other along the slave's normals within `MATCHING`, also across a gap, and no
    slave node without such a partner meets the master. Then contact by nodes passes the patch test.

    Args:
        slave: The slave.
        master: The master.
    """
    if slave.corners != master.corners:
        return False
    away, partner = cKDTree(master.points).query(slave.points)
    apart = master.points[partner] - slave.points
    apart -= np.einsum("nd,nd->n", apart, slave.normals)[:, None] * slave.normals
    reach = MATCHING * _shortest_edges(master)[partner] + coordinate_rounding(master.points)
    over = np.linalg.norm(apart, axis=1) <= reach
    if not _same_facets(slave.facets[over[slave.facets].all(axis=1)], partner, master.facets):
        return False
    others = np.flatnonzero(~over)
    others = others[np.argsort(away[others], kind="stable")]
    parts = others[:FIRST], others[FIRST:]
    return not any(len(part) and _meet(slave, part, master) for part in parts)


def _same_facets(facets: np.ndarray, partner: np.ndarray, master: np.ndarray) -> bool:
    """Return whether facets of a slave, at least one, are facets of the master between partners."""
    mine = np.unique(np.sort(partner[facets], axis=1), axis=0)
    known = np.unique(np.sort(master, axis=1), axis=0)
    return len(mine) > 0 and len(np.unique(np.concatenate([known, mine]), axis=0)) == len(known)


def _meet(slave: FacetedSurface, nodes: np.ndarray, master: FacetedSurface) -> bool:
    return len(project(slave.points[nodes], slave.normals[nodes], master).point) > 0


def _shortest_edges(surface: FacetedSurface) -> np.ndarray:
    """Return the length of the shortest edge at each node, shape (n,), [length]."""
    corners = surface.points[surface.facets]
    shortest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min(axis=1)
    result = np.full(len(surface.points), np.inf)
    np.minimum.at(result, surface.facets, shortest[:, None])
    return result
