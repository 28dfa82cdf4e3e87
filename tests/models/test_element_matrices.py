"""Stiffness of every material on one skew cell against an independent computation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenics_contact.materials import (
    IsotropicElasticity,
    Material,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    material_axes,
)
from tests.models.elements import (
    CELLS,
    PLANE,
    SPACE,
    by_node,
    element_stiffness,
    isotropic_matrix,
    one_cell,
    skewed_cell,
)
from tests.models.materials import LAME, POISSON, YOUNG, EnergyByEntries, FromEnergy, FromStress

WOOD = ((11.0, 0.9, 0.5), (0.37, 0.42, 0.6), (0.7, 0.6, 0.05))


def difference(material: Material, cell: str, C: np.ndarray) -> float:
    """Largest difference to the element matrix of C, relative to its largest entry."""
    vertices = skewed_cell(cell)
    expected = element_stiffness(vertices, cell, C)
    assert np.abs(expected).max() > 0.01
    return float(
        np.abs(by_node(one_cell(material, cell, vertices)) - expected).max() / np.abs(expected).max()
    )


def plane_stress_matrix(young: float, poisson: float) -> np.ndarray:
    C = np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    return young / (1 - poisson**2) * C


def compliance_of_wood() -> np.ndarray:
    (E1, E2, E3), (n12, n13, n23), (G12, G13, G23) = WOOD
    S = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / G23, 1 / G13, 1 / G12])
    S[0, 1] = S[1, 0] = -n12 / E1
    S[0, 2] = S[2, 0] = -n13 / E1
    S[1, 2] = S[2, 1] = -n23 / E2
    return S


@pytest.mark.parametrize("cell", SPACE)
def test_an_isotropic_body_in_space(cell: str) -> None:
    material = IsotropicElasticity(YOUNG, POISSON)
    assert difference(material, cell, isotropic_matrix(YOUNG, POISSON, 3)) < 1e-13


@pytest.mark.parametrize("cell", PLANE)
def test_plane_strain_and_plane_stress(cell: str) -> None:
    strained, stressed = isotropic_matrix(YOUNG, POISSON, 2), plane_stress_matrix(YOUNG, POISSON)
    assert difference(PlaneStrain(YOUNG, POISSON), cell, strained) < 1e-13
    assert difference(PlaneStress(YOUNG, POISSON), cell, stressed) < 1e-13
    assert difference(PlaneStress(YOUNG, POISSON), cell, strained) > 0.01


def test_a_constant_strain_triangle_by_hand() -> None:
    """E = 1, ν = 0, right triangle with legs of length one: K = ½ Bᵀ diag(1, 1, ½) B."""
    B = np.array([[-1, 0, 1, 0, 0, 0], [0, -1, 0, 0, 0, 1], [-1, -1, 0, 1, 1, 0.0]])
    expected = 0.5 * B.T @ np.diag([1, 1, 0.5]) @ B
    found = by_node(one_cell(PlaneStrain(1.0, 0.0), "triangle", np.array([[0, 0], [1, 0], [0, 1.0]])))
    np.testing.assert_allclose(found, expected, atol=1e-15)


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("model", [FromEnergy, FromStress])
def test_a_model_of_the_user_gives_the_same_from_energy_and_from_stress(model: Any, cell: str) -> None:
    dim = 2 if cell in PLANE else 3
    assert difference(model(*LAME), cell, isotropic_matrix(YOUNG, POISSON, dim)) < 1e-13


@pytest.mark.parametrize("cell", PLANE)
def test_an_energy_may_be_written_with_single_entries(cell: str) -> None:
    assert difference(EnergyByEntries(*LAME), cell, isotropic_matrix(YOUNG, POISSON, 2)) < 1e-13


@pytest.mark.parametrize("cell", SPACE)
def test_an_orthotropic_body_along_the_axes(cell: str) -> None:
    assert difference(OrthotropicElasticity(*WOOD), cell, np.linalg.inv(compliance_of_wood())) < 1e-12


@pytest.mark.parametrize("cell", SPACE)
def test_equal_constants_make_an_isotropic_body_in_any_orientation(cell: str) -> None:
    shear = YOUNG / (2 * (1 + POISSON))
    axes = material_axes((1, 2, 0.5), (0, 1, 3))
    material = OrthotropicElasticity((YOUNG,) * 3, (POISSON,) * 3, (shear,) * 3, axes)
    assert difference(material, cell, isotropic_matrix(YOUNG, POISSON, 3)) < 1e-12


@pytest.mark.parametrize("cell", SPACE)
def test_turning_body_and_material_together_turns_the_matrix(cell: str) -> None:
    axes = np.array(material_axes((1, 2, 0.5), (0, 1, 3)))
    vertices = skewed_cell(cell)
    straight = by_node(one_cell(OrthotropicElasticity(*WOOD), cell, vertices))
    turned_material = OrthotropicElasticity(*WOOD, tuple(tuple(axis) for axis in axes))
    turned = by_node(one_cell(turned_material, cell, vertices @ axes))
    Q = np.kron(np.eye(len(vertices)), axes)
    np.testing.assert_allclose(Q @ turned @ Q.T, straight, atol=1e-12 * np.abs(straight).max())
    unturned = by_node(one_cell(OrthotropicElasticity(*WOOD), cell, vertices @ axes))
    assert np.abs(unturned - turned).max() > 0.01 * np.abs(turned).max()


@pytest.mark.parametrize("cell", PLANE)
def test_an_orthotropic_plate_along_and_across_the_axes(cell: str) -> None:
    (E1, E2, _), (n12, *_), (G12, *_) = WOOD
    S = np.array([[1 / E1, -n12 / E1, 0], [-n12 / E1, 1 / E2, 0], [0, 0, 1 / G12]])
    assert difference(OrthotropicPlaneStress((E1, E2), n12, G12), cell, np.linalg.inv(S)) < 1e-12
    across = np.linalg.inv(S)[np.ix_([1, 0, 2], [1, 0, 2])]
    assert difference(OrthotropicPlaneStress((E1, E2), n12, G12, np.pi / 2), cell, across) < 1e-12


def test_an_orthotropic_plate_is_an_orthotropic_body_without_stress_normal_to_it() -> None:
    angle = 0.4
    c, s = np.cos(angle), np.sin(angle)
    body = OrthotropicElasticity(*WOOD, ((c, s, 0), (-s, c, 0), (0, 0, 1)))
    plate = OrthotropicPlaneStress(WOOD[0][:2], WOOD[1][0], WOOD[2][0], angle)
    in_plane = np.linalg.inv(body.stiffness_matrix)[np.ix_([0, 1, 5], [0, 1, 5])]
    np.testing.assert_allclose(plate.stiffness_matrix, np.linalg.inv(in_plane), rtol=1e-10, atol=1e-12)
