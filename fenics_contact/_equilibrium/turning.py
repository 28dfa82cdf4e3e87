"""By how much the cells of bodies turn and strain: gradients of their corners' displacements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact.results.state import State


@dataclass(frozen=True)
class Turning:
    """By how much the cells of a body turn and strain, as root mean squares.

    Attributes:
        rotation: In radians.
        strain: Components around an axis left out.
        bound: No displacements of length one turn or strain any cell by more, [1 / length].
    """

    rotation: float
    strain: float
    bound: float

    @classmethod
    def of(cls, state: State, body: str) -> Turning:
        """Return those of a body in a state. Collective."""
        sums, bound, comm = np.zeros(3), 0.0, state.torn.decomposition.comm
        for points, displacement, corners in _subdomains(state, body):
            parts, largest = gradient_squares(points, displacement, corners)
            sums, bound = sums + parts, max(bound, largest)
        rotation, strain, size = comm.allreduce(sums)
        bound = comm.allreduce(bound, op=MPI.MAX)
        return cls(float(np.sqrt(rotation / size)), float(np.sqrt(strain / size)), bound)


def _subdomains(state: State, body: str) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return of each of this rank's subdomains of a body its nodes, their displacements, and linear cells."""
    decomposition, mesh = state.torn.decomposition, state.scene.bodies[body].mesh
    cells, parents = mesh.linear.cells, mesh.cells_cut
    place, held = np.zeros(mesh.n_nodes, dtype=np.int64), np.zeros(len(mesh.cells), dtype=bool)
    for own, part in zip(decomposition.meshes, decomposition.parts, strict=True):
        if own.body == body:
            place[own.nodes], held[own.cells] = np.arange(len(own.nodes)), True
            corners = place[cells[held[parents]]]
            held[own.cells] = False
            yield mesh.points[own.nodes], state.torn_displacement[part].reshape(len(own.nodes), -1), corners


def gradient_squares(
    points: np.ndarray, displacement: np.ndarray, corners: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the sums of squares of rotations and strains of cells, weighted by size, and that of sizes.

    And a bound on the rotation and strain of any cell by displacements of length one, [1 / length]. With arms
    a_k from the middle of a cell to its corners, gradients are A⁻¹ Σ a_k u_kᵀ, A = Σ a_k a_kᵀ, by least
    squares: no larger than √K max|u| / √λ_min(A) with K corners.

    `points`: shape (n, dim), [length]; `displacement`: shape (n, dim), or (n, 3) with one around an axis,
    [length]; `corners`: nodes of the cells, shape (n_cells, K).
    """
    dim, count = points.shape[1], corners.shape[1]
    every = np.concatenate([points, displacement], axis=1).take(corners, axis=0)
    means = np.full((1, count), 1.0 / count) @ every
    every -= means
    # Cells last: what follows are few products of long arrays.
    sums = np.ascontiguousarray((every[..., :dim].transpose(0, 2, 1) @ every).transpose(1, 2, 0))
    metric, rates = sums[:, :dim], sums[:, dim:]
    adjugate, determinant = _inverted(metric)
    gradient = np.einsum("den,efn->dfn", adjugate, rates) / determinant
    bound = np.sqrt(count * np.sqrt(np.einsum("den,den->n", adjugate, adjugate)) / determinant)
    if displacement.shape[1] > dim:  # around the axis
        radius = np.ascontiguousarray(means[:, 0, 0])
        turn = means[:, 0, dim:].T / radius
        around = np.stack([-turn[2], np.zeros(len(radius)), turn[0]])
        gradient, bound = np.concatenate([gradient, around[None]]), bound + 1.0 / np.abs(radius)
    size, turned = np.sqrt(determinant), gradient.transpose(1, 0, 2)
    twice = gradient - turned, gradient + turned
    rotation, strain = (np.einsum("den,den->n", each, each) @ size for each in twice)
    return np.array([rotation / 8.0, strain / 4.0, size.sum()]), float(bound.max(initial=0.0))


def _inverted(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return adjugates of 2 x 2 or 3 x 3 matrices, (dim, dim, n), and their determinants, (n,)."""
    if len(matrices) == 2:
        (a, b), (c, d) = matrices
        return np.array([[d, -b], [-c, a]]), a * d - b * c
    first, second, third = matrices
    columns = [_cross(second, third), _cross(third, first), _cross(first, second)]
    adjugates = np.stack(columns, axis=1)
    return adjugates, np.einsum("dn,dn->n", first, columns[0])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
