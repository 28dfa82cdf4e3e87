"""Stresses that bodies have before they are loaded: kept where they are held, relaxed where they are free."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    InitialStress,
    Scene,
    State,
    Support,
    ThermalStrain,
    Traction,
    Ufl,
    box_partition,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    IsotropicElasticity,
    J2Plasticity,
    OrthotropicElasticity,
    PlaneStrain,
    PlaneStress,
)
from fenics_contact.mesh import quadratic, serendipity
from tests.materials.bodies import bent, box, in_halves, steel
from tests.materials.elements import CELLS, PLANE

#: xx, yy, zz, yz, xz, xy.
GIVEN = np.array([3.0, -1.0, 2.0, 0.5, -0.7, 1.1])


def solved(body: Body, *loads: Any, supports: Any = (), boxes: tuple[int, ...] = ()) -> State:
    held = [Support("body", "x0", (0.0,) * body.components), *supports]
    pieces = {"body": box_partition(body.mesh, boxes)} if boxes else None
    scene = Scene({"body": body}, held, loads)
    return solve_scene(scene, MPI.COMM_SELF, partitions=pieces, tolerance=1e-11)


def in_plane(stress: np.ndarray) -> np.ndarray:
    return np.where([True, True, True, False, False, True], stress, 0.0)


def tensor(stress: np.ndarray) -> np.ndarray:
    xx, yy, zz, yz, xz, xy = stress
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.mark.parametrize("cell", CELLS)
def test_a_body_that_is_held_all_around_keeps_it(cell: str) -> None:
    mesh = box(cell)
    given = GIVEN if mesh.dim == 3 else in_plane(GIVEN)
    walls = [Support("body", name) for name in mesh.surfaces if name != "x0"]
    state = solved(Body(mesh, steel(mesh.dim)), InitialStress("body", tuple(given)), supports=walls)
    assert np.abs(state.gather_displacement("body")).max() < 1e-10
    np.testing.assert_allclose(state.gather_stress("body"), [tensor(given)] * mesh.n_cells, atol=1e-8)
    size = tensor(given) - np.trace(tensor(given)) / 3 * np.eye(3)
    np.testing.assert_allclose(state.gather_von_mises("body"), np.sqrt(1.5) * np.linalg.norm(size), rtol=1e-8)


@pytest.mark.parametrize("kind", ["linear", "quadratic", "serendipity", "reduced"])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_free_body_relaxes_it_by_the_strain_of_its_compliance(cell: str, kind: str) -> None:
    """ε = −C⁻¹ σ₀ everywhere, and no stress is left."""
    mesh = bent(box(cell))
    if kind != "linear":
        mesh = quadratic(mesh)
    if cell == "hexahedron" and kind in ("serendipity", "reduced"):
        mesh = serendipity(mesh)
    reduced = bool(mesh.centres) and kind == "reduced"
    material = OrthotropicElasticity((110.0, 90.0, 50.0), (0.37, 0.42, 0.2), (70.0, 60.0, 50.0))
    slack = -np.linalg.inv(material.stiffness_matrix) @ GIVEN
    strain = tensor(slack * [1, 1, 1, 0.5, 0.5, 0.5])
    pulled = [
        Support("body", name, tuple(lambda x, row=row: x @ row for row in strain)) for name in ("x0", "x1")
    ]
    body = Body(mesh, material, integration="reduced" if reduced else "full")
    scene = Scene({"body": body}, pulled, [InitialStress("body", tuple(GIVEN))])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    np.testing.assert_allclose(state.gather_displacement("body"), mesh.points @ strain, atol=1e-9)
    assert np.abs(state.gather_stress("body")).max() < 1e-7


def by_heat(cell: str, axisymmetric: bool = False) -> tuple[State, State]:
    """A body heated evenly, and one with the stress that this would have if nothing moved."""
    mesh = bent(in_halves(box(cell)))
    heat, (E, nu, alpha) = 50.0, (100.0, 0.3, 1e-3)
    if axisymmetric:
        mesh = mesh.moved(mesh.points + np.array([1.0, 0.0]))
    kind = PlaneStrain if mesh.dim == 2 and not axisymmetric else IsotropicElasticity
    body = Body(mesh, kind(E, nu, alpha), axisymmetric=axisymmetric)
    pressure = -E * alpha * heat / (1 - 2 * nu)
    pull = Traction("body", "x1", (0.3, 0.1, 0.2)[: mesh.dim])
    warm = solved(body, ThermalStrain("body", heat), pull)
    given = pressure * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    halves = [
        InitialStress("body", tuple(given), "left"),
        InitialStress("body", lambda x: np.tile(given, (len(x), 1)), "right"),
    ]
    return warm, solved(body, *halves, pull)


@pytest.mark.parametrize(("cell", "turned"), [*((c, False) for c in CELLS), *((c, True) for c in PLANE)])
def test_it_acts_as_the_stress_of_a_temperature_does(cell: str, turned: bool) -> None:
    warm, stressed = by_heat(cell, turned)
    wanted = warm.gather_displacement("body")
    assert np.abs(wanted).max() > 0.01
    np.testing.assert_allclose(stressed.gather_displacement("body"), wanted, atol=1e-8)
    np.testing.assert_allclose(stressed.gather_stress("body"), warm.gather_stress("body"), atol=1e-6)
    nodal = [state.gather_nodal_stress("body") for state in (stressed, warm)]
    np.testing.assert_allclose(*nodal, atol=1e-6)
    assert stressed.energies.total_potential == pytest.approx(warm.energies.total_potential, rel=1e-7)


@pytest.mark.parametrize("boxes", [(1, 1, 1), (2, 1, 1), (3, 2, 1)])
def test_one_half_of_a_bar_between_walls_shares_it_with_the_other(boxes: tuple[int, ...]) -> None:
    """Without contraction the bar has one stress, σ₀ / 2, and its middle moves by σ₀ L / (4 E)."""
    mesh = in_halves(block((0, 0, 0), (2, 1, 1), (6, 2, 2)))
    body = Body(mesh, IsotropicElasticity(100.0, 0.0))
    walls = [Support("body", "x1")]
    state = solved(body, InitialStress("body", (8.0, 0, 0, 0, 0, 0), "left"), supports=walls, boxes=boxes)
    np.testing.assert_allclose(state.gather_stress("body")[:, 0, 0], 4.0, rtol=1e-7)
    middle = state.gather_displacement("body")[mesh.points[:, 0] == 1.0, 0]
    np.testing.assert_allclose(middle, -0.04, rtol=1e-7)


def test_it_counts_with_the_thickness_of_a_plate() -> None:
    mesh = in_halves(rectangle((0, 0), (2, 1), (4, 2)))
    plates = {name: PlaneStress(100.0, 0.0, thickness=t) for name, t in (("left", 0.5), ("right", 2.0))}
    walls = [Support("body", "x1")]
    state = solved(Body(mesh, plates), InitialStress("body", (8.0, 0, 0, 0, 0, 0)), supports=walls)
    # N = t (σ₀ + E ε) in both halves, and the strains add up to zero: N = 2 σ₀ / (1 / t₁ + 1 / t₂).
    force = 2 * 8.0 / (1 / 0.5 + 1 / 2.0)
    wanted = force / state.scene.bodies["body"].thickness_of_cells
    np.testing.assert_allclose(state.gather_stress("body")[:, 0, 0], wanted, rtol=1e-7)


def test_what_it_cannot_be_is_refused() -> None:
    mesh, flat = box("hexahedron"), box("quadrilateral")
    with pytest.raises(InvalidInputError, match=r"InitialStress.value must be 6 finite numbers"):
        InitialStress("body", (1.0, 2.0, 3.0))
    with pytest.raises(InvalidInputError, match=r"must be numbers or a function of points, got .*Ufl"):
        InitialStress("body", Ufl(lambda x: x))
    with pytest.raises(InvalidInputError, match=r"names region 'top' of body 'body'"):
        Scene({"body": Body(mesh, steel(3))}, loads=[InitialStress("body", tuple(GIVEN), "top")])
    metal = Body(mesh, J2Plasticity(100.0, 0.3, 1.0))
    with pytest.raises(InvalidInputError, match=r"needs linear materials, body 'body' has J2Plasticity"):
        Scene({"body": metal}, loads=[InitialStress("body", tuple(GIVEN))])
    plate = Body(flat, PlaneStress(100.0, 0.3))
    with pytest.raises(InvalidInputError, match=r"must be zero in yz and xz and zz, got others in zz"):
        Scene({"body": plate}, loads=[InitialStress("body", tuple(in_plane(GIVEN)))])
    with pytest.raises(InvalidInputError, match=r"must be zero in yz and xz, got others in yz and xz"):
        solved(Body(flat, steel(2)), InitialStress("body", lambda x: np.tile(GIVEN, (len(x), 1))))
