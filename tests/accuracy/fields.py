"""Displacements that are given instead of solved for, on torn systems of one rank or several."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, Scene, Support
from fenics_contact._accuracy.discretisation import discretisation_error
from fenics_contact._accuracy.recovery import Sites, find_sites, recovered_gradients
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.feti.averages import nodal_mean
from fenics_contact.materials import IsotropicElasticity, Material, PlaneStrain
from fenics_contact.mesh import bisection_partition
from fenics_contact.results import DiscretisationError

#: Displacement of points, (n, dim) -> (n, dim).
Field = Callable[[np.ndarray], np.ndarray]


def steel(dim: int) -> Material:
    return (PlaneStrain if dim == 2 else IsotropicElasticity)(1000.0, 0.3)


def scene_of(mesh: BodyMesh, material: Material | Mapping[str, Material] | None = None) -> Scene:
    """One body, held at its first surface."""
    body = Body(mesh, steel(mesh.dim) if material is None else material)
    return Scene({"body": body}, [Support("body", next(iter(mesh.surfaces)), (0.0,) * mesh.dim)])


def torn_up(scene: Scene, parts: int = 1) -> TornSystem:
    cuts = {name: bisection_partition(body.mesh, parts) for name, body in scene.bodies.items()}
    return build_torn_system(scene, decompose(scene, cuts, MPI.COMM_SELF))


def torn_field(torn: TornSystem, field: Field) -> np.ndarray:
    """The field on the copies of all nodes."""
    parts = [field(subdomain.points).ravel() for subdomain in torn.subdomains]
    return np.concatenate(parts)


def estimated(scene: Scene, field: Field, parts: int = 1) -> DiscretisationError:
    torn = torn_up(scene, parts)
    return discretisation_error(torn, torn_field(torn, field))


def recovered(scene: Scene, field: Field, parts: int = 1) -> tuple[Sites, np.ndarray]:
    """Sites and recovered gradients of a field that is taken at the nodes."""
    torn = torn_up(scene, parts)
    sites = find_sites(torn, next(iter(scene.bodies.values())).mesh.order)
    nodal = nodal_mean(torn.decomposition, torn_field(torn, field))
    return sites, recovered_gradients(sites, nodal[sites.node])


def norm(torn: TornSystem, displacement: np.ndarray) -> float:
    """√(uᵀK u)."""
    parts = np.split(displacement, torn.components * torn.decomposition.block_offset[1:-1])
    return float(np.sqrt(sum(u @ (s.stiffness @ u) for s, u in zip(torn.subdomains, parts, strict=True))))


def linear(dim: int) -> tuple[Field, np.ndarray]:
    """A linear displacement of order 0.01 with strain and rotation, and its gradient."""
    slope = 0.01 * np.cos(np.arange(dim * dim)).reshape(dim, dim)
    return (lambda points: points @ slope.T + 0.3), slope


def cubic(dim: int) -> tuple[Field, Callable[[np.ndarray], np.ndarray]]:
    """A cubic displacement and its gradient at points, (n, dim, dim)."""
    add, slope = quadratic(dim)
    along = np.cos(2.0 + np.arange(2 * dim)).reshape(2, dim)

    def field(points: np.ndarray) -> np.ndarray:
        return add(points) + 0.01 * (points @ along[0])[:, None] ** 3 * along[1]

    def gradient(points: np.ndarray) -> np.ndarray:
        bend = 0.03 * (points @ along[0])[:, None, None] ** 2 * along[1][:, None] * along[0]
        return np.asarray(slope(points) + bend)

    return field, gradient


def quadratic(dim: int) -> tuple[Field, Callable[[np.ndarray], np.ndarray]]:
    """A quadratic displacement and its gradient at points, (n, dim, dim)."""
    bend = 0.01 * np.sin(1.0 + np.arange(dim**3)).reshape(dim, dim, dim)
    bend = bend + bend.transpose(0, 2, 1)
    add, slope = linear(dim)

    def field(points: np.ndarray) -> np.ndarray:
        return add(points) + 0.5 * np.einsum("kij,ni,nj->nk", bend, points, points)

    return field, lambda points: slope + np.einsum("kij,ni->nkj", bend, points)
