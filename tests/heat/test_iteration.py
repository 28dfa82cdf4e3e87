"""The iteration of laws that depend on temperatures: few systems, few products, never below absolute zero."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Surface, box_partition
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    GapRadiation,
    HeatFlux,
    HeatProblem,
    HeatScene,
    HeatState,
    HeldTemperature,
    Radiation,
    TemperatureTable,
    ThermalContact,
    solve_heat,
)

GLOWING = Radiation("up", "x0", 0.8, 300.0)


def slow(*values: object) -> object:
    """Return values of a case that runs with the slow tests."""
    return pytest.param(*values, marks=pytest.mark.slow)


def rising(temperature: np.ndarray) -> np.ndarray:
    """Return a conductivity that grows a hundredfold from 300 to 1500 K."""
    return np.asarray(100.0 ** ((temperature - 300.0) / 1200.0))


Held = tuple[float, ...]


def blocks(conductor: Conductor, law: object, *loads: object, held: Held = (300.0, 1500.0)) -> HeatState:
    """Return the state of two blocks, the upper one of 8 subdomains and loaded, the lower one held below."""
    low, up = (block((0, 0, z), (1, 1, z + 1), (4, 4, 4)) for z in (0.0, 1.1))
    bodies = {"low": ConductingBody(low, conductor), "up": ConductingBody(up, conductor)}
    at = zip((("low", "z0"), ("up", "z1")), held, strict=False)
    contact = ThermalContact(Surface("up", "z0"), Surface("low", "z1"), law)  # type: ignore[arg-type]
    scene = HeatScene(
        bodies,
        [HeldTemperature(*place, value) for place, value in at],
        loads,
        contacts=[contact],  # type: ignore[arg-type]
    )
    cut = {"low": box_partition(low, (1, 1, 2)), "up": box_partition(up, (2, 2, 2))}
    return solve_heat(scene, MPI.COMM_SELF, partitions=cut)


@pytest.mark.parametrize(
    ("state", "systems", "products"),
    [
        (lambda: blocks(Conductor(50.0), 100.0, GLOWING), 10, 75),
        slow(lambda: blocks(Conductor(50.0), GapRadiation(0.8, 0.8), GLOWING), 12, 95),
        slow(lambda: blocks(Conductor(rising), 50.0), 14, 82),
        slow(lambda: blocks(Conductor(TemperatureTable((300.0, 1500.0), (100.0, 1.0))), 50.0), 12, 76),
        slow(lambda: blocks(Conductor(rising), GapRadiation(0.8, 0.8), GLOWING), 17, 160),
    ],
    ids=["radiation", "across a gap", "rising", "falling", "all"],
)
def test_laws_take_few_systems_and_few_products(state: object, systems: int, products: int):
    found = state()  # type: ignore[operator]
    assert found.iterations <= systems
    assert found.products <= products  # a system to the last digit takes 12 to 20
    assert found.balance.error < 1e-12


def test_a_film_by_temperature_has_newtons_steps():
    # With h alone as the slope: 12 systems.
    film = Convection("up", "x0", TemperatureTable((0.0, 3000.0), (1.0, 300.0)), 300.0)
    assert blocks(Conductor(50.0), 50.0, film).iterations <= 8


@pytest.mark.parametrize(
    ("loads", "held"),
    [
        ((HeatFlux("up", "z1", 2e5), GLOWING), (300.0,)),
        slow((Radiation("up", "z1", 1.0, 3000.0),), (4.0,)),
    ],
)
def test_radiation_far_from_the_start_stays_above_absolute_zero(
    loads: tuple[object, ...], held: tuple[float]
):
    state = blocks(Conductor(20.0), 100.0, *loads, held=held)
    assert state.values.min() > 0.0
    assert state.iterations <= 16
    assert state.balance.error < 1e-12


@pytest.mark.claim
def test_a_conductivity_that_grows_a_hundredfold_has_kirchhoffs_flux():
    mesh = rectangle((0.0, 0.0), (1.0, 0.1), (200, 2))
    held = [HeldTemperature("bar", "x0", 300.0), HeldTemperature("bar", "x1", 1500.0)]
    scene = HeatScene({"bar": ConductingBody(mesh, Conductor(rising), thickness=10.0)}, held)
    heat = [*solve_heat(scene, MPI.COMM_SELF).balance.by_part.values()]
    assert heat[1] == pytest.approx(99.0 * 1200.0 / np.log(100.0), rel=3e-4)


def test_a_film_of_other_temperatures_is_never_taken_for_one_that_was_freed():
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (4, 4))
    scene = HeatScene({"up": ConductingBody(mesh, Conductor(1.0))}, [], [GLOWING])
    problem = HeatProblem(scene, MPI.COMM_SELF)
    rate = problem.no_rate
    (assembly,) = problem._assemblies
    for temperature in np.linspace(300.0, 900.0, 30):
        values = np.full(mesh.n_nodes, temperature)
        total = assembly.heated(scene, values, rate, 0, np.zeros(mesh.n_nodes)).subdomain.stiffness.sum()
        slope = 4.0 * 0.8 * GLOWING.constant * temperature**3
        assert total == pytest.approx(slope, rel=1e-6)
