"""Temperatures that films and time steps hardly hold: against a direct solution, and the balance of heat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI
from scipy.sparse.linalg import splu

from fenics_contact.heat import Convection, HeatProblem, HeatState
from fenics_contact.heat.assembly import Rate
from tests.heat.bodies import Cut, boxes


def filmed(coefficient: float, *, held: bool = False) -> Cut:
    """Return a body of eight subdomains with films, where it is held on all sides but one."""
    scene, cut = boxes(2, 2, 2, held=held)
    sides = [name for name in scene.bodies["body"].mesh.surfaces if not (held and name == "x0")]
    films = [Convection("body", name, coefficient, lambda x: np.cos(x[:, 0])) for name in sides]
    return replace(scene, loads=[*scene.loads, *films]), cut


def problem(given: Cut, step: float) -> tuple[HeatProblem, Rate]:
    """Return a problem and the rate of a time step."""
    made = HeatProblem(given[0], MPI.COMM_SELF, partitions=given[1])
    before = np.sin(given[0].bodies["body"].mesh.points[:, 0])
    return made, Rate(1.0 / step, before, made.no_rate.history)


def solved(given: Cut, step: float) -> HeatState:
    """Return the state of all subdomains."""
    made, rate = problem(given, step)
    return made.solve(rate=rate)


def direct(given: Cut, step: float) -> np.ndarray:
    """Return the temperatures by a factor of the whole, refined with residuals that no mean rounds."""
    made, rate = problem((given[0], {"body": np.zeros_like(given[1]["body"])}), step)
    (assembly,) = made._assemblies
    size = len(rate.before)
    heated = assembly.heated(given[0], np.zeros(size), rate, 0, np.zeros(size))
    nodes = assembly.part.mesh.nodes
    conduction = assembly._conduction
    bed = sum((each.matrix for each in heated.exchanges.values()), heated.stored.matrix)
    load = heated.subdomain.load
    held = [each.surface for each in given[0].held]
    mesh = given[0].bodies["body"].mesh
    free = ~np.isin(nodes, np.concatenate([np.zeros(0, int), *map(mesh.nodes_of, held)]))
    factor, found = splu(sp.csc_matrix((conduction + bed)[free][:, free])), np.zeros(size)
    for _ in range(6):
        left = load - conduction @ (found - found.mean()) - bed @ found
        found[free] += factor.solve(left[free])
    values = np.empty(size)
    values[nodes] = found
    return values


@pytest.mark.parametrize(
    ("given", "step"),
    [(filmed(h), np.inf) for h in (1e-6, 1e6)]
    + [(filmed(h, held=True), np.inf) for h in (1e-6, 1e6)]
    + [(boxes(2, 2, 2), step) for step in (1e-6, 1e3, 1e6)],
    ids=lambda value: f"{value:g}" if isinstance(value, float) else "body",
)
def test_temperatures_are_those_of_a_direct_solution(given: Cut, step: float):
    state, exact = solved(given, step), direct(given, step)
    assert np.abs(state.values - exact).max() <= 1e-9 * np.ptp(exact)


@pytest.mark.parametrize("coefficient", [1e-6, 1e-3, 1e3])
def test_what_weak_films_take_is_the_heat_that_is_given(coefficient: float):
    assert solved(filmed(coefficient), np.inf).balance.error < 1e-12


@pytest.mark.parametrize("step", [1e3, 1e6])
def test_what_is_stored_in_long_steps_is_the_heat_that_is_given(step: float):
    assert solved(boxes(2, 2, 2), step).balance.error < 1e-12
