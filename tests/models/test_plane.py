"""Plates and slices under uniaxial tension have the strains and the stress of the book (patch test)."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, Scene, State, Support, Traction, box_partition, solve_scene
from fenics_contact.materials import Material, OrthotropicPlaneStress, PlaneStrain, PlaneStress
from tests.models.bodies import box
from tests.models.elements import PLANE

YOUNG, POISSON, TENSION = 100.0, 0.3, 2.0


def irregular(cell: str) -> BodyMesh:
    """A rectangle whose inner nodes are displaced."""
    mesh = box(cell, (4, 3, 1))
    inside = np.setdiff1d(
        np.arange(mesh.n_nodes), np.concatenate([f.ravel() for f in mesh.surfaces.values()])
    )
    points = mesh.points.copy()
    points[inside] += 0.08 * np.sin(np.arange(2 * len(inside))).reshape(-1, 2)
    return mesh.moved(points)


def pulled(material: Material, cell: str) -> State:
    mesh = irregular(cell)
    scene = Scene(
        {"plate": Body(mesh, material)},
        [Support("plate", "x0", (0.0, None)), Support("plate", "y0", (None, 0.0))],
        [Traction("plate", "x1", (TENSION, 0.0))],
    )
    return solve_scene(
        scene, MPI.COMM_SELF, partitions={"plate": box_partition(mesh, (2, 1))}, tolerance=1e-10
    )


def strains(state: State) -> np.ndarray:
    """Strain along and across, of every node."""
    points = state.scene.bodies["plate"].mesh.points
    away = np.all(points > 0.1, axis=1)
    return np.asarray(state.gather_displacement("plate")[away] / points[away])


@pytest.mark.parametrize("cell", PLANE)
def test_a_plate_is_stretched_and_contracts(cell: str) -> None:
    state = pulled(PlaneStress(YOUNG, POISSON), cell)
    expected = np.array([1, -POISSON]) * TENSION / YOUNG
    np.testing.assert_allclose(strains(state), np.tile(expected, (len(strains(state)), 1)), rtol=1e-8)
    np.testing.assert_allclose(state.gather_von_mises("plate"), TENSION, rtol=1e-8)


@pytest.mark.parametrize("cell", PLANE)
def test_a_slice_is_stretched_less_and_pulled_along(cell: str) -> None:
    """ε = (1 − ν²) σ/E and −ν (1 + ν) σ/E; the stress normal to the plane is ν σ."""
    state = pulled(PlaneStrain(YOUNG, POISSON), cell)
    expected = np.array([1 - POISSON**2, -POISSON * (1 + POISSON)]) * TENSION / YOUNG
    np.testing.assert_allclose(strains(state), np.tile(expected, (len(strains(state)), 1)), rtol=1e-8)
    mises = TENSION * np.sqrt(1 - POISSON + POISSON**2)
    np.testing.assert_allclose(state.gather_von_mises("plate"), mises, rtol=1e-8)


@pytest.mark.parametrize("cell", PLANE)
def test_an_orthotropic_plate_is_as_stiff_as_the_axis_that_is_pulled(cell: str) -> None:
    for angle, young, poisson in ((0.0, 110.0, 0.4), (np.pi / 2, 9.0, 0.4 * 9.0 / 110.0)):
        state = pulled(OrthotropicPlaneStress((110.0, 9.0), 0.4, 7.0, angle), cell)
        expected = np.array([1, -poisson]) * TENSION / young
        np.testing.assert_allclose(strains(state), np.tile(expected, (len(strains(state)), 1)), rtol=1e-7)
