"""Optimisations reach known optima, with and without constraints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    minimize,
)
from fenics_contact._optimize.result import StepKind
from fenics_contact.design import (
    AdaptiveTolerance,
    BundleTrust,
    ContactForces,
    LargestStress,
    LinearConstraints,
    NonlinearConstraint,
    Objective,
    Result,
    StrainEnergy,
    TotalPotential,
)
from fenics_contact.design.base import DesignFunction
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStress
from fenics_contact.output import read_result, write_optimisation_result
from fenics_contact.qp import FaceNewton
from tests.design.blocks import block_on_floor, designs_of
from tests.design.chains import chain_problem
from tests.design.constrained_blocks import BOUND, largest_force, posed
from tests.design.constrained_blocks import FORCE as CONSTRAINED_FORCE
from tests.design.constrained_blocks import minimised as minimised_constrained
from tests.design.objectives import normal_forces
from tests.scenes import partitions

METHOD = BundleTrust(max_evaluations=15)


def block() -> ShapeProblem:
    """A block whose contact forces are to be evened out."""
    scene = block_on_floor(Coulomb(0.3), load=(0.35, 0.1, -2.0))
    judge = ContactForces(normal_forces)
    solver = FaceNewton(tolerance=1e-9)
    return ShapeProblem(
        ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=solver),
        designs_of(scene),
        judge,
    )


def chain() -> ShapeProblem:
    """Two crowns whose total potential energy is to fall."""
    problem = chain_problem(Coulomb(0.3))
    problem.objective = TotalPotential()
    return problem


@dataclass(frozen=True)
class Case:
    build: Callable[[], ShapeProblem]
    bound: float
    #: Value at the end in terms of the size of the first, at most.
    reached: float


CASES = {"block": Case(block, 0.02, 0.87), "chain": Case(chain, 0.2, -1.2)}


@cache
def minimised(name: str) -> tuple[ShapeProblem, Result]:
    """Minimise within a box, with the volume kept to first order."""
    case = CASES[name]
    problem = case.build()
    start = np.zeros(problem.size)
    _, by_volume = problem.volume(start)
    result = minimize(
        problem,
        start,
        METHOD,
        bounds=(np.full(problem.size, -case.bound), np.full(problem.size, case.bound)),
        constraints=LinearConstraints(np.zeros((0, problem.size)), np.zeros(0), by_volume[None], np.zeros(1)),
    )
    return problem, result


@pytest.mark.parametrize("name", CASES)
def test_the_objective_falls(name: str) -> None:
    problem, result = minimised(name)
    first = result.history[0].value
    assert result.reason.success
    assert result.iterations > 1
    assert result.value < CASES[name].reached * abs(first)
    assert result.value < first
    assert problem.best is not None
    assert result.value == problem.best.value
    assert np.array_equal(result.x, problem.best.alpha)


@pytest.mark.parametrize("name", CASES)
def test_bounds_are_kept_and_some_are_met(name: str) -> None:
    _, result = minimised(name)
    assert np.abs(result.x).max() == pytest.approx(CASES[name].bound, rel=1e-6)
    assert np.abs(result.x).max() <= CASES[name].bound


@pytest.mark.parametrize("name", CASES)
def test_the_volume_is_kept_to_first_order(name: str) -> None:
    problem, result = minimised(name)
    before, by_volume = problem.volume(np.zeros(problem.size))
    after, _ = problem.volume(result.x)
    moved = np.abs(by_volume) @ np.abs(result.x)
    assert moved > 1e-3 * before
    assert abs(by_volume @ result.x) < 1e-8 * moved
    # What is left is of second order.
    assert abs(after - before) < 1e-2 * moved


def test_the_answer_is_that_of_a_cold_start() -> None:
    _, result = minimised("block")
    value, gradient = block()(result.x)
    assert value == pytest.approx(result.value, rel=1e-7)
    assert gradient == pytest.approx(result.subgradient, rel=1e-4, abs=1e-4 * np.abs(gradient).max())


def test_designs_that_invert_cells_are_stepped_back_from() -> None:
    problem = block()
    problem.objective = TotalPotential()
    start = np.zeros(problem.size)
    bounds = (start - 3.0, start + 3.0)
    method = BundleTrust(max_evaluations=8, raise_on_failure=False)
    result = minimize(problem, start, method, bounds=bounds)
    kinds = [record.kind for record in result.history]
    assert StepKind.REJECTED in kinds
    assert StepKind.SERIOUS in kinds
    assert result.value < result.history[0].value
    assert problem.scene_of(result.x).bodies["block"].mesh.volume > 0.0


@pytest.mark.parametrize("name", CASES)
def test_a_warm_start_costs_fewer_products_than_a_cold_one(name: str) -> None:
    rng = np.random.default_rng(1)
    warm, cold = CASES[name].build(), CASES[name].build()
    first = 0.05 * CASES[name].bound * rng.standard_normal(warm.size)
    second = first + 0.01 * CASES[name].bound * rng.standard_normal(warm.size)
    warm.state_of(first)
    cheap, dear = warm.state_of(second), cold.state_of(second)
    assert 0 < cheap.solution.products < dear.solution.products
    assert cheap.energies.total_potential == pytest.approx(dear.energies.total_potential, rel=1e-8)
    assert np.array_equal(cheap.contact.status, dear.contact.status)


# Designs under nonlinear constraints whose optimum is known: a column under a force, of even width.
WIDTH, HEIGHT, FORCE, YOUNG = 1.0, 2.0, 3.0, 1000.0
STRESS = LargestStress("column", p=12.0)
NET = 4


def column(objective: Objective) -> ShapeProblem:
    """Half of a column on a smooth floor; the design moves its side, which may taper and bulge.

    By Jensen's inequality no other width of the same area has less of a norm of the stress, or of the strain
    energy, than an even one, in which stress is even, too.
    """
    mesh = rectangle((0.0, 0.0), (WIDTH, HEIGHT), (6, 10))
    scene = Scene(
        {"column": Body(mesh, PlaneStress(YOUNG, 0.3))},
        [Support("column", "x0", (0.0, None))],
        [TotalForce("column", "y1", (0.0, -FORCE))],
        [ContactPair(Surface("column", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)))],
    )
    # Floor and loaded edge stay straight: only nodes of the side move on the boundary.
    side = SurfaceDesign("column", "x1", net=NET, transition=0.01)
    return ShapeProblem(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10), side, objective)


def waisted() -> np.ndarray:
    """A start that is far from even."""
    return np.array([0.02, -0.05, 0.03, -0.02])


BOX = (-0.1, 0.1)


def lightest(share: float, start: np.ndarray, **more: bool) -> tuple[ShapeProblem, Result]:
    """Minimise the area under a limit of the stress, as a multiple of that of the reference shape."""
    problem = column(STRESS)
    limit = NonlinearConstraint(problem.function(STRESS, "stress"), share * FORCE / WIDTH, name="stress")
    method = BundleTrust(tolerance=1e-6)
    return problem, minimize(problem.volume, start, method, bounds=BOX, constraints=limit, **more)


@pytest.mark.parametrize(
    ("share", "start", "restored"), [(1.05, np.zeros(NET), False), (0.95, waisted(), True)]
)
def test_the_lightest_column_bears_the_stress_allowed_everywhere(
    share: float, start: np.ndarray, restored: bool
) -> None:
    problem, result = lightest(share, start, restore=restored)
    assert result.reason.success
    (stress,) = result.constraints
    assert stress.active
    assert stress.value == pytest.approx(share * FORCE / WIDTH, rel=1e-6)
    assert result.value == pytest.approx(WIDTH * HEIGHT / share, rel=1e-5)
    assert result.x == pytest.approx(WIDTH / share - WIDTH, abs=2e-3)
    assert STRESS.largest(problem.state_of(result.x)) == pytest.approx(share * FORCE / WIDTH, rel=3e-3)
    # The price: area = force · height / stress.
    assert stress.multiplier == pytest.approx(HEIGHT * WIDTH**2 / (FORCE * share**2), rel=1e-2)


@pytest.mark.parametrize(
    ("objective", "least"),
    [
        (STRESS, lambda area: FORCE * HEIGHT / area),
        (StrainEnergy(), lambda area: FORCE**2 * HEIGHT**2 / (2.0 * YOUNG * area)),
    ],
    ids=["stress", "strain energy"],
)
def test_the_best_column_of_a_given_area_is_even(
    objective: Objective, least: Callable[[float], float]
) -> None:
    problem, area = column(objective), 1.03 * WIDTH * HEIGHT
    keep = NonlinearConstraint(problem.volume, area, area, name="area")
    method = BundleTrust(tolerance=1e-6)
    result = minimize(problem, waisted(), method, bounds=BOX, constraints=keep, restore=True)
    assert result.reason.success
    assert problem.volume(result.x)[0] == pytest.approx(area, rel=1e-6)
    assert result.value == pytest.approx(least(area), rel=1e-5)
    assert result.x == pytest.approx(area / HEIGHT - WIDTH, abs=2e-3)
    assert problem.value_of(waisted()) > 1.01 * least(area)


# Designs under nonlinear constraints: the volume itself and a bound on a contact force.
VOLUMES: list[float] = []


@cache
def solved() -> tuple[ShapeProblem, DesignFunction, Result]:
    """The minimum; the volumes of all designs on the way are noted."""
    problem = posed()
    return problem, *minimised_constrained(
        problem, callback=lambda record, x: VOLUMES.append(problem.volume(x)[0])
    )


def test_a_function_has_the_value_and_gradient_of_a_problem_with_that_objective() -> None:
    problem, alone = posed(), posed()
    alone.objective = ContactForces(normal_forces)
    alpha = 0.005 * np.random.default_rng(1).standard_normal(problem.size)
    function = problem.function(ContactForces(normal_forces))
    problem(alpha)
    value, gradient = function(alpha)
    wanted, by_design = alone(alpha)
    assert value == pytest.approx(wanted, rel=1e-7)
    assert gradient == pytest.approx(by_design, rel=1e-5, abs=1e-5 * np.abs(by_design).max())
    assert np.abs(gradient).max() > 0.0
    assert problem.objective == TotalPotential()


def test_a_function_costs_one_adjoint_at_a_design_that_is_known() -> None:
    problem = posed()
    alpha = np.full(problem.size, 0.004)
    function = problem.function(ContactForces(normal_forces), "forces")
    problem(alpha)
    whole, states = problem.products, problem.seconds
    state = problem.last.state if problem.last else None
    assert state is not None
    function(alpha)
    spent = problem.products - whole
    assert 0 < spent < 0.7 * whole
    assert problem.evaluations == 1
    function(alpha)
    assert problem.products == whole + spent, "the same design is not differentiated twice"
    assert problem.last is not None
    assert problem.last.state is state
    assert states["adjoint"] > 0.0
    unknown = np.full(problem.size, 0.006)
    assert function(unknown)[0] != function(alpha)[0]
    assert problem.products > whole + 2 * spent
    assert "forces" in repr(function)


def test_products_count_each_state_and_adjoint_once() -> None:
    problem = posed()
    state = problem.state_of(np.zeros(problem.size))
    alone = problem.products
    assert alone == state.dual.products > 0
    point = problem.evaluate(np.full(problem.size, 0.004))
    assert problem.products == alone + point.state.dual.products
    assert 0 < point.adjoint_iterations < point.state.dual.products


def test_the_volume_is_kept_and_the_force_meets_its_limit() -> None:
    problem, force, result = solved()
    assert result.reason.success
    assert problem.volume(result.x)[0] == pytest.approx(problem.volume(np.zeros(problem.size))[0], rel=1e-6)
    volume, bound = result.constraints
    assert (volume.active, bound.active) == (True, True)
    assert force(result.x)[0] <= bound.upper * (1 + 1e-6)
    assert bound.value == pytest.approx(bound.upper, rel=1e-4)
    assert bound.multiplier > 0.0
    assert 3 < result.evaluations <= 60
    assert np.abs(result.x).max() <= BOUND


def test_the_multiplier_of_the_force_is_the_price_of_its_limit() -> None:
    _, _, result = solved()
    _, other = minimised_constrained(posed(), share=CONSTRAINED_FORCE + 0.01)
    raised = other.constraints[1].upper - result.constraints[1].upper
    price = np.mean([one.constraints[1].multiplier for one in (result, other)])
    assert other.value - result.value == pytest.approx(-price * raised, rel=0.2)
    assert other.value < result.value


def test_every_design_that_is_solved_has_the_volume() -> None:
    solved()
    assert len(VOLUMES) > 3
    assert pytest.approx([VOLUMES[0]] * len(VOLUMES), rel=1e-6) == VOLUMES


def test_states_as_accurate_as_needed_lead_to_the_same_design() -> None:
    _, _, exact = solved()
    problem = posed(AdaptiveTolerance())
    _, result = minimised_constrained(problem)
    assert result.reason.success
    assert result.value == pytest.approx(exact.value, rel=3e-4)
    assert result.violation <= 1e-5
    assert {record.error > 0.0 for record in result.history} == {True}


def test_the_file_of_a_result_has_the_design_that_meets_the_constraints(tmp_path: Path) -> None:
    problem, _, result = solved()
    problem(np.full(problem.size, BOUND))  # lower, and neither has the volume
    assert problem.best is not None
    assert problem.best.value < result.value
    told = read_result(write_optimisation_result(result, problem, tmp_path))["optimisation"]
    assert told["objective"]["final"] == pytest.approx(result.value, rel=1e-7)
    assert [one["name"] for one in told["constraints"]] == ["volume", "force"]
    assert told["constraints"][1]["lower"] is None
    assert told["constraints"][1]["multiplier"] == result.constraints[1].multiplier
    assert told["history"]["violation"][-1] == result.history[-1].violation


@pytest.mark.parametrize("ranks", [2, 4])
def test_several_ranks_take_the_same_steps(ranks: int, mpirun: Callable[..., str]) -> None:
    script = Path(__file__).with_name("constrained_blocks.py")
    _, _, whole = solved()
    alike, evaluations, value, *x = (float(word) for word in mpirun(script, ranks).split())
    assert (alike, evaluations) == (1, whole.evaluations)
    assert value == pytest.approx(whole.value, rel=1e-7)
    assert x == pytest.approx(whole.x.tolist(), abs=1e-6)


def test_a_run_in_pieces_ends_at_the_same_design(tmp_path: Path) -> None:
    _, _, whole = solved()
    checkpoint = Checkpoint(tmp_path / "run.npz")
    _, first = minimised_constrained(
        posed(), checkpoint=checkpoint, method={"max_evaluations": 3, "raise_on_failure": False}
    )
    assert not first.reason.success
    _, result = minimised_constrained(posed(), checkpoint=checkpoint)
    assert result.evaluations == whole.evaluations
    assert result.x == pytest.approx(whole.x, abs=1e-9)


def test_a_start_with_too_large_a_force_is_an_error_that_says_by_how_much() -> None:
    problem = posed()
    start = np.zeros(problem.size)
    force = problem.function(ContactForces(largest_force), "largest force")
    value = force(start)[0]
    limit = NonlinearConstraint(force, CONSTRAINED_FORCE * value, name="force")
    with pytest.raises(InvalidInputError, match=rf"but force is {value:.6g}, limits \[-inf, .*restore=True"):
        minimize(problem, start, bounds=(start - BOUND, start + BOUND), constraints=limit)
