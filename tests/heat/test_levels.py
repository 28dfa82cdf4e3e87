"""Quantities of steady temperatures with their errors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Level, Limits, Surface
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import disc, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    GapConductance,
    HeatFlux,
    HeatOfContact,
    HeatOfHeld,
    HeatProblem,
    HeatScene,
    HeatSource,
    HeldTemperature,
    TemperatureMean,
    ThermalContact,
    heat_goal_error,
    solve_heat,
    solve_heat_to,
)
from fenics_contact.heat.assembly import Rate
from fenics_contact.heat.levels import _Levels
from fenics_contact.mesh import quadratic
from tests.conftest import run_on_ranks
from tests.heat.random_bodies import scene_of

#: ∫ u over the unit square, −Δu = 1 inside and u = 0 around it.
TORSION = 0.03514425


def heated_square(n: int, shape: str, order: int = 1, level: float = 0.0) -> HeatScene:
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (n, n), shape)
    body = ConductingBody(quadratic(mesh) if order == 2 else mesh, Conductor(2.0))
    held = [HeldTemperature("square", side, level) for side in ("x0", "x1", "y0", "y1")]
    return HeatScene({"square": body}, held, [HeatSource("square", 2.0)])


@pytest.mark.parametrize("shape", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("order", [1, 2])
def test_estimates_are_errors_but_for_higher_orders(shape: str, order: int) -> None:
    left, whole = [], []
    for n in (4, 8):
        found = heat_goal_error(
            solve_heat(heated_square(n, shape, order), MPI.COMM_SELF), TemperatureMean("square")
        )
        true = TORSION - found.value
        left.append(abs(true - found.total))
        whole.append(abs(true))
        assert left[-1] < 0.3 * abs(true)
        assert found.mesh == pytest.approx(found.uncancelled, rel=1e-12)
        assert found.geometry == 0.0
        assert abs(found.solver) < 1e-12
    assert left[0] / left[1] > 1.2 * whole[0] / whole[1]


#: Of rings of radii 1, 2, 2.5 and 4 with conductivities 3 and 5, and 0.7 in the gap.
RINGS = 100.0 * 2.0 * np.pi / (np.log(2.0) / 3.0 + np.log(2.5 / 2.0) / 0.7 + np.log(4.0 / 2.5) / 5.0)


def rings(n: int, slave: str = "inner") -> HeatScene:
    bodies = {
        "inner": ConductingBody(disc(2.0, n, hole=1.0), Conductor(3.0)),
        "outer": ConductingBody(disc(4.0, n + 1, hole=2.5), Conductor(5.0)),
    }
    sides = {"inner": Surface("inner", "outer"), "outer": Surface("outer", "inner")}
    master = next(name for name in sides if name != slave)
    held = [HeldTemperature("inner", "inner", 100.0), HeldTemperature("outer", "outer", 0.0)]
    gap = ThermalContact(sides[slave], sides[master], GapConductance(0.7))
    return HeatScene(bodies, held, contacts=[gap])


@pytest.mark.parametrize("slave", ["inner", "outer"])
def test_facets_of_curved_bodies_are_part_of_the_error(slave: str) -> None:
    found = heat_goal_error(solve_heat(rings(8, slave), MPI.COMM_SELF), HeatOfHeld("inner", "inner"))
    true = RINGS - found.value
    assert abs(true - found.total) < 0.04 * abs(true)
    assert abs(found.geometry) > 0.2 * abs(true)
    assert sum(found.by_cell(name).sum() for name in ("inner", "outer")) > abs(found.geometry)


def across_a_film(n: int, width: float, thickness: float = 1.0) -> HeatScene:
    """Return two bodies of quadratic cells with heat that varies along the film between them."""
    shapes = {"lower": ((0.0, 0.0), (1.0, 1.0), (n, n)), "upper": ((0.0, 1.0), (width, 2.0), (n + 1, n))}
    bodies = {
        name: ConductingBody(quadratic(rectangle(*shape)), Conductor(k), thickness=thickness)
        for (name, shape), k in zip(shapes.items(), (2.0, 1.0), strict=True)
    }
    held = [HeldTemperature("lower", "y0", 0.0), HeldTemperature("upper", "x1", 1.0)]
    film = ThermalContact(Surface("lower", "y1"), Surface("upper", "y0"), 8.0)
    return HeatScene(bodies, held, contacts=[film])


@pytest.mark.parametrize(("width", "exact"), [(1.0, -0.902667), (0.73, -0.86995)])  # with 96 cells a side
def test_sums_over_points_of_contact_are_part_of_the_error(width: float, exact: float) -> None:
    cold = HeatOfHeld("lower", "y0")
    rough, thick = (
        heat_goal_error(solve_heat(across_a_film(6, width, t), MPI.COMM_SELF), cold) for t in (1.0, 3.0)
    )
    true = exact - rough.value
    assert abs(true - rough.total) < 0.25 * abs(true)
    assert rough.by_cell("lower").max() > 2.0 * rough.by_cell("upper").max()
    assert rough.uncancelled < 1.6 * abs(rough.total)
    assert [thick.value, thick.total] == pytest.approx([3.0 * rough.value, 3.0 * rough.total], rel=1e-6)


def test_heat_of_rings_to_an_accuracy() -> None:
    for wanted in (1e-2, 1e-3):
        found = solve_heat_to(rings(2), HeatOfHeld("inner", "inner"), wanted, MPI.COMM_SELF)
        assert found.reached
        assert abs(found.value - RINGS) < found.error <= wanted * RINGS
        assert found.state.scene.bodies["inner"].mesh.n_cells > rings(2).bodies["inner"].mesh.n_cells
        assert "were asked for" in str(found)
        assert np.isinf(found.levels[1].error)
    assert len(found.levels) < 7


def test_cells_at_an_edge_that_matters_alone_are_halved() -> None:
    """A corner from which heat comes: cells there are much smaller than others."""
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (6, 3), "triangle")
    middle = mesh.points[mesh.surfaces["y0"]].mean(axis=1)[:, 0] < 1.0
    mesh = replace(mesh, surfaces={**mesh.surfaces, "half": mesh.surfaces["y0"][middle]})
    held = [HeldTemperature("plate", "half", 0.0), HeldTemperature("plate", "y1", 50.0)]
    scene = HeatScene({"plate": ConductingBody(mesh, Conductor(4.0))}, held)
    found = solve_heat_to(scene, HeatOfHeld("plate", "half"), 0.01, MPI.COMM_SELF)
    assert found.reached
    fine = found.state.scene.bodies["plate"].mesh
    sizes = np.ptp(fine.points[fine.cells], axis=1).max(axis=1)
    smallest = fine.points[fine.cells[np.argmin(sizes)]].mean(axis=0)
    assert np.linalg.norm(smallest - (1.0, 0.0)) < 0.1
    assert sizes.max() > 8.0 * sizes.min()


def test_errors_of_temperatures_are_relative_to_their_range() -> None:
    ways = [
        solve_heat_to(
            heated_square(3, "triangle", level=level), TemperatureMean("square"), 0.01, MPI.COMM_SELF
        )
        for level in (0.0, 20.0)
    ]
    first, second = ([level.cells for level in way.levels] for way in ways)
    assert first == second
    assert ways[1].value - ways[0].value == pytest.approx(20.0, rel=1e-9)
    assert ways[1].relative_error == pytest.approx(ways[0].relative_error, rel=1e-6)
    assert abs(ways[0].value - TORSION) < ways[0].error


def test_heat_between_different_temperatures_that_meet_grows_without_limit(
    caplog: pytest.LogCaptureFixture,
) -> None:
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (4, 4))
    hot, cold = (
        HeldTemperature("plate", "y0", 1.0),
        HeldTemperature("plate", "x0", lambda x: 1.0 * (x[:, 1] == 0)),
    )
    scene = HeatScene({"plate": ConductingBody(mesh, Conductor(1.0))}, [hot, cold])
    found = solve_heat_to(scene, HeatOfHeld("plate", "y0"), 0.01, MPI.COMM_SELF)
    assert not found.reached
    assert len(found.levels) < 9
    assert "the value grows without limit" in found.reason
    assert "the accuracy asked for was not reached" in caplog.text


def test_a_value_that_grows_while_its_error_falls_is_no_infinite_one() -> None:
    level = Level(10, 10, 1.0, 0.5, 1, 0.1, 0.1, 1.0, 1.0)
    for left, words in ((0.5, ""), (1.0, "an error of 50 %, and the value grows without limit")):
        way = _Levels(HeatOfContact(0), 0.01, Limits(), MPI.COMM_SELF)
        way.levels = [
            replace(level, unknowns=10 * 2**k, state_value=1.0 + 0.1 * 1.2**k, error=0.5 * left ** (k - 5))
            for k in range(6)
        ]
        way._corrected = [each.value for each in way.levels]
        assert way._hopeless().startswith(words)
        assert bool(way._hopeless()) == bool(words)


def test_powers_between_nodes_are_part_of_the_error() -> None:
    body = ConductingBody(disc(10.0, 3, hole=4.0), Conductor(0.05))
    scene = HeatScene(
        {"ring": body}, [HeldTemperature("ring", "outer", 20.0)], [HeatFlux("ring", "inner", 2.5, total=True)]
    )
    radius = np.linspace(4.0, 10.0, 20001)
    hot = 20.0 + 2.5 / (2.0 * np.pi * 0.05) * np.log(10.0 / radius)
    mean = hot.max() * (np.sum((hot / hot.max()) ** 200 * radius) / np.sum(radius)) ** (1 / 200)
    for over in ("", "inner"):
        exact = mean if not over else hot.max()
        goal = TemperatureMean("ring", over, exponent=200.0)
        rough = heat_goal_error(solve_heat(scene, MPI.COMM_SELF), goal)
        assert abs(exact - rough.value - rough.total) < 0.2 * abs(exact - rough.value)
    found = solve_heat_to(scene, TemperatureMean("ring", exponent=200.0), 0.02, MPI.COMM_SELF)
    assert found.reached
    assert abs(found.value - mean) < 0.1 * found.error


def test_limits_end_the_way() -> None:
    found = solve_heat_to(
        rings(2), HeatOfHeld("inner", "inner"), 1e-6, MPI.COMM_SELF, limits=Limits(levels=2)
    )
    assert (len(found.levels), found.reached) == (2, False)
    assert "as many as limits.levels allows" in found.reason
    one = solve_heat_to(
        rings(2), HeatOfHeld("inner", "inner"), 1e-6, MPI.COMM_SELF, limits=Limits(memory=1e4)
    )
    assert "GB" in one.reason


def test_what_no_estimate_is_made_of() -> None:
    with pytest.raises(InvalidInputError, match="relative_error must lie between 0 and 1"):
        solve_heat_to(rings(2), HeatOfHeld("inner", "inner"), 2.0, MPI.COMM_SELF)
    stored = heated_square(3, "triangle")
    stored = replace(
        stored, bodies={"square": ConductingBody(stored.bodies["square"].mesh, Conductor(2.0, 1.0))}
    )
    problem = HeatProblem(stored, MPI.COMM_SELF)
    still = problem.no_rate
    state = problem.solve(rate=Rate(1.0, still.before, still.history))
    with pytest.raises(InvalidInputError, match="needs a steady state"):
        heat_goal_error(state, TemperatureMean("square"))


@pytest.mark.claim
@pytest.mark.parametrize("seed", range(10, 22))
def test_stated_errors_hold_on_random_scenes(seed: int) -> None:
    scene, goal = scene_of(seed)
    rough = solve_heat_to(scene, goal, 0.01, MPI.COMM_SELF)
    fine = solve_heat_to(scene, goal, 3e-4, MPI.COMM_SELF, limits=Limits(unknowns=30_000))
    assert rough.reached
    assert abs(rough.value - fine.value) < rough.error + fine.error


@pytest.mark.claim
@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_take_the_same_way(ranks: int) -> None:
    alone, together = (json.loads(run_on_ranks(SCRIPT, count, "levels")) for count in (1, ranks))
    assert together[0] == alone[0]
    assert together[1:] == pytest.approx(alone[1:], rel=1e-6)


SCRIPT = Path(__file__).with_name("on_ranks.py")
