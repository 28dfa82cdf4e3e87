"""A bent bar of distorted cells of 20 nodes."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, Scene, State, Support, Traction, solve_scene
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import bisection_partition, quadratic, serendipity
from fenics_contact.mesh.body_mesh import BodyMesh


def distorted(mesh: BodyMesh) -> BodyMesh:
    """Move all nodes between the ends of a bar from 0 to 4 by a few hundredths, without a pattern."""
    points = mesh.points.copy()
    away = 0.05 * np.sin(np.outer(np.arange(len(points)), [12.9898, 78.233, 37.719]))
    inside = (points[:, 0] > 0.01) & (points[:, 0] < 3.99)
    points[inside] += away[inside]
    return mesh.moved(points)


def bent_bar(mesh: BodyMesh, subdomains: int, comm: MPI.Comm = MPI.COMM_SELF) -> State:
    body = Body(mesh, IsotropicElasticity(1000.0, 0.3))
    scene = Scene({"bar": body}, [Support("bar", "x0")], [Traction("bar", "x1", (0.0, 0.03, 0.1))])
    partition = {"bar": bisection_partition(mesh, subdomains)}
    return solve_scene(scene, comm, partitions=partition, tolerance=1e-12)


def bent(subdomains: int, comm: MPI.Comm = MPI.COMM_SELF) -> tuple[BodyMesh, State]:
    mesh = distorted(serendipity(quadratic(block((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (3, 1, 2)))))
    return mesh, bent_bar(mesh, subdomains, comm)


def displacement_on(comm: MPI.Comm) -> list[list[float]]:
    """Return the displacement of the bent bar in four subdomains. Collective."""
    displacement: list[list[float]] = bent(4, comm)[1].gather_displacement("bar").tolist()
    return displacement
