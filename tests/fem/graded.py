"""Bars with cells of different sizes, and cuts of them."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, Traction, solve_scene
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import refined
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.partition import merge_pieces


def graded(dim: int) -> BodyMesh:
    """Return a bar with cells of three sizes."""
    if dim == 2:
        mesh = rectangle((0.0, 0.0), (2.0, 1.0), (5, 3))
    else:
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (3, 3, 2))
    for reach in (0.9, 0.4):
        centres = mesh.points[mesh.cells].mean(axis=1)
        mesh = refined(mesh, np.linalg.norm(centres - [2.0, 0.9, 0.9][:dim], axis=1) < reach).mesh
    return mesh


def pulled(mesh: BodyMesh, material: object, tension: float = 1.0) -> Scene:
    held = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "z0": (None, None, 0.0)}
    supports = [
        Support("bar", side, value[: mesh.dim]) for side, value in held.items() if side in mesh.surfaces
    ]
    load = Traction("bar", "x1", (tension, 0.0, 0.0)[: mesh.dim])
    return Scene({"bar": Body(mesh, material)}, supports, [load])


def striped(mesh: BodyMesh) -> np.ndarray:
    """Return slanted slices, which separate parts of one cell from each other."""
    slices = (mesh.points[mesh.cells].mean(axis=1) @ [2.0, 1.0, 1.5][: mesh.dim]).astype(int)
    return merge_pieces(mesh, np.unique(slices, return_inverse=True)[1].ravel())


def displacement_on(comm: MPI.Comm) -> list[float]:
    """Return the end's displacement of a clamped bar in striped subdomains. Collective."""
    mesh = graded(3)
    body = Body(mesh, IsotropicElasticity(100.0, 0.3))
    scene = Scene({"bar": body}, [Support("bar", "x0")], [Traction("bar", "x1", (0.3, 0.2, 1.0))])
    state = solve_scene(scene, comm, partitions={"bar": striped(mesh)}, tolerance=1e-11)
    return [float(x) for x in state.gather_displacement("bar")[np.unique(mesh.surfaces["x1"])].ravel()]
