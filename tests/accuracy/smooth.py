"""Problems with a smooth solution that is known: prescribed on the whole boundary, loaded in the volume."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from fenics_contact import Body, BodyForce, BodyMesh, Scene, State, Support, Ufl, solve_scene
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.materials.elastic import lame
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.mesh.cell_types import CELL_TYPES
from tests.accuracy.true_error import error_by_cell

YOUNG, POISSON = 1000.0, 0.3
SIZE = 0.01
PLANE = ("triangle", "quadrilateral")


def displaced(x: Any, sin: Any, cos: Any, exp: Any) -> list[Any]:
    """The solution in NumPy or UFL, x by component; of order `SIZE`."""
    if len(x) == 2:
        return [SIZE * sin(2 * x[0] + x[1]) * exp(x[1]), SIZE * cos(x[0] - 3 * x[1])]
    return [
        SIZE * sin(2 * x[0] + x[1]) * exp(x[2]),
        SIZE * cos(x[0] - 3 * x[1]),
        SIZE * sin(x[0] + 2 * x[2]) * cos(x[1]),
    ]


def gradient(points: np.ndarray) -> np.ndarray:
    """∂u_k/∂x_j of the solution, by a central difference of complex step, exact to rounding."""
    dim, step = points.shape[-1], 1e-30
    columns = []
    for j in range(dim):
        shifted = points.astype(complex)
        shifted[..., j] += 1j * step
        values = displaced(np.moveaxis(shifted, -1, 0), np.sin, np.cos, np.exp)
        columns.append(np.stack([value.imag / step for value in values], axis=-1))
    return np.stack(columns, axis=-1)


def body_force(poisson: float) -> Ufl:
    """−div σ of the solution."""
    first, shear = lame(YOUNG, poisson)

    def value(x: Any) -> Any:
        u = ufl.as_vector(displaced(x, ufl.sin, ufl.cos, ufl.exp))
        strain = ufl.sym(ufl.grad(u))
        return -ufl.div(first * ufl.tr(strain) * ufl.Identity(len(u)) + 2 * shear * strain)

    return Ufl(value)


@dataclass(frozen=True)
class Found:
    """Estimate and truth."""

    state: State
    mesh: BodyMesh
    error: np.ndarray

    @property
    def total(self) -> float:
        return float(np.linalg.norm(self.error))


def mesh_of(cell: str, n: int, shake: float = 0.0) -> BodyMesh:
    """A square or a cube of edge length one, inner nodes moved at random by up to ``shake`` cells."""
    if CELL_TYPES[cell].order == 2:
        return quadratic(mesh_of(cell.rstrip("0123456789"), n, shake))
    return _shaken(_linear(cell, n), shake)


def _linear(cell: str, n: int) -> BodyMesh:
    if cell in PLANE:
        return rectangle((0, 0), (1, 1), (n, n), cell)
    return block((0, 0, 0), (1, 1, 1), (n, n, n), cell)


def _shaken(mesh: BodyMesh, size: float) -> BodyMesh:
    points = mesh.points.copy()
    inner = np.all((points > 1e-9) & (points < 1 - 1e-9), axis=1)
    step = 1 / (round(mesh.n_nodes ** (1 / mesh.dim)) - 1)
    noise = np.random.default_rng(1).uniform(-1, 1, points.shape)
    return mesh.moved(points + size * step * np.where(inner[:, None], noise, 0.0))


def solved(mesh: BodyMesh, poisson: float = POISSON, parts: int = 1) -> Found:
    dim = mesh.dim
    material = (PlaneStrain if dim == 2 else IsotropicElasticity)(YOUNG, poisson)

    def component(k: int) -> Any:
        # Rounded: NumPy's functions may differ in the last bit for one point in arrays of different lengths,
        # and supports must agree where they meet.
        return lambda points: np.round(displaced(points.T, np.sin, np.cos, np.exp)[k], 15)

    value = tuple(component(k) for k in range(dim))
    supports = [Support("body", side, value) for side in mesh.surfaces]
    scene = Scene({"body": Body(mesh, material)}, supports, [BodyForce("body", body_force(poisson))])
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions={"body": bisection_partition(mesh, parts)}, tolerance=1e-10
    )
    exact = error_by_cell(mesh, state.gather_displacement("body"), gradient, *lame(YOUNG, poisson))
    return Found(state, mesh, exact)
