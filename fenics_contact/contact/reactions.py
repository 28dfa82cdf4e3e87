"""The reactions of supports: what holds each of them, as force and moment."""

from __future__ import annotations

import numpy as np

from fenics_contact.checks import GivenVector
from fenics_contact.contact.nodal_forces import NodalForces
from fenics_contact.contact.resultant import Resultant, Resultants, point_of, resultant
from fenics_contact.pairing import NodeNumbers
from fenics_contact.scene import RigidSurface, Scene, Surface
from fenics_contact.surfaces import share_areas, surface_moments


def support_reactions(
    scene: Scene, forces: NodalForces, about: GivenVector | np.ndarray | None
) -> Resultants:
    """Return the reaction of every support, about a point or the centroid of its surface.

    That of a rigid surface is less the load at its point, to which it refers by default.
    """
    shares = support_shares(scene, NodeNumbers.of(scene))
    entries = []
    for support, share in zip(scene.supports, shares, strict=True):
        surface = Surface(support.body, support.surface)
        own = np.array(support.at) if isinstance(support, RigidSurface) else centroid(scene, surface)
        point = own if about is None else point_of(about, scene.dim)
        total = resultant(share * forces.reaction, forces.places, point, surface)
        entries.append(total - point_load(support, point) if isinstance(support, RigidSurface) else total)
    return Resultants("reaction", tuple(entries))


def point_load(support: RigidSurface, about: np.ndarray) -> Resultant:
    """Return the load at the point of a rigid surface, about a point."""
    force, moment = np.split(support.load, [support.dim])
    load = Resultant(force, float(moment[0]) if support.dim == 2 else moment, np.array(support.at))
    return Resultant(force, load.moment_about(about), about)


def support_shares(scene: Scene, numbers: NodeNumbers) -> list[np.ndarray]:
    """Return the part of each support in the reaction on every component of a node.

    A component that several supports prescribe at a node is shared by the areas that belong to the node on
    their surfaces: the forces of an even pressure on both. The parts sum to one.

    Returns:
        For each support the parts, shape (n_nodes, dim), zero where it holds nothing.
    """
    areas = []
    for support in scene.supports:
        mesh = scene.bodies[support.body].mesh
        own = share_areas(mesh, support.surface)
        area = np.zeros((numbers.n_nodes, scene.dim))
        given = (0.0,) * scene.dim if isinstance(support, RigidSurface) else support.value
        held = [component is not None for component in given]
        area[numbers.global_nodes(support.body, np.arange(mesh.n_nodes))] = own[:, None] * held
        areas.append(area)
    total = sum(areas, np.zeros((numbers.n_nodes, scene.dim)))
    return [area / np.where(total > 0.0, total, 1.0) for area in areas]


def centroid(scene: Scene, surface: Surface) -> np.ndarray:
    """Return the centroid of a surface, shape (dim,)."""
    mesh = scene.bodies[surface.body].mesh
    return surface_moments(mesh.points, mesh.surfaces[surface.name]).centroid
