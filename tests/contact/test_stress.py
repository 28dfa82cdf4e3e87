"""The stress of bodies on cells and nodes, against closed forms."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, ThermalStrain, Traction
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain, PlaneStress
from tests.contact.stress_cases import (
    PEAK,
    SCENES,
    composite,
    cylinder,
    lame,
    line_contact,
    punched,
    solved,
)

SCRIPT = Path(__file__).with_name("stress_cases.py")
COMM = MPI.COMM_SELF


def rates(errors: list[float]) -> np.ndarray:
    return np.log2(np.divide(errors[:-1], errors[1:]))


@pytest.mark.parametrize(("order", "coarsest", "rate"), [(1, 6, 1.8), (2, 3, 2.6)])
def test_the_stress_of_a_thick_cylinder_converges_to_lame(order: int, coarsest: int, rate: float) -> None:
    on_cells, on_nodes, at_wall = [], [], []
    for cells in (coarsest, 2 * coarsest, 4 * coarsest):
        scene = cylinder(cells, order=order)
        state, mesh = solved(scene, COMM, 1), scene.bodies["ring"].mesh
        (nodal,) = state.gather_nodal_stress("ring")
        error = np.abs(nodal - lame(mesh.points)).max(axis=(1, 2))
        on_nodes.append(error.max())
        at_wall.append(error[np.unique(mesh.surfaces["x0"])].max())
        middle = mesh.points[mesh.cells].mean(axis=1)
        on_cells.append(np.abs(state.gather_stress("ring") - lame(middle)).max())
    assert rates(on_cells)[-1] > 1.8, on_cells
    assert rates(on_nodes)[-1] > rate, on_nodes
    assert at_wall[-1] < 0.02 * np.abs(lame(np.array([[1.0, 0.0]]))).max()


@pytest.mark.parametrize("order", [1, 2])
def test_the_stress_below_a_cylinder_converges_to_hertz(order: int) -> None:
    errors = []
    for cells in (4, 8, 16):
        scene = punched(cells // order, order=order)
        state, points = solved(scene, COMM, 1), scene.bodies["block"].mesh.points
        (nodal,) = state.gather_nodal_stress("block")
        below = points[:, 1] < -0.24  # at the ends of the contact the pressure has a vertical slope
        errors.append(np.abs(nodal - line_contact(points))[below].max() / PEAK)
    # The largest shear stress lies on the axis, 0.786 half widths below the surface: 0.3 p₀.
    axis = below & (points[:, 0] == 0.0)
    shear = 0.5 * (nodal[axis, 0, 0] - nodal[axis, 1, 1])
    assert shear.max() == pytest.approx(0.3003 * PEAK, rel=0.01)
    assert points[axis][shear.argmax(), 1] == pytest.approx(-0.786, abs=0.1)
    assert rates(errors).min() > 1.0, errors
    assert errors[-1] < 0.01, errors


@pytest.mark.parametrize("material", [PlaneStrain(1000.0, 0.3), PlaneStress(1000.0, 0.3), None])
def test_a_bar_in_tension_has_one_stress_everywhere(material: PlaneStrain | PlaneStress | None) -> None:
    pull = 7.0
    if material is None:
        body = Body(block((0, 0, 0), (4, 1, 1), (5, 2, 2)), IsotropicElasticity(1000.0, 0.3))
    else:
        body = Body(rectangle((0, 0), (4, 1), (5, 2)), material)
    dim = body.mesh.dim
    rollers = [
        Support("bar", "xyz"[k] + "0", tuple(0.0 if k == j else None for j in range(dim))) for k in range(dim)
    ]
    scene = Scene({"bar": body}, rollers, [Traction("bar", "x1", (pull, *[0.0] * (dim - 1)))])
    state = solved(scene, COMM)
    expected = np.zeros((3, 3))
    expected[0, 0] = pull
    if isinstance(material, PlaneStrain):
        expected[2, 2] = 0.3 * pull
    for found in (state.gather_stress("bar"), *state.gather_nodal_stress("bar")):
        np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-8)
    principal = state.principal_stress["bar"].x.array.reshape(-1, 3)
    np.testing.assert_allclose(
        principal, np.tile(np.sort(np.diag(expected))[::-1], (len(principal), 1)), atol=1e-8
    )


def test_nodes_between_two_materials_have_the_stress_of_each() -> None:
    scene = composite()
    state, mesh = solved(scene, COMM), scene.bodies["bar"].mesh
    low, high = state.gather_nodal_stress("bar")
    between = np.isclose(mesh.points[:, 1], 1.0)
    assert between.sum() > 10
    for stress, mine, young in (
        (low, mesh.points[:, 1] < 1.0 + 1e-9, 1000.0),
        (high, mesh.points[:, 1] > 1.0 - 1e-9, 3000.0),
    ):
        assert np.isnan(stress[~mine]).all()
        np.testing.assert_allclose(stress[mine][:, 0, 0], young * 0.01 / 4.0, rtol=1e-8)
        assert np.abs(stress[mine][:, 1:]).max() < 1e-8


def test_principal_stresses_and_von_mises_are_those_of_the_tensor() -> None:
    state = solved(SCENES["bent"](), COMM)
    tensor = state.gather_stress("beam")
    np.testing.assert_array_equal(tensor, np.swapaxes(tensor, 1, 2))
    fields = state.gather_fields("beam").cells
    s = fields["principal_stress"]
    assert np.all(np.diff(s, axis=1) <= 0.0)
    np.testing.assert_allclose(s.sum(axis=1), np.trace(tensor, axis1=1, axis2=2), atol=1e-9)
    np.testing.assert_allclose(s[:, 0] * s[:, 1] * s[:, 2], np.linalg.det(tensor), atol=1e-6)
    equivalent = np.sqrt(0.5 * ((s - np.roll(s, 1, axis=1)) ** 2).sum(axis=1))
    # The mean of von Mises stress is above that of the mean stress, and near it in all but bent cells.
    assert np.all(equivalent <= fields["von_mises"] * (1 + 1e-9))
    assert np.median(equivalent / fields["von_mises"]) > 0.8
    xx, yy, zz, xy, yz, xz = fields["stress"].T
    np.testing.assert_array_equal(tensor[:, 0], np.stack([xx, xy, xz], axis=1))
    np.testing.assert_array_equal(tensor[:, 1:, 2], np.stack([yz, zz], axis=1))
    np.testing.assert_array_equal(tensor[:, 1, 1], yy)


def test_a_held_body_that_is_warmed_has_thermal_stress() -> None:
    young, poisson, expansion, warmer = 1000.0, 0.25, 1e-4, 30.0
    body = Body(block((0, 0, 0), (2, 1, 1), (4, 2, 2)), IsotropicElasticity(young, poisson, expansion))
    sides = [
        Support("body", "xyz"[k] + side, tuple(0.0 if k == j else None for j in range(3)))
        for k in range(3)
        for side in "01"
    ]
    state = solved(Scene({"body": body}, sides, [ThermalStrain("body", warmer)]), COMM)
    pressure = young * expansion * warmer / (1 - 2 * poisson)
    for found in (state.gather_stress("body"), *state.gather_nodal_stress("body")):
        np.testing.assert_allclose(found, np.broadcast_to(-pressure * np.eye(3), found.shape), atol=1e-8)


def test_stresses_are_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    answers = json.loads(mpirun(SCRIPT, 2, "composite", "cylinder"))
    assert len(answers) == 2
    for name, found in answers.items():
        state = solved(SCENES[name](), COMM)
        (body,) = state.scene.bodies
        cells, nodes = state.gather_stress(body), np.nan_to_num(state.gather_nodal_stress(body), nan=-7.0)
        assert np.abs(cells).max() > 1.0
        np.testing.assert_allclose(found["cells"], cells.ravel(), atol=1e-8)
        np.testing.assert_allclose(found["nodes"], nodes.ravel(), atol=1e-8)
        assert found["principal"] == pytest.approx(state.principal_stress[body].x.array.max(), rel=1e-9)


def test_a_far_body_has_the_same_stress() -> None:
    scene = SCENES["bent"]()
    mesh = scene.bodies["beam"].mesh
    far = scene.moved({"beam": mesh.points + 1e4})
    near_stress, far_stress = (solved(each, COMM).gather_nodal_stress("beam") for each in (scene, far))
    np.testing.assert_allclose(far_stress, near_stress, rtol=0, atol=1e-6 * np.abs(near_stress).max())
