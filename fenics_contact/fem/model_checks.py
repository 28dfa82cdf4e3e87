"""Consistency checks of a material on one small cell, before it is used."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact.errors import InvalidInputError, user_code
from fenics_contact.mesh import CELL_TYPES
from fenics_contact.scene import Material

#: Below this, relative to the largest, an eigenvalue or an entry counts as rounding.
ROUNDING = 1e-11
#: Largest ‖K R‖ relative to ‖K‖ ‖R‖.
KERNEL_TOLERANCE = 1e-8

#: Binds the stiffness of the material to a space.
Bind = Callable[["_dolfinx.fem.FunctionSpace"], "_dolfinx.fem.Form"]


def unit_cell_stiffness(cell_type: str, bind: Bind) -> np.ndarray:
    """Return the stiffness matrix of a cell of edge length one, dense, block by block."""
    return stiffness_of_cell(CELL_TYPES[cell_type].nodes, cell_type, bind)[0]


def check_model(material: Material, cell_type: str, bind: Bind) -> None:
    """Check stiffness and kernel of a material on one skew cell.

    A kernel with a missing mode makes the generalised inverse blow up, one with an extra mode removes real
    stiffness; both could be taken for a solution.

    Args:
        material: The material.
        cell_type: Type of the cell.
        bind: Binds its stiffness form.

    Raises:
        InvalidInputError: If the stiffness is zero, not finite, not symmetric or has a negative energy, the
            kernel has the wrong shape, dependent modes or modes with energy, or a mode without energy is
            missing.
    """
    name = type(material).__name__
    K, points = stiffness_of_cell(skewed(CELL_TYPES[cell_type].nodes), cell_type, bind)
    if not np.isfinite(K).all():
        raise InvalidInputError(
            f"stiffness and load must be finite, got NaN or infinity in the stiffness of {name}: check the "
            "material parameters"
        )
    size = np.abs(K).max()
    if size == 0.0:
        raise InvalidInputError(
            f"a material must resist strain, the stiffness of {name} is zero: check parameters and tangent"
        )
    unsymmetric = np.abs(K - K.T).max()
    if unsymmetric > ROUNDING * size:
        raise InvalidInputError(
            f"the stiffness of a material must be symmetric, that of {name} is not (by "
            f"{unsymmetric / size:.1e} of its largest entry): the stress must follow from an energy"
        )
    energies = np.linalg.eigvalsh(0.5 * (K + K.T))
    if energies[0] < -ROUNDING * energies[-1]:
        raise InvalidInputError(
            f"the energy of a material must not be negative, {name} has the eigenvalue {energies[0]:.3g} "
            f"beside {energies[-1]:.3g}: check signs and parameters"
        )
    R = _checked_kernel(material, points)
    check_kernel(K, R, f"material {name}")
    claimed, counted = R.shape[1], int((energies < ROUNDING * energies[-1]).sum())
    if counted > claimed:
        raise InvalidInputError(
            f"the kernel of a material must hold every motion without energy, that of {name} has {claimed} "
            f"modes and a {cell_type} has {counted} of them: add the missing ones to kernel(points)"
        )


def check_kernel(stiffness: np.ndarray | sp.csr_matrix, kernel: np.ndarray, what: str) -> None:
    """Check that a stiffness matrix annihilates its kernel.

    All modes are tested at once, each with a weight of its own.

    Args:
        stiffness: K, dense or sparse, shape (n, n).
        kernel: R, shape (n, n_modes).
        what: Name of their owner, for the message.

    Raises:
        InvalidInputError: If ‖K R‖ is not small compared with ‖K‖ ‖R‖.
    """
    weights = 1 / (1 + np.sqrt(np.arange(2, 2 + kernel.shape[1])))
    energy = np.abs(stiffness @ (kernel @ weights)).max(initial=0.0)
    # In a positive semidefinite matrix no entry exceeds the largest on the diagonal.
    scale = stiffness.diagonal().max() * np.abs(kernel).max(initial=0.0)
    if not energy <= KERNEL_TOLERANCE * scale:
        raise InvalidInputError(
            f"the kernel must hold motions without energy alone, that of {what} does not (‖K R‖ is "
            f"{energy / scale:.1e} of ‖K‖ ‖R‖): kernel(points) must return modes that the "
            "stiffness annihilates"
        )


def kernel_of(material: Material, points: np.ndarray) -> np.ndarray:
    """Return the modes without energy of a material at points, shape (n, dim, n_modes).

    Raises:
        InvalidInputError: If the material returns other values.
        UserCodeError: If it raises.
    """
    name = type(material).__name__
    with user_code(f"the kernel of material {name}"):
        modes = np.asarray(material.kernel(points), dtype=np.float64)
    if modes.ndim != 3 or modes.shape[:2] != points.shape or not np.isfinite(modes).all():
        raise InvalidInputError(
            f"kernel(points) of {name} must return finite modes of shape {points.shape} + (n_modes,), got "
            f"{'NaN or infinity' if modes.shape[:2] == points.shape else f'shape {modes.shape}'}: one "
            "displacement a point and mode"
        )
    return modes


def _checked_kernel(material: Material, points: np.ndarray) -> np.ndarray:
    name, R = type(material).__name__, kernel_of(material, points).reshape(points.size, -1)
    if np.linalg.matrix_rank(R, tol=1e-8 * max(np.abs(R).max(initial=0.0), 1e-300)) < R.shape[1]:
        raise InvalidInputError(
            f"the modes in the kernel of {name} must be independent, the {R.shape[1]} given are not: leave "
            "out those that others make up"
        )
    return R


def skewed(nodes: np.ndarray) -> np.ndarray:
    """Return a cell without any symmetry; the same for every material."""
    n, dim = nodes.shape
    shift = np.sin(1.0 + 2.3 * np.arange(n * dim)).reshape(n, dim)
    return np.asarray(nodes + 0.08 * shift, dtype=np.float64)


def stiffness_of_cell(vertices: np.ndarray, cell_type: str, bind: Bind) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness of one cell, dense, and its points, both block by block.

    Args:
        vertices: Coordinates in VTK order, shape (n, dim), [length].
        cell_type: Type of the cell.
        bind: Binds the stiffness form of a material.
    """
    mesh = _dolfinx.local_mesh(vertices, np.arange(len(vertices))[None], cell_type)
    space = _dolfinx.coefficient(mesh, "u").function_space
    nodes, dofs = _dolfinx.node_dofs(space)
    points = np.empty_like(vertices)
    points[dofs] = vertices[nodes]
    indptr, indices, data = _dolfinx.assemble_csr(bind(space))
    K = np.zeros((vertices.size, vertices.size))
    K[np.repeat(np.arange(vertices.size), np.diff(indptr)), indices] = data
    return K, points
