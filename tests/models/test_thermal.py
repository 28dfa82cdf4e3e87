"""Temperature changes: free expansion has no stress, held expansion has the one of the book."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, State, Support, ThermalStrain, Ufl, box_partition, solve_scene
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    IsotropicElasticity,
    Material,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    material_axes,
)
from tests.models.bodies import bent, box, in_halves
from tests.models.elements import CELLS, PLANE, SPACE

YOUNG, POISSON, EXPANSION, WARMER = 100.0, 0.3, 1e-3, 40.0
UNIFORM: list[Any] = [WARMER, lambda points: np.full(len(points), WARMER), Ufl(lambda x: WARMER + 0 * x[0])]


def rollers(dim: int, *more: str) -> list[Support]:
    """The sides of a box that meet at the origin stay in their planes, and those named in ``more``."""
    names = [("x", 0), ("y", 1), ("z", 2)][:dim]
    return [
        Support("body", f"{axis}{end}", tuple(0.0 if c == component else None for c in range(dim)))
        for axis, component in names
        for end in (0, 1)
        if end == 0 or f"{axis}1" in more
    ]


def heated(material: Material, cell: str, change: Any, *held: str) -> State:
    """A straight box of two subdomains at another temperature."""
    mesh = box(cell)
    partition = box_partition(mesh, (2, 1, 1)[: mesh.dim])
    loads = [ThermalStrain("body", change)]
    scene = Scene({"body": Body(mesh, material)}, rollers(mesh.dim, *held), loads)
    return solve_scene(scene, MPI.COMM_SELF, partitions={"body": partition}, tolerance=1e-10)


@pytest.mark.parametrize("change", UNIFORM, ids=["number", "function", "UFL"])
@pytest.mark.parametrize("cell", SPACE)
def test_a_free_body_expands_evenly_and_without_stress(cell: str, change: Any) -> None:
    state = heated(IsotropicElasticity(YOUNG, POISSON, EXPANSION), cell, change)
    expected = EXPANSION * WARMER * box(cell).points
    np.testing.assert_allclose(state.gather_displacement("body"), expected, atol=1e-10 * expected.max())
    assert state.gather_von_mises("body").max() < 1e-8 * YOUNG * EXPANSION * WARMER


@pytest.mark.parametrize("cell", SPACE)
def test_a_free_orthotropic_body_expands_along_its_axes(cell: str) -> None:
    axes = np.array(material_axes((1, 0.5, 0), (0, 1, 0)))
    along = np.array([1e-3, -2e-4, 3e-3])
    wood = OrthotropicElasticity(
        (11.0, 0.9, 0.5), (0.37, 0.42, 0.6), (0.7, 0.6, 0.05), tuple(map(tuple, axes)), tuple(along)
    )
    mesh = bent(box(cell))
    strain = WARMER * axes.T @ np.diag(along) @ axes
    supports = [Support("body", name, _linear(strain)) for name in ("x0", "x1")]
    scene = Scene({"body": Body(mesh, wood)}, supports, [ThermalStrain("body", WARMER)])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    np.testing.assert_allclose(state.gather_displacement("body"), mesh.points @ strain, atol=1e-9)
    assert state.gather_von_mises("body").max() < 1e-9
    assert abs(strain[0, 1]) > 0.01, "the axes are not turned: nothing was tested"


def _linear(strain: np.ndarray) -> Any:
    return tuple(lambda points, row=row: points @ row for row in strain)


@pytest.mark.parametrize("cell", PLANE)
def test_a_free_orthotropic_plate_expands_along_its_axes(cell: str) -> None:
    angle, along = 0.5, np.array([1e-3, 4e-3])
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    plate = OrthotropicPlaneStress((110.0, 9.0), 0.4, 7.0, angle, tuple(along))
    mesh, strain = bent(box(cell)), WARMER * axes.T @ np.diag(along) @ axes
    supports = [Support("body", name, _linear(strain)) for name in ("x0", "x1")]
    scene = Scene({"body": Body(mesh, plate)}, supports, [ThermalStrain("body", WARMER)])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    np.testing.assert_allclose(state.gather_displacement("body"), mesh.points @ strain, atol=1e-9)
    assert state.gather_von_mises("body").max() < 1e-7
    assert abs(strain[0, 1]) > 0.01, "the axes are not turned: nothing was tested"


@pytest.mark.parametrize("cell", CELLS)
def test_a_bar_between_walls_is_pressed(cell: str) -> None:
    """σ = −E α ΔT along the bar, free across it; in plane strain the same divided by 1 − ν² and (1 + ν)."""
    if cell in PLANE:
        state = heated(PlaneStress(YOUNG, POISSON, EXPANSION), cell, WARMER, "x1")
        across = EXPANSION * WARMER * (1 + POISSON)
    else:
        state = heated(IsotropicElasticity(YOUNG, POISSON, EXPANSION), cell, WARMER, "x1")
        across = EXPANSION * WARMER * (1 + POISSON)
    stress = YOUNG * EXPANSION * WARMER
    np.testing.assert_allclose(state.gather_von_mises("body"), stress, rtol=1e-8)
    height = box(cell).points[:, 1]
    np.testing.assert_allclose(state.gather_displacement("body")[:, 1], across * height, atol=1e-10)


@pytest.mark.parametrize("cell", PLANE)
def test_a_slice_of_a_long_body_expands_in_its_plane_and_is_pressed_along(cell: str) -> None:
    """Free in the plane: strain (1 + ν) α ΔT, stress −E α ΔT normal to it."""
    state = heated(PlaneStrain(YOUNG, POISSON, EXPANSION), cell, WARMER)
    expected = (1 + POISSON) * EXPANSION * WARMER * box(cell).points
    np.testing.assert_allclose(state.gather_displacement("body"), expected, atol=1e-10)
    np.testing.assert_allclose(state.gather_von_mises("body"), YOUNG * EXPANSION * WARMER, rtol=1e-8)


@pytest.mark.parametrize("cell", PLANE)
def test_a_free_plate_expands_evenly_and_without_stress(cell: str) -> None:
    state = heated(PlaneStress(YOUNG, POISSON, EXPANSION), cell, WARMER)
    expected = EXPANSION * WARMER * box(cell).points
    np.testing.assert_allclose(state.gather_displacement("body"), expected, atol=1e-10)
    assert state.gather_von_mises("body").max() < 1e-8 * YOUNG * EXPANSION * WARMER


def test_a_linear_temperature_bends_a_free_body_without_stress() -> None:
    """ΔT = g y: u = α g (x y, (y² − x²)/2), which bilinear cells can only approach."""
    g, found = 10.0, []
    for n in (4, 8):
        mesh = rectangle((0, 0), (1, 1), (n, n))
        material = PlaneStress(YOUNG, POISSON, EXPANSION)
        loads = [ThermalStrain("body", lambda points: g * points[:, 1])]
        roller, pin = Support("body", "x0", (0.0, None)), Support("body", "y0", (None, _bent_down(g)))
        scene = Scene({"body": Body(mesh, material)}, [roller, pin], loads)
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
        found.append(state.gather_von_mises("body").mean() / (YOUNG * EXPANSION * g))
    assert found[1] < 0.6 * found[0] < 0.1


def _bent_down(g: float) -> Any:
    return lambda points: -EXPANSION * g * points[:, 0] ** 2 / 2


def test_two_materials_that_expand_differently_press_each_other() -> None:
    """A bar of two halves between walls, which expand alike across: one stress in both."""
    mesh = in_halves(block((0, 0, 0), (2, 1, 1), (4, 2, 2)))
    left, right = (
        OrthotropicElasticity((E,) * 3, (0.0,) * 3, (E / 2,) * 3, thermal_expansion=(along, 5e-4, 0.0))
        for E, along in ((100.0, 1e-3), (300.0, 2e-3))
    )
    stress = WARMER * (1e-3 + 2e-3) / (1 / 100.0 + 1 / 300.0)
    for boxes in ((2, 1, 1), (1, 1, 2)):  # each half a subdomain, and both halves in each subdomain
        body = Body(mesh, {"left": left, "right": right})
        scene = Scene({"body": body}, rollers(3, "x1"), [ThermalStrain("body", WARMER)])
        state = solve_scene(
            scene, MPI.COMM_SELF, partitions={"body": box_partition(mesh, boxes)}, tolerance=1e-10
        )
        np.testing.assert_allclose(state.gather_von_mises("body"), stress, rtol=1e-8)


def test_without_a_temperature_nothing_thermal_is_compiled() -> None:
    mesh = box("hexahedron")
    body = Body(mesh, IsotropicElasticity(YOUNG, POISSON, EXPANSION))
    supports = [Support("body", "x0"), Support("body", "x1", (0.01, None, None))]
    state = solve_scene(Scene({"body": body}, supports), MPI.COMM_SELF, tolerance=1e-10)
    names = [name[0] for name in state.torn.decomposition.forms.compiled]
    assert names == ["stiffness"]
