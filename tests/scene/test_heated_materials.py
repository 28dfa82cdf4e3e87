"""Nonlinear materials that expand: free and held bodies against theory, and derivatives."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    BodyMesh,
    ContactProblem,
    LoadStep,
    Scene,
    Support,
    ThermalStrain,
    Ufl,
    solve_scene,
    solve_steps,
)
from fenics_contact._fem.mechanics import MaterialStep
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    FinitePlasticity,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHooke,
    NeoHookeanPlasticity,
    Ogden,
    StVenantKirchhoff,
)
from tests.materials.deformed import patch_of, skew_patch, smooth_field

E, NU, YIELD, HARDER = 200.0, 0.3, 1.0, 5.0
ALPHA, HOT = 6e-4, 20.0
EXPANSION: dict[str, Any] = {"thermal_expansion": ALPHA}
THETA = 1 + ALPHA * HOT
RUBBERS = [
    StVenantKirchhoff(E, NU, ALPHA),
    NeoHooke(E, NU, **EXPANSION),
    NeoHooke(E, NU, mean_dilatation=True, **EXPANSION),
    MooneyRivlin(30.0, 5.0, 500.0, mean_dilatation=True, **EXPANSION),
    Ogden((30.0, 1.0), (2.5, -2.0), 500.0, **EXPANSION),
]
METALS = [
    J2Plasticity(E, NU, YIELD, HARDER, mean_dilatation=True, **EXPANSION),
    FinitePlasticity(E, NU, YIELD, HARDER, **EXPANSION),
    NeoHookeanPlasticity(E, NU, YIELD, HARDER, 2.0, **EXPANSION),
]
CUBE = block((0, 0, 0), (1, 1, 1), (1, 1, 1))


def named(material: Any) -> str:
    return f"{type(material).__name__}{'-mean' * getattr(material, 'mean_dilatation', False)}"


def heated(
    material: Material, mesh: BodyMesh = CUBE, held: tuple[str, ...] = (), change: Any = HOT, **own: Any
) -> Scene:
    """A body on planes of symmetry, held along x on further surfaces."""
    sides = [Support("a", name, (0.0,) + (None,) * (mesh.dim - 1)) for name in ("x0", *held)]
    for axis, name in enumerate(("y0", "z0")[: mesh.dim - 1], start=1):
        component: list[Any] = [None] * mesh.dim
        component[axis] = 0.0
        sides.append(Support("a", name, tuple(component)))
    return Scene({"a": Body(mesh, material, **own)}, supports=sides, loads=[ThermalStrain("a", change)])


@pytest.mark.parametrize("material", [*RUBBERS, *METALS], ids=named)
def test_a_free_body_expands_without_stress(material: Material) -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 1, 1))
    state = solve_scene(heated(material, mesh), MPI.COMM_WORLD)
    moved = state.gather_displacement("a")
    np.testing.assert_allclose(moved, (THETA - 1) * mesh.points, atol=1e-7)
    assert np.abs(state.stress["a"].x.array).max() < 1e-5


@pytest.mark.parametrize("material", [RUBBERS[0], RUBBERS[2], METALS[0], METALS[1]], ids=named)
def test_a_free_slice_in_plane_strain_is_a_bar_that_is_held(material: Material) -> None:
    plane = solve_scene(heated(material, rectangle((0, 0), (1, 1), (1, 1))), MPI.COMM_WORLD)
    bar = solve_scene(heated(material, held=("x1",)), MPI.COMM_WORLD)
    lateral = bar.gather_displacement("a")[:, 1].max()
    assert lateral > 1.2 * (THETA - 1)
    np.testing.assert_allclose(plane.gather_displacement("a").max(axis=0), lateral, rtol=1e-6)
    across, along = (state.stress["a"].x.array.reshape(-1, 3, 3)[0] for state in (plane, bar))
    assert across[2, 2] == pytest.approx(along[0, 0], rel=1e-6)
    assert np.abs(across[:2, :2]).max() < 1e-5


def bar_forces(
    material: Material, changes: tuple[float, ...], steps: AutomaticSteps | None = None
) -> list[float]:
    """Return the forces that hold a bar of section one after changes of temperature."""
    scene = heated(material, held=("x1",))
    problem = ContactProblem(scene, MPI.COMM_WORLD, steps=steps)
    loads = [LoadStep(str(change), loads=[ThermalStrain("a", change)]) for change in changes]
    states = solve_steps(problem, loads)
    on_end = scene.bodies["a"].mesh.points[:, 0] == 1.0
    return [float(state.nodal_reactions("a")[on_end, 0].sum()) for state in states]


def test_a_held_bar_has_the_stress_of_its_mechanical_stretch() -> None:
    """F / θ = 1 / θ along x, free across; P = θ² P(F / θ)."""
    mechanical = (THETA**-2 - 1) / 2
    (force,) = bar_forces(RUBBERS[0], (HOT,))
    assert force == pytest.approx(THETA * E * mechanical, rel=1e-7)
    (force,) = bar_forces(METALS[1], (HOT,))
    flow = (np.log(THETA) - YIELD / E) / (1 + HARDER / E)
    assert flow > 0
    assert force == pytest.approx(-(THETA**3) * (YIELD + HARDER * flow), rel=1e-7)


@pytest.mark.parametrize("steps", [None, AutomaticSteps(first=0.3, finer_history=True)], ids=["one", "cut"])
def test_a_held_bar_that_was_hot_is_pulled_when_it_is_cold_again(steps: AutomaticSteps | None) -> None:
    """It yields twice, first pressed, then pulled."""
    hot, cold, again = bar_forces(METALS[0], (HOT, 0.0, HOT), steps)
    first = (ALPHA * HOT - YIELD / E) / (1 + HARDER / E)
    assert hot == pytest.approx(-(YIELD + HARDER * first), rel=1e-7)
    second = (first - (YIELD + HARDER * first) / E) / (1 + HARDER / E)
    assert second > 0
    assert cold == pytest.approx(YIELD + HARDER * (first + second), rel=1e-7)
    assert again < hot


@pytest.mark.parametrize("cell", ["quadrilateral", "tetrahedron10", "hexahedron"])
@pytest.mark.parametrize("material", RUBBERS[1:4], ids=named)
def test_forces_and_stiffness_are_derivatives_in_uneven_heat(material: Material, cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), material))
    places = patch.points[np.argsort(patch.mesh.nodes)]
    step = MaterialStep(temperature=300.0 * np.sin(places.sum(axis=1)))
    u, direction = smooth_field(patch.points, 0.1).ravel(), np.cos(np.arange(patch.points.size) ** 1.5)
    here = patch.mechanics.at(u, step)
    ahead, behind = (patch.mechanics.at(u + sign * 1e-5 * direction, step) for sign in (1, -1))
    slope, growth = (ahead.energy - behind.energy) / 2e-5, (ahead.force - behind.force) / 2e-5
    assert slope == pytest.approx(here.force @ direction, rel=1e-6)
    exact = here.stiffness @ direction
    assert np.abs(growth - exact).max() < 1e-7 * np.abs(exact).max()
    cold = patch.mechanics.at(u)
    assert np.abs(cold.force - here.force).max() > 0.1 * np.abs(here.force).max()


@pytest.mark.parametrize("material", METALS[:2], ids=named)
def test_stiffness_of_hot_metal_is_the_derivative_of_its_force(material: Material) -> None:
    patch = patch_of(Body(skew_patch("hexahedron"), material))
    places = patch.points[np.argsort(patch.mesh.nodes)]
    step = MaterialStep(temperature=HOT * np.sin(places.sum(axis=1)))
    u, direction = smooth_field(patch.points, 0.1).ravel(), np.cos(np.arange(patch.points.size) ** 1.5)
    here = patch.mechanics.at(u, step)
    ahead, behind = (patch.mechanics.at(u + sign * 1e-6 * direction, step) for sign in (1, -1))
    exact = here.stiffness @ direction
    assert np.abs((ahead.force - behind.force) / 2e-6 - exact).max() < 1e-6 * np.abs(exact).max()


def test_a_ring_grows_with_its_temperature() -> None:
    ring = rectangle((1.0, 0.0), (2.0, 1.0), (2, 2))
    for material in (RUBBERS[1], METALS[1]):
        body = Body(ring, material, axisymmetric=True)
        scene = Scene(
            {"a": body}, supports=[Support("a", "y0", (None, 0.0))], loads=[ThermalStrain("a", HOT)]
        )
        moved = solve_scene(scene, MPI.COMM_WORLD).gather_displacement("a")
        np.testing.assert_allclose(moved, (THETA - 1) * ring.points, atol=1e-7)


def test_linear_and_nonlinear_materials_of_one_body_expand_alike() -> None:
    """A bar of two materials in a row, free: both have their own expansion, and no stress."""
    mesh = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    right = mesh.points[mesh.cells].mean(axis=1)[:, 0] > 1
    mesh = replace(mesh, regions={"left": np.flatnonzero(~right), "right": np.flatnonzero(right)})
    two = {"left": IsotropicElasticity(E, 0.0, 2 * ALPHA), "right": NeoHooke(E, 0.0, **EXPANSION)}
    body = Body(mesh, two)
    sides = [Support("a", "x0", (0.0, None, None)), Support("a", "y0", (None, 0.0, None))]
    scene = Scene(
        {"a": body},
        supports=[*sides, Support("a", "z0", (None, None, 0.0))],
        loads=[ThermalStrain("a", 1e-3)],
    )
    moved = solve_scene(scene, MPI.COMM_WORLD).gather_displacement("a")
    end = moved[np.isclose(mesh.points[:, 0], 2.0), 0]
    assert end.mean() == pytest.approx(3e-3 * ALPHA, rel=2e-2)


def test_subdomains_feel_their_own_part_of_uneven_heat() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    sides = (np.arange(mesh.n_cells) >= mesh.n_cells // 2).astype(int)
    for material in (RUBBERS[2], METALS[2]):
        scene = heated(material, mesh, ("x1",), lambda x: HOT * x[:, 0] * x[:, 1])
        one, two = (
            solve_scene(scene, MPI.COMM_WORLD, partitions={"a": parts}).gather_displacement("a")
            for parts in (0 * sides, sides)
        )
        assert np.abs(one[:, 0]).max() > 1e-3
        np.testing.assert_allclose(two, one, atol=1e-7)


def test_temperatures_in_ufl_and_designs_of_hot_rubber_are_refused() -> None:
    scene = heated(RUBBERS[1], change=Ufl(lambda x: x[0]))
    with pytest.raises(InvalidInputError, match="nonlinear materials need temperatures at nodes"):
        solve_scene(scene, MPI.COMM_WORLD)
    with pytest.raises(InvalidInputError, match="ThermalStrain needs a thermal expansion"):
        heated(replace(RUBBERS[1], thermal_expansion=None))
