"""Consistency checks of materials on one small cell: of all before use, others on demand."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.composition import Composition
from fenics_contact._fem.templates import Templates
from fenics_contact._kinematics.base import Kinematics
from fenics_contact._kinematics.element import Element, plain_element
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.materials.elastic import Material
from fenics_contact.materials.hyperelastic import Hyperelasticity
from fenics_contact.materials.plastic import HistoryMaterial, MaterialResponse

if TYPE_CHECKING:
    from fenics_contact._fem.mechanics import Mechanics, Response

#: A quarter turn about each axis in succession.
_TURN = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


@naming_arguments
def check_history_material(
    material: HistoryMaterial, size: float = 1e-3, duration: float = 1.0, tolerance: float = 1e-5
) -> None:
    """Check a material of your own at random displacement gradients, for two steps in succession.

    Newton's method converges slowly or not at all with a tangent that is not that of the stress, and nothing
    else would show it.

    Args:
        material: The material.
        size: Typical entry of the displacement gradients. Choose it such that about all happens that the
            model describes: some times the yield strain.
        duration: Of each step.
        tolerance: Largest difference between tangent and difference quotients, relative to the largest entry.

    Raises:
        InvalidInputError: If the unloaded material has stress or an unsymmetric tangent, "respond" changes
            its arguments, the answer of a point depends on others, the tangent is not the derivative of the
            stress, a model in large deformations notices rotations of the deformed body, or one in small
            strain notices rotations at all.
        UserCodeError: If "respond" raises.

    Example:
        >>> from fenics_contact.materials import J2Plasticity
        >>> check_history_material(J2Plasticity(2e5, 0.3, 200.0, isotropic_hardening=1e3), size=3e-3)
    """
    _ = material.moduli  # checks the unloaded material
    # Small gradients and large ones: some points stay elastic in a model with a threshold.
    share = np.geomspace(0.03, 1.0, 24)[:, None, None]
    first, second = size * share * np.random.default_rng(1).standard_normal((2, 24, 3, 3))
    history = np.zeros((24, material.history_size))
    for gradient in (first, first + 0.5 * second):
        end = _checked_step(material, gradient, history, duration)
        _check_tangent(material, gradient, history, duration, end, 1e-5 * size, tolerance)
        _check_rotation(material, gradient, history, duration, end)
        history = end.history


def _checked_step(
    material: HistoryMaterial, gradient: np.ndarray, history: np.ndarray, duration: float
) -> MaterialResponse:
    """Answer a step; check that arguments are left alone and points do not depend on each other."""
    name, given = type(material).__name__, (gradient.copy(), history.copy())
    end = material.answer(*given, duration)
    if not (np.array_equal(given[0], gradient) and np.array_equal(given[1], history)):
        raise InvalidInputError(f"respond of {name} must not write into its arguments: work on copies")
    other = material.answer(gradient[::-1], history[::-1], duration)
    pairs = ((end.stress, other.stress), (end.tangent, other.tangent), (end.history, other.history))
    sizes = [np.abs(one).max(initial=0.0) for one, _ in pairs]
    same = (
        np.allclose(a, b[::-1], rtol=1e-9, atol=1e-12 * c) for (a, b), c in zip(pairs, sizes, strict=True)
    )
    if not all(same):
        raise InvalidInputError(
            f"respond of {name} must answer each point alone: take no sums over points, keep no state"
        )
    return end


def _check_tangent(
    material: HistoryMaterial,
    gradient: np.ndarray,
    history: np.ndarray,
    duration: float,
    end: MaterialResponse,
    step: float,
    tolerance: float,
) -> None:
    central, kinked = np.empty_like(end.tangent), np.zeros(len(gradient), dtype=bool)
    size = np.abs(end.tangent).max()
    for k, m in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[k, m] = step
        ahead, behind = (material.answer(gradient + s * change, history, duration).stress for s in (1, -1))
        central[..., k, m] = (ahead - behind) / (2 * step)
        kinked |= np.abs(ahead + behind - 2 * end.stress).max(axis=(1, 2)) > 1e-2 * step * size
    smooth = np.flatnonzero(~kinked)
    error = np.abs(end.tangent - central)[smooth]
    if len(smooth) and error.max() <= tolerance * size:
        return
    if not len(smooth):
        raise InvalidInputError(
            f"the stress of {type(material).__name__} must be continuous, it jumps at every point tried"
        )
    worst = error > 0.99 * error.max()  # the first of equals, whatever the rounding
    point, i, j, k, m = (int(place) for place in np.unravel_index(worst.argmax(), error.shape))
    wrong = np.count_nonzero(error.max(axis=(1, 2, 3, 4)) > tolerance * size)
    here = smooth[point], i, j, k, m
    raise InvalidInputError(
        f"the tangent of {type(material).__name__} must be the derivative of its stress (consistent): "
        f"dP[{i},{j}]/dH[{k},{m}] is {end.tangent[here]:.6g}, not {central[here]:.6g} ({wrong} points)"
    )


def _check_rotation(
    material: HistoryMaterial,
    gradient: np.ndarray,
    history: np.ndarray,
    duration: float,
    end: MaterialResponse,
) -> None:
    name = type(material).__name__
    if material.finite:
        turned = _TURN @ (np.eye(3) + gradient) - np.eye(3)
        expected, needed = _TURN @ end.stress, "turn with the deformed body, P(Q F) = Q P(F)"
        remedy = "build it from C = FᵀF and rotated back tensors, or set finite = False for small strain"
    else:
        spin = np.abs(gradient).max() * (_TURN - _TURN.T)
        turned, expected = gradient + spin, end.stress
        needed = "depend on the symmetric part of the gradient alone"
        remedy = "use it, or set finite = True for large deformations"
    found = material.answer(turned, history, duration).stress
    error, size = np.abs(found - expected).max(), np.abs(end.stress).max()
    if not error <= 1e-6 * size:
        raise InvalidInputError(
            f"the stress of {name} must {needed}, it misses that by {error / size:.1e}: {remedy}"
        )


#: Below this, relative to the largest, an eigenvalue or an entry counts as rounding.
ROUNDING = 1e-11

#: Binds the stiffness of the material to a space.
Bind = Callable[["_dolfinx.fem.FunctionSpace"], "_dolfinx.fem.Form"]


def unit_cell_stiffness(element: Element, bind: Bind) -> np.ndarray:
    """Return the stiffness matrix of a cell of edge length one, dense, block by block."""
    return stiffness_of_cell(_unit_cell(element), element, bind)[0]


def _unit_cell(element: Element) -> np.ndarray:
    """Return the nodes of a cell of edge length one."""
    return element.kinematics.unit_cell(element.cell.nodes)


def check_model(material: Material, element: Element, bind: Bind) -> None:
    """Check stiffness and kernel of a material on one skew cell.

    A kernel with a missing mode makes the generalised inverse blow up, one with an extra mode removes real
    stiffness; both could be taken for a solution.
    """
    name = type(material).__name__
    K, points = stiffness_of_cell(skewed(_unit_cell(element)), element, bind)
    if not np.isfinite(K).all():
        raise InvalidInputError(f"the stiffness of {name} must be finite, got NaN: check its parameters")
    size = np.abs(K).max()
    if size == 0.0:
        raise InvalidInputError(f"the stiffness of {name} must not be zero: check parameters and tangent")
    unsymmetric = np.abs(K - K.T).max()
    if unsymmetric > ROUNDING * size:
        raise InvalidInputError(
            f"the stiffness of {name} must be symmetric, is not by {unsymmetric / size:.1e}: use an energy"
        )
    energies = np.linalg.eigvalsh(0.5 * (K + K.T))
    if energies[0] < -ROUNDING * energies[-1]:
        raise InvalidInputError(
            f"the energy of {name} must not be negative, got eigenvalue {energies[0]:.3g}: check signs"
        )
    R = _checked_kernel(material, points, element)
    check_kernel(K, R, f"material {name}")
    claimed, counted = R.shape[1], int((energies < ROUNDING * energies[-1]).sum())
    # A cell of reduced integration has modes without energy of its own, whatever it is made of.
    if counted > claimed and not element.integration.has_hourglasses:
        raise InvalidInputError(
            f"the kernel of {name} has {claimed} modes, a {element.name} {counted}: complete kernel(points)"
        )


def check_kernel(
    stiffness: np.ndarray | sp.csr_matrix, kernel: np.ndarray, what: str, kernel_tolerance: float = 1e-8
) -> None:
    """Check that a stiffness matrix annihilates its kernel.

    All modes are tested at once, each with a weight of its own.
    """
    weights = 1 / (1 + np.sqrt(np.arange(2, 2 + kernel.shape[1])))
    energy = np.abs(stiffness @ (kernel @ weights)).max(initial=0.0)
    # In a positive semidefinite matrix no entry exceeds the largest on the diagonal.
    scale = stiffness.diagonal().max() * np.abs(kernel).max(initial=0.0)
    if not energy <= kernel_tolerance * scale:
        raise InvalidInputError(
            f"the kernel of {what} must hold motions without energy, ‖K R‖ is {energy / scale:.1e} of ‖K‖ "
            "‖R‖: return modes that the stiffness annihilates"
        )


def kernel_of(material: Material, points: np.ndarray, kinematics: Kinematics) -> np.ndarray:
    """Return the modes without energy of a material at points, shape (n, components, n_modes)."""
    return kinematics.kernel(partial(_own_kernel, material), points)


def _own_kernel(material: Material, points: np.ndarray) -> np.ndarray:
    """Return the modes without energy in the space of a material, (n, dim, n_modes)."""
    name = type(material).__name__
    with user_code(f"the kernel of material {name}"):
        modes = np.asarray(material.kernel(points), dtype=np.float64)
    if modes.ndim != 3 or modes.shape[:2] != points.shape or not np.isfinite(modes).all():
        raise InvalidInputError(
            f"kernel(points) of {name} must return finite modes {points.shape} + (n_modes,), got "
            f"{modes.shape}"
        )
    return modes


def _checked_kernel(material: Material, points: np.ndarray, element: Element) -> np.ndarray:
    name, R = type(material).__name__, kernel_of(material, points, element.kinematics)
    R = R.reshape(R.shape[0] * R.shape[1], R.shape[2])
    if np.linalg.matrix_rank(R, tol=1e-8 * max(np.abs(R).max(initial=0.0), 1e-300)) < R.shape[1]:
        raise InvalidInputError(f"modes of {name} must be independent: leave out those that others make up")
    return R


def skewed(nodes: np.ndarray) -> np.ndarray:
    """Return a cell without any symmetry; the same for every material."""
    n, dim = nodes.shape
    shift = np.sin(1.0 + 2.3 * np.arange(n * dim)).reshape(n, dim)
    return np.asarray(nodes + 0.08 * shift, dtype=np.float64)


def stiffness_of_cell(vertices: np.ndarray, element: Element, bind: Bind) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness of one cell, dense, and its points, both block by block."""
    mesh = _dolfinx.local_mesh(vertices, np.arange(len(vertices))[None], element.cells)
    space = _dolfinx.coefficient(mesh, "u", element.components).function_space
    nodes, dofs = _dolfinx.node_dofs(space)
    points = np.empty_like(vertices)
    points[dofs] = vertices[nodes]
    indptr, indices, data = _dolfinx.assemble_csr(bind(space))
    size = len(indptr) - 1
    K = np.zeros((size, size))
    K[np.repeat(np.arange(size), np.diff(indptr)), indices] = data
    return K, points


@naming_arguments
def check_hyperelastic(
    material: Hyperelasticity,
    cell_type: str | None = None,
    templates: Templates | None = None,
    tolerance: float = 1e-6,
) -> None:
    """Check energy, stress and tangent of a hyperelastic model on one skew cell.

    Every model is checked so before a scene is solved: Newton's method would fail, and not say why.

    Args:
        material: The model.
        cell_type: Type of the cell; by default a hexahedron, a quadrilateral for plane models.
        templates: Where the compiled forms are kept.
        tolerance: Largest difference to difference quotients, relative to the largest entry.

    Raises:
        InvalidInputError: If energy, force or tangent are not finite at small strains, the undeformed cell
            has stress, force and tangent are not the derivatives of energy and force, or a rotation changes
            the energy.
        UserCodeError: If the model raises.

    Example:
        >>> from fenics_contact.materials import NeoHooke
        >>> check_hyperelastic(NeoHooke(young_modulus=10.0, poisson_ratio=0.3))
    """
    cell_type = cell_type or ("hexahedron" if 3 in material.dims else "quadrilateral")
    check_deformed(material, plain_element(cell_type), templates or Templates(MPI.COMM_SELF), tolerance)


def check_deformed(
    material: Hyperelasticity, element: Element, templates: Templates, tolerance: float = 1e-6
) -> None:
    """Check a hyperelastic model on one cell, see `check_hyperelastic`."""
    # Scenes of small strains load neither.
    from fenics_contact._fem.deformed_forms import prepare_forms
    from fenics_contact._fem.mechanics import HyperelasticMechanics

    prepare_forms(templates, (material,), element)
    name, vertices = type(material).__name__, skewed(_unit_cell(element))
    mesh = _dolfinx.local_mesh(vertices, np.arange(len(vertices))[None], element.cells)
    space = _dolfinx.coefficient(mesh, "u", element.components).function_space
    nodes, dofs = _dolfinx.node_dofs(space)
    points = np.empty_like(vertices)
    points[dofs] = vertices[nodes]
    cell = HyperelasticMechanics(templates, Composition((material,)), element, space, vertices)
    u = 0.05 * np.sin(1.7 * np.arange(points.size) ** 1.3).reshape(points.shape)
    rest = _finite(cell, np.zeros(points.size), name)
    scale = float(np.abs(rest.stiffness).max() * np.abs(u).max())
    stress = np.abs(rest.force).max() / scale
    if stress > 1e-10:
        raise InvalidInputError(
            f"{name} must have no stress at F = I, forces are {stress:.1e} of those at a strain of 0.05: "
            "subtract the slope of its energy, as − μ ln J in μ/2 (tr FᵀF − 3 − 2 ln J)"
        )
    _check_derivatives(cell, u.ravel(), scale, name, tolerance)
    if element.kinematics.can_rotate:
        _check_rotated_energy(cell, points, u, scale, name)


def _finite(cell: Mechanics, u: np.ndarray, name: str) -> Response:
    found = cell.at(u)
    if not all(np.isfinite(part).all() for part in (_energy(found), found.force, found.stiffness.data)):
        raise InvalidInputError(
            f"energy, stress and tangent of {name} must be finite at F = I and near it: check its logarithms"
        )
    return found


def _energy(response: Response) -> float:
    return float(np.asarray(response.energy, dtype=np.float64))


def _check_derivatives(cell: Mechanics, u: np.ndarray, scale: float, name: str, tolerance: float) -> None:
    """Compare force and tangent with difference quotients along one direction."""
    step, direction = 1e-5, np.cos(np.arange(u.size) ** 1.5)
    here, ahead, behind = (_finite(cell, u + sign * step * direction, name) for sign in (0, 1, -1))
    slope = (_energy(ahead) - _energy(behind)) / (2 * step)
    growth = (ahead.force - behind.force) / (2 * step)
    size = np.abs(growth).max()
    wrong = {
        "stress": abs(here.force @ direction - slope) / (scale * u.size),
        "tangent": np.abs(here.stiffness @ direction - growth).max() / size,
        "transposed tangent": np.abs(here.stiffness.T @ direction - growth).max() / size,
    }
    for what, error in wrong.items():
        if not error <= tolerance:
            raise InvalidInputError(
                f"stress and tangent must be derivatives of energy, {what} of {name} is off by {error:.1e}"
            )


def _check_rotated_energy(
    cell: Mechanics, points: np.ndarray, u: np.ndarray, scale: float, name: str
) -> None:
    """Compare the energies of a deformed cell before and after a rotation."""
    turn = np.roll(np.eye(points.shape[1]), 1, axis=0)  # by a third around the diagonal, or a right angle
    turn[0] *= np.sign(np.linalg.det(turn))
    turned = ((points + u) @ turn.T - points).ravel()
    before, after = _energy(cell.at(u.ravel())), _energy(cell.at(turned))
    difference = abs(after - before) / (scale * np.abs(u).max())
    if not difference <= 1e-9:
        raise InvalidInputError(
            f"rotation must not change the energy of {name}, off by {difference:.1e}: use FᵀF and det F"
        )
