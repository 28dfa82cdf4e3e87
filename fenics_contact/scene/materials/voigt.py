"""Symmetric tensors as vectors (Voigt), their rotation, and stiffness matrices from engineering constants."""

from __future__ import annotations

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact.errors import InvalidInputError

#: Index pairs in Voigt order: xx, yy, zz, yz, xz, xy; in the plane xx, yy, xy.
PAIRS = {3: ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)), 2: ((0, 0), (1, 1), (0, 1))}


def to_vector(tensor: np.ndarray) -> np.ndarray:
    """Return the entries of symmetric tensors in Voigt order, without factors.

    Args:
        tensor: Shape (..., 3, 3).

    Returns:
        Shape (..., 6).
    """
    rows, columns = np.transpose(PAIRS[3])
    return np.asarray(tensor[..., rows, columns])


def to_tensor(vector: np.ndarray) -> np.ndarray:
    """Return the symmetric tensors with the given entries, (..., 6) to (..., 3, 3); undoes `to_vector`."""
    return np.asarray(vector[..., [[0, 5, 4], [5, 1, 3], [4, 3, 2]]])


def strain_vector(strain: Expr, dim: int) -> list[Expr]:
    """Return the entries of a strain tensor (UFL) with engineering shears, γ = 2 ε."""
    return [(1 if i == j else 2) * strain[i, j] for i, j in PAIRS[dim]]


def as_tensor(vector: list[Expr], dim: int) -> Expr:
    """Return the stress tensor (UFL) with the given Voigt entries."""
    place = {pair: k for k, pair in enumerate(PAIRS[dim])}
    return ufl.as_tensor([[vector[place[min(i, j), max(i, j)]] for j in range(dim)] for i in range(dim)])


def upper_triangle(matrix: np.ndarray) -> tuple[float, ...]:
    """Return the entries on and above the diagonal, row by row."""
    return tuple(float(value) for value in matrix[np.triu_indices(len(matrix))])


def symmetric_product(entries: tuple[ufl.Constant, ...], vector: list[Expr]) -> list[Expr]:
    """Return the product of a symmetric matrix, given by its upper triangle, with a vector (UFL)."""
    n = len(vector)
    place = {(i, j): k for k, (i, j) in enumerate(zip(*np.triu_indices(n), strict=True))}
    return [sum(entries[place[min(i, j), max(i, j)]] * vector[j] for j in range(n)) for i in range(n)]


def rotated_stiffness(C: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Rotate a stiffness matrix from material axes to those of the scene.

    Args:
        C: Stiffness in material axes, Voigt, shape (6, 6) or (3, 3).
        axes: Material axes as rows, orthonormal, shape (dim, dim).
    """
    T = strain_rotation(axes)
    return np.asarray(T.T @ C @ T)


def strain_rotation(axes: np.ndarray) -> np.ndarray:
    """Return the matrix that rotates a strain vector from the scene's axes to material axes."""
    dim = len(axes)
    T = np.empty((len(PAIRS[dim]),) * 2)
    for column, (i, j) in enumerate(PAIRS[dim]):
        unit = np.zeros((dim, dim))
        unit[i, j] += 0.5
        unit[j, i] += 0.5  # engineering shear 1
        turned = axes @ unit @ axes.T
        T[:, column] = [(1 if a == b else 2) * turned[a, b] for a, b in PAIRS[dim]]
    return T


def thermal_stresses(
    C: np.ndarray, axes: np.ndarray, expansion: tuple[float, ...] | None
) -> tuple[float, ...]:
    """Return C : α in Voigt order, nothing without an expansion.

    Args:
        C: Stiffness in the scene's axes, Voigt.
        axes: Material axes as rows, shape (dim, dim).
        expansion: α along them.
    """
    if expansion is None:
        return ()
    along = np.zeros(len(C))
    along[: len(axes)] = expansion
    return tuple(float(value) for value in C @ np.linalg.solve(strain_rotation(axes), along))


def checked_stiffness(compliance: np.ndarray, constants: str) -> np.ndarray:
    """Invert a compliance matrix, shape (n, n).

    Raises:
        InvalidInputError: If it is not positive definite; ``constants`` names what it was built from.
    """
    scale = np.sqrt(np.abs(np.diag(compliance)))
    smallest = np.linalg.eigvalsh(compliance / np.outer(scale, scale)).min()
    if not smallest > 1e-12:
        raise InvalidInputError(
            f"engineering constants must give a positive energy, {constants} do not (smallest eigenvalue of "
            f"the scaled compliance {smallest:.3g}): reduce the Poisson ratios, ν_ij² < E_i / E_j for each "
            "pair is necessary"
        )
    return np.asarray(np.linalg.inv(compliance), dtype=np.float64)
