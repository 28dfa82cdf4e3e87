"""The discretisation of pairs and ties: that which they were given, or the better one of their scene."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias, TypeVar, cast
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._scene.choice import Choice
from fenics_contact._scene.corners import with_corner_as_slave
from fenics_contact._scene.pairs import ContactPair, Discretisation
from fenics_contact._scene.parts import SceneParts
from fenics_contact._scene.sectors import AnyTie, CyclicSymmetry
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact._surfaces.projection import surfaces_match
from fenics_contact.errors.kinds import safe_log
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.mesh.near_surfaces import FACING

_LOG = logging.getLogger(__name__)

#: Why every contact with an obstacle is by nodes.
RIGID = "as the master is rigid"
#: Why a choice stays that other meshes do not change.
REMESHED = "as on the meshes before the last one"

Pair = TypeVar("Pair", bound=ContactPair | AnyTie)
AnyScene = TypeVar("AnyScene", bound="SceneParts")

_Choices: TypeAlias = dict[tuple[str, str], tuple[Discretisation, str]]

_KNOWN: WeakKeyDictionary[BodyMesh, WeakKeyDictionary[BodyMesh, _Choices]] = WeakKeyDictionary()
"""Discretisations of surfaces of two meshes, shared with reshaped meshes."""


def with_discretisation(scene: SceneParts, pairs: Sequence[Pair]) -> tuple[Pair, ...]:
    """Return pairs with the discretisation that they were given, or with the better one of the scene.

    It is that of the undeformed meshes before any design moved them, the same for all loads.
    """
    return tuple(_with_choice(scene, pair) for pair in pairs)


def keeping_discretisation(scene: AnyScene) -> AnyScene:
    """Return the scene with choices that stay when its bodies get other meshes."""
    return replace(scene, contacts=[*map(_kept, scene.contacts)], ties=[*map(_kept, scene.ties)])


def in_words(pair: ContactPair | AnyTie) -> str:
    """Return the discretisation of a pair and, where the scene chose it, why."""
    return pair.explained_discretisation if pair.between_bodies else f"node, {RIGID}"


def _with_choice(scene: SceneParts, pair: Pair) -> Pair:
    chosen = pair.discretisation in ("best", pair.choice.found)
    if not chosen or pair.choice.stays:
        return pair
    better = _with_better_slave(scene, pair) if pair.discretisation == "best" else pair
    found, why = _choice(scene, better)
    choice = Choice(found, why, exchanged=better is not pair or pair.choice.exchanged)
    return pair if pair.choice == choice else replace(better, discretisation=found, choice=choice)


def _with_better_slave(scene: SceneParts, pair: Pair) -> Pair:
    """Return a pair, exchanged where its master touches first with a corner, if it may be."""
    if not isinstance(pair, ContactPair) or not pair.between_bodies:
        return pair
    if pair.is_self_contact or pair.depends_on_slave:
        return pair
    better = with_corner_as_slave(scene, pair)
    if better is pair or better.place in [each.place for each in scene.contacts]:
        return pair
    words = "slave and master of %s are exchanged, as a corner or an edge of %s touches first"
    safe_log(_LOG.info, words, pair.place, better.slave.in_words)
    return cast("Pair", better)


def _kept(pair: Pair) -> Pair:
    """Return a pair whose choice does not depend on meshes any more."""
    if pair.choice.found != pair.discretisation:
        return pair
    return replace(pair, choice=replace(pair.choice, why=REMESHED, stays=True))


def _choice(scene: SceneParts, pair: ContactPair | AnyTie) -> tuple[Discretisation, str]:
    """Return the better discretisation of a pair, and why."""
    if not pair.between_bodies:
        return "node", RIGID
    if pair.is_self_contact:
        return "node", "as the body meets itself"
    if pair.single_nodes:
        return "node", f"as the nodes of {pair.single_nodes!r} touch"
    slave, master = (scene.bodies[side.body].mesh.origin for side in pair.surfaces)
    known = _KNOWN.setdefault(slave, WeakKeyDictionary()).setdefault(master, {})
    names = pair.slave.name, pair.master_surface.name
    for sector in pair.sectors:
        match = _sides_match(scene, sector, slave, master)
        return ("node", "as the meshes match") if match else ("mortar", "as the meshes do not match")
    if names not in known:
        known[names] = _chosen_by_meshes(slave, master, names)
    return known[names]


def _chosen_by_meshes(
    slave: BodyMesh, master: BodyMesh, names: tuple[str, str]
) -> tuple[Discretisation, str]:
    sides = _faceted(slave, names[0]), _faceted(master, names[1])
    if slave.order == master.order and surfaces_match(*sides):
        return "node", "as the meshes match"
    if _face(*sides):
        return "mortar", "as the meshes do not match"
    return "node", "as no facets face each other: corners or edges touch"


def _face(slave: FacetedSurface, master: FacetedSurface) -> bool:
    """Return whether any two facets face each other, wherever they are."""
    own, other = (vector_areas(side.points, side.facets) for side in (slave, master))
    own, other = (each / np.linalg.norm(each, axis=1)[:, None] for each in (own, other))
    apart, _ = cKDTree(other).query(-own)
    return bool(apart.min() < np.sqrt(2.0 * (1.0 - FACING)))


def _sides_match(scene: SceneParts, sector: CyclicSymmetry, slave: BodyMesh, master: BodyMesh) -> bool:
    """Return whether the meshes of both sides of a sector do."""
    turned = sector.turned(master.points, sector.angle_in(scene))
    facets = slave.linear.surfaces[sector.slave.name], master.linear.surfaces[sector.master.name]
    return surfaces_match(faceted_surface(slave.points, facets[0]), faceted_surface(turned, facets[1]))


def _faceted(mesh: BodyMesh, surface: str) -> FacetedSurface:
    return faceted_surface(mesh.points, mesh.linear.surfaces[surface])
