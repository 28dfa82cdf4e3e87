"""Consistency checks of hyperelastic models on one cell."""

from __future__ import annotations

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI
from fenics_contact.errors import InvalidInputError
from fenics_contact.fem.composition import Composition
from fenics_contact.fem.mechanics import Mechanics, Response
from fenics_contact.fem.model_checks import skewed
from fenics_contact.fem.templates import Templates
from fenics_contact.mesh import CELL_TYPES
from fenics_contact.scene import Hyperelasticity


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
        >>> from fenics_contact.scene import NeoHooke
        >>> check_hyperelastic(NeoHooke(young_modulus=10.0, poisson_ratio=0.3))
    """
    # Scenes of small strains load neither.
    from fenics_contact.fem.deformed_forms import prepare_forms
    from fenics_contact.fem.hyperelastic import HyperelasticMechanics

    cell_type = cell_type or ("hexahedron" if 3 in material.dims else "quadrilateral")
    templates = Templates(MPI.COMM_SELF) if templates is None else templates
    prepare_forms(templates, (material,), cell_type)
    name, vertices = type(material).__name__, skewed(CELL_TYPES[cell_type].nodes)
    mesh = _dolfinx.local_mesh(vertices, np.arange(len(vertices))[None], cell_type)
    space = _dolfinx.coefficient(mesh, "u").function_space
    nodes, dofs = _dolfinx.node_dofs(space)
    points = np.empty_like(vertices)
    points[dofs] = vertices[nodes]
    cell = HyperelasticMechanics(templates, Composition((material,)), cell_type, space, vertices)
    u = 0.05 * np.sin(1.7 * np.arange(points.size) ** 1.3).reshape(points.shape)
    rest = _finite(cell, np.zeros(points.size), name)
    scale = float(np.abs(rest.stiffness).max() * np.abs(u).max())
    stress = np.abs(rest.force).max() / scale
    if stress > 1e-10:
        raise InvalidInputError(
            "a hyperelastic model must be free of stress at F = I, the forces on an undeformed cell of "
            f"{name} are {stress:.1e} of those at a strain of 0.05: its energy has a slope at F = I; "
            "subtract it, as − μ ln J does in μ/2 (tr FᵀF − 3 − 2 ln J)"
        )
    _check_derivatives(cell, u.ravel(), scale, name, tolerance)
    _check_rotation(cell, points, u, scale, name)


def _finite(cell: Mechanics, u: np.ndarray, name: str) -> Response:
    found = cell.at(u)
    if not all(np.isfinite(part).all() for part in (_energy(found), found.force, found.stiffness.data)):
        raise InvalidInputError(
            "energy, stress and tangent of a hyperelastic model must be finite at F = I and at strains of a "
            f"few per cent, those of {name} are not: check its parameters, logarithms, roots and quotients"
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
                "stress and tangent of a hyperelastic model must be the derivatives of its energy, the "
                f"{what} of {name} differs from the difference quotient by {error:.1e}: write the energy "
                "alone, both follow"
            )


def _check_rotation(cell: Mechanics, points: np.ndarray, u: np.ndarray, scale: float, name: str) -> None:
    """Compare the energies of a deformed cell before and after a rotation."""
    turn = np.roll(np.eye(points.shape[1]), 1, axis=0)  # by a third around the diagonal, or a right angle
    turn[0] *= np.sign(np.linalg.det(turn))
    turned = ((points + u) @ turn.T - points).ravel()
    before, after = _energy(cell.at(u.ravel())), _energy(cell.at(turned))
    difference = abs(after - before) / (scale * np.abs(u).max())
    if not difference <= 1e-9:
        raise InvalidInputError(
            "a rotation of the deformed body must not change the energy of a hyperelastic model, that of "
            f"{name} changes by {difference:.1e} of its size: write it in terms of FᵀF, its invariants and "
            "det F"
        )
