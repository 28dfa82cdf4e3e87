"""Elasticity whose constants follow the temperature: theory, other models at one temperature, load steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    ThermalStrain,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, PlaneStrain, TemperatureDependentElasticity
from tests.materials.bodies import bent, box
from tests.materials.elements import CELLS, PLANE
from tests.scenes import Load

YOUNG = ((20.0, 200.0), (120.0, 100.0))
POISSON = ((20.0, 0.3), (120.0, 0.2))
EXPANSION = ((20.0, 1e-3), (120.0, 3e-3))
STEEL = TemperatureDependentElasticity(
    YOUNG, POISSON, EXPANSION, initial_temperature=40.0, expansion_from=10.0
)


def solved(body: Body, *loads: Load, boxes: Any = ()) -> State:
    scene = Scene({"body": body}, [Support("body", "x0", (0.0,) * body.mesh.dim)], loads)
    pieces = {"body": box_partition(body.mesh, boxes)} if boxes else None
    return solve_scene(scene, MPI.COMM_SELF, partitions=pieces, tolerance=1e-11)


def test_expansions_are_means_from_a_temperature_on() -> None:
    """ε = α(T) (T − 10) − α(40) (40 − 10) with α(40) = 1.4e-3, α(90) = 2.4e-3, constant beyond 120."""
    change = np.array([0.0, 50.0, 80.0, 180.0])
    wanted = [0.0, 2.4e-3 * 80 - 1.4e-3 * 30, 3e-3 * 110 - 1.4e-3 * 30, 3e-3 * 210 - 1.4e-3 * 30]
    np.testing.assert_allclose(STEEL.free_strain(change), wanted, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(("cell", "turned"), [*((c, False) for c in CELLS), *((c, True) for c in PLANE)])
def test_at_one_temperature_it_is_the_linear_model_with_the_constants_there(cell: str, turned: bool) -> None:
    mesh = bent(box(cell))
    mesh = mesh.moved(mesh.points + np.array([1.0, 0.0])) if turned else mesh
    kind = PlaneStrain if mesh.dim == 2 and not turned else IsotropicElasticity
    alike = kind(150.0, 0.25, float(STEEL.free_strain(np.array([30.0]))[0]) / 30.0)
    loads = [ThermalStrain("body", 30.0), Traction("body", "x1", (0.5, 0.2, -0.1)[: mesh.dim])]
    states = [solved(Body(mesh, material, axisymmetric=turned), *loads) for material in (STEEL, alike)]
    own, wanted = (state.gather_displacement("body") for state in states)
    assert np.abs(wanted).max() > 1e-3
    np.testing.assert_allclose(own, wanted, atol=1e-7 * np.abs(wanted).max())
    stress = [state.gather_stress("body") for state in states]
    np.testing.assert_allclose(*stress, atol=1e-6 * np.abs(stress[1]).max())


@pytest.mark.parametrize("boxes", [(1, 1, 1), (2, 1, 1)])
def test_a_bar_with_a_gradient_of_temperature(boxes: tuple[int, ...]) -> None:
    """Without contraction each cell has the mean of E and of E ε_th at its two points along the bar."""
    mesh = block((0, 0, 0), (4, 1, 1), (4, 1, 1))
    material = TemperatureDependentElasticity(YOUNG, 0.0, EXPANSION, 40.0, 10.0)
    heat = ThermalStrain("body", lambda x: -20.0 + 20.0 * x[:, 0])
    state = solved(Body(mesh, material), heat, Traction("body", "x1", (2.0, 0.0, 0.0)), boxes=boxes)
    points = np.arange(4)[:, None] + 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)
    change = -20.0 + 20.0 * points
    young = 200.0 - (change + 20.0)
    strain = (2.0 + (young * material.free_strain(change)).mean(axis=1)) / young.mean(axis=1)
    tip = state.gather_displacement("body")[mesh.points[:, 0] == 4.0, 0]
    np.testing.assert_allclose(tip, strain.sum(), rtol=1e-8)
    np.testing.assert_allclose(state.gather_stress("body")[:, 0, 0], 2.0, rtol=1e-7)


def test_stiffness_follows_the_temperature_from_step_to_step_and_back() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    material = TemperatureDependentElasticity(YOUNG, 0.0, None, 40.0)
    scene = Scene({"body": Body(mesh, material)}, [Support("body", "x0")])
    pull = Traction("body", "x1", (3.0, 0.0, 0.0))
    steps = [
        LoadStep(f"{change}", loads=[pull, ThermalStrain("body", change)]) for change in (0.0, 60.0, -20.0)
    ]
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-11)
    tips = [
        state.gather_displacement("body")[:, 0].max() for state in solve_steps(problem, [*steps, steps[0]])
    ]
    np.testing.assert_allclose(tips, [6.0 / young for young in (180.0, 120.0, 200.0, 180.0)], rtol=1e-8)


def test_a_hot_block_presses_on_walls_with_the_stiffness_that_it_has() -> None:
    """E(T) ε_th without contraction; the gap of 0.01 is closed first."""
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    material = TemperatureDependentElasticity(YOUNG, 0.0, EXPANSION, 40.0, 10.0)
    scene = Scene(
        {"body": Body(mesh, material)},
        [Support("body", f"{a}0", tuple(0.0 if a == b else None for b in "xyz")) for a in "xyz"],
        [ThermalStrain("body", 60.0)],
        [ContactPair(Surface("body", "z1"), RigidPlane((0, 0, 1.01), (0, 0, -1)))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    free = float(material.free_strain(np.array([60.0]))[0])
    force = state.contact.normal_force.sum()
    held = state.gather_stress("body")[:, 2, 2]
    assert force == pytest.approx(-held.mean(), rel=1e-6)
    assert force == pytest.approx(120.0 * (free - 0.01), rel=1e-6)


def test_two_hot_blocks_press_on_each_other_across_meshes_that_do_not_match() -> None:
    """E(T) ε_th between two walls; by mortar, whose measure is of both bodies' constants at rest."""
    material = TemperatureDependentElasticity(YOUNG, 0.0, EXPANSION, 40.0, 10.0)
    low, high = block((0, 0, 0), (1, 1, 1), (2, 2, 2)), block((0, 0, 1), (1, 1, 2), (3, 3, 2))
    bodies = {"low": Body(low, material), "high": Body(high, material)}
    supports = [
        Support(body, f"{a}0", tuple(0.0 if a == b else None for b in "xyz")) for body in bodies for a in "xy"
    ]
    walls = [Support("low", "z0", (None, None, 0.0)), Support("high", "z1", (None, None, 0.0))]
    pair = ContactPair(Surface("low", "z1"), Surface("high", "z0"))
    loads = [ThermalStrain(body, 60.0) for body in bodies]
    state = solve_scene(Scene(bodies, [*supports, *walls], loads, [pair]), MPI.COMM_SELF, tolerance=1e-10)
    free = float(material.free_strain(np.array([60.0]))[0])
    np.testing.assert_allclose(state.contact.pressure, 120.0 * free, rtol=1e-6)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"young_modulus": ((20.0, 1.0), (20.0, 2.0))}, "or pairs with ascending temperatures"),
        ({"young_modulus": "steel"}, "young_modulus must be a finite number, or pairs"),
        ({"young_modulus": ((20.0, 1.0), (40.0, -2.0))}, "young_modulus must be a positive number, got -2"),
        ({"poisson_ratio": ((20.0, 0.5),)}, "poisson_ratio must lie between -1 and 0.5"),
        ({"mean_expansion": (1.0, 2.0)}, "mean_expansion must be a finite number, or pairs"),
        ({"initial_temperature": np.inf}, "initial_temperature must be finite, got inf"),
    ],
)
def test_tables_that_are_none_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        TemperatureDependentElasticity(**({"young_modulus": 1.0, "poisson_ratio": 0.3} | given))
