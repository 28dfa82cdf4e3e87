"""A balanced state is solved as well as its mesh deserves, and no better."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactProblem,
    Coulomb,
    Scene,
    Support,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.qp import DualProblem, DualSolution, FaceNewton, Start
from fenics_contact.results import BalancedTolerance, SolverErrors
from fenics_contact.results.deformed_state import AnyState
from tests import scenes
from tests.accuracy.algebraic import CASES, measured
from tests.equilibrium import effect_cases
from tests.scenes import SOFT

PAIR = "a body that friction holds"
MODEST = ["a linear block", "a ball on a plane", "Tresca's law", PAIR, "a mortar pair", "two dimensions"]


def solved_anew(name: str, tolerance: float | BalancedTolerance | None = None) -> AnyState:
    scene = CASES[name].make()
    return solve_scene(scene, MPI.COMM_SELF, partitions=CASES[name].cut(scene), tolerance=tolerance)


@cache
def solved(name: str, tolerance: float | BalancedTolerance | None = None) -> AnyState:
    """Return a state that tests only read."""
    return solved_anew(name, tolerance)


def remarks(state: AnyState) -> list[str]:
    """Return what was said of each round."""
    return [step.note for step in state.dual_solution.history if "in energy norm" in step.note]


@pytest.mark.parametrize("name", MODEST)
def test_the_solver_keeps_to_its_share_with_fewer_products_than_a_fixed_tolerance(name: str) -> None:
    state, fixed = solved(name), solved(name, 1e-6)
    errors = state.known_errors
    assert 0.0 < errors.algebraic + errors.friction <= 0.1 * errors.discretisation
    assert state.counts["f_products"] < fixed.counts["f_products"]
    assert remarks(state)
    assert not remarks(fixed)


@pytest.mark.parametrize("name", MODEST)
def test_the_estimate_of_a_loosely_solved_state_is_that_of_the_converged_one(name: str) -> None:
    loose, exact = solved(name, 1e-2).estimate_errors(), solved(name, 1e-8).estimate_errors()
    assert loose.algebraic > 1e3 * exact.algebraic
    assert loose.discretisation == pytest.approx(exact.discretisation, rel=0.02)


@pytest.mark.parametrize("name", [name for name in MODEST if name != "a linear block"])
def test_the_peak_pressure_is_as_good_as_the_mesh_allows(name: str) -> None:
    state, exact = solved(name), solved(name, 1e-8)
    peak, best = state.contact.pressure.max(), exact.contact.pressure.max()
    assert best > 0.0
    assert abs(peak / best - 1.0) < state.known_errors.discretisation


def test_a_smaller_share_is_reached_from_where_the_solver_is() -> None:
    state, plain = solved(PAIR, BalancedTolerance(share=3e-4)), solved(PAIR)
    errors = state.estimate_errors()
    assert 0.0 < errors.algebraic + errors.friction <= 3e-4 * errors.discretisation
    rounds, products = remarks(state), state.counts["f_products"]
    assert len(rounds) == 2
    assert len(remarks(plain)) == 1
    steps = [step.products for step in state.dual_solution.history]
    assert steps == sorted(steps)
    assert steps[-1] <= products < solved(PAIR, 1e-8).counts["f_products"]
    assert state.counts["solver_steps"] == len(steps)
    found = measured(state)
    assert found.whole <= found.bound + found.friction


def test_a_solution_that_the_mesh_holds_is_found_to_the_finest_tolerance() -> None:
    bar = Body(block((0, 0, 0), (3, 1, 1), (6, 2, 2)), SOFT)
    sides = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "z0": (None, None, 0.0)}
    supports = [Support("bar", side, held) for side, held in sides.items()]
    scene = Scene({"bar": bar}, supports, [Traction("bar", "x1", (1.0, 0.0, 0.0))])
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"bar": box_partition(bar.mesh, (3, 1, 1))})
    assert state.estimate_errors().discretisation < 1e-6
    assert state.dual_solution.residuals.within(1e-10)
    stretched = state.gather_displacement("bar")[:, 0]
    assert stretched == pytest.approx(bar.mesh.points[:, 0] / SOFT.young_modulus, abs=1e-9)


def test_errors_found_on_the_way_are_not_found_again() -> None:
    balanced, fixed = solved_anew(PAIR), solved_anew(PAIR, 1e-4)
    for state, more in ((balanced, 0), (fixed, 1)):
        before = state.system.products
        first = state.estimate_errors()
        assert state.system.products == before + more
        assert state.estimate_errors() is first
        assert state.system.products == before + more


def test_a_fixed_tolerance_estimates_nothing() -> None:
    state = solved(PAIR, 1e-3)
    assert state.known_errors is None
    assert "errors" not in state.seconds
    assert "errors" in solved(PAIR).seconds


def test_a_number_beats_the_tolerance_of_the_solver() -> None:
    scene = CASES[PAIR].make()
    cut, comm = CASES[PAIR].cut(scene), MPI.COMM_SELF
    own = solve_scene(scene, comm, partitions=cut, solver=FaceNewton(tolerance=1e-7))
    number = solve_scene(scene, comm, partitions=cut, solver=FaceNewton(tolerance=1e-3), tolerance=1e-7)
    solver, tolerance = FaceNewton(tolerance=1e-7), BalancedTolerance()
    share = solve_scene(scene, comm, partitions=cut, solver=solver, tolerance=tolerance)
    assert own.dual_solution.residuals.within(1e-7)
    assert number.counts["f_products"] == own.counts["f_products"]
    assert share.counts["f_products"] < own.counts["f_products"]


def test_derivatives_have_a_fixed_tolerance() -> None:
    scene = CASES[PAIR].make()
    state = ContactProblem(scene, MPI.COMM_SELF, partitions=CASES[PAIR].cut(scene)).solve(design=True)
    assert state.dual_solution.residuals.within(1e-6)
    assert not remarks(state)


def test_every_load_step_is_balanced() -> None:
    scene = effect_cases.plane()
    steps = effect_cases.there_and_back()
    states = solve_steps(
        ContactProblem(scene, MPI.COMM_SELF, partitions=CASES["two dimensions"].cut(scene)), steps
    )
    fixed = solve_steps(
        ContactProblem(scene, MPI.COMM_SELF, partitions=CASES["two dimensions"].cut(scene), tolerance=1e-6),
        steps,
    )
    for state, exact in zip(states, fixed, strict=True):
        errors = state.known_errors
        assert errors.algebraic + errors.friction <= 0.1 * errors.discretisation
        shear, right = (each.contact.friction_force.sum() for each in (state, exact))
        assert abs(shear - right) < errors.discretisation * np.abs(exact.contact.friction_force).sum()
    assert sum(s.counts["f_products"] for s in states) < sum(s.counts["f_products"] for s in fixed)


def test_a_warm_start_is_balanced_too() -> None:
    scene = CASES[PAIR].make()
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=CASES[PAIR].cut(scene))
    problem.solve()
    heavier = replace(
        scene, loads=[replace(load, value=tuple(1.1 * np.array(load.value))) for load in scene.loads]
    )
    warm, cold = problem.solve(heavier), problem.solve(heavier, start=None)
    assert warm.known_errors.algebraic <= 0.1 * warm.known_errors.discretisation
    assert warm.counts["f_products"] <= cold.counts["f_products"]


@dataclass(frozen=True)
class Limited:
    """Face Newton that gives up where it is asked for less than a limit."""

    limit: float
    tolerance: float = 1e-6

    def with_tolerance(self, tolerance: float) -> Limited:
        return replace(self, tolerance=tolerance)

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        if self.tolerance < self.limit:
            raise ConvergenceError(f"needs {self.tolerance:.1e}", ["the step that failed"])
        return FaceNewton(tolerance=self.tolerance).run(problem, start)


def test_a_solver_that_fails_on_the_way_tells_all_steps() -> None:
    scene = CASES[PAIR].make()
    solver, tolerance = Limited(1e-3), BalancedTolerance(share=1e-9)
    with pytest.raises(ConvergenceError, match="needs") as failure:
        solve_scene(
            scene, MPI.COMM_SELF, partitions=CASES[PAIR].cut(scene), solver=solver, tolerance=tolerance
        )
    *before, last = failure.value.history
    assert "in energy norm" in before[-1].note
    assert last == "the step that failed"


def test_a_good_solution_is_kept_where_the_solver_cannot_reach_a_better_one() -> None:
    scene = CASES[PAIR].make()
    solver, tolerance = Limited(1e-7), BalancedTolerance(share=1e-12, loosest=1e-7)
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions=CASES[PAIR].cut(scene), solver=solver, tolerance=tolerance
    )
    assert "1.0e-10 was not reached, this is accepted" in remarks(state)[-1]
    assert state.dual_solution.residuals.within(1e-7)


def test_a_body_that_is_factored_needs_no_estimate() -> None:
    scene = CASES["a linear block"].make()
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions={"block": np.zeros(scene.bodies["block"].mesh.n_cells, int)}
    )
    assert state.known_errors is None
    assert state.estimate_errors().algebraic < 1e-12 < state.estimate_errors().discretisation


def test_errors_can_be_read_and_add_up() -> None:
    errors = solved(PAIR).estimate_errors()
    lines = str(errors).splitlines()
    assert [line.split()[0] for line in lines] == ["algebraic", "friction", "discretisation", "geometry"]
    assert all("%" in line for line in lines)
    assert errors.discretisation == pytest.approx(np.linalg.norm(list(errors.by_body.values())))
    cells = np.concatenate([errors.by_cell(body) for body in errors.by_body])
    assert errors.discretisation == pytest.approx(np.linalg.norm(cells))
    assert cells.min() > 0.0


def test_the_next_tolerance_follows_the_ratio_within_limits() -> None:
    balanced = BalancedTolerance(share=0.1, finest=1e-9)
    assert balanced.satisfied(SolverErrors(0.01, 0.0), 0.1)
    assert not balanced.satisfied(SolverErrors(0.01, 0.001), 0.1)
    assert balanced.tightened(1e-2, SolverErrors(0.1, 0.0), 0.1) == pytest.approx(0.5 * 0.1 * 1e-2)
    assert balanced.tightened(1e-2, SolverErrors(0.0101, 0.0), 0.1) == pytest.approx(0.3 * 1e-2)
    assert balanced.tightened(1e-2, SolverErrors(1.0, 0.0), 1e-5) == pytest.approx(1e-4 * 1e-2)
    assert balanced.tightened(1e-2, SolverErrors(1.0, 0.0), 0.0) == 1e-9
    assert balanced.tightened(1e-2, SolverErrors(np.inf, 0.0), 0.1) == pytest.approx(1e-4 * 1e-2)


@pytest.mark.parametrize("tolerance", [0.0, -1e-6, 1.0, 3, float("nan")])
def test_a_tolerance_lies_between_zero_and_one(tolerance: float) -> None:
    with pytest.raises(InvalidInputError, match="tolerance must lie between 0 and 1, got"):
        solved(PAIR, tolerance)


def test_a_tolerance_is_a_number_or_balanced() -> None:
    scene = scenes.block_on_plane(Coulomb(0.6))
    with pytest.raises(InvalidInputError, match=r"a number, BalancedTolerance\(...\) or None, got str"):
        solve_scene(scene, MPI.COMM_SELF, tolerance="balanced")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong", [{"share": 0.0}, {"loosest": 1.0}, {"finest": 0.1}, {"finest": 0.0}, {"rounds": 0}]
)
def test_a_balance_needs_sensible_numbers(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError, match="BalancedTolerance needs share > 0"):
        BalancedTolerance(**wrong)  # type: ignore[arg-type]
