"""Load steps, resumed ones and warm starts."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    Coulomb,
    FixedPoint,
    LoadSequence,
    LoadStep,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TotalForce,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from fenics_contact.results.deformed_state import AnyState
from tests.conftest import run_on_ranks
from tests.equilibrium.checks import assert_solved
from tests.equilibrium.friction_steps import FRICTION, coulomb_reference, sheared_block
from tests.equilibrium.step_cases import PATH as RESUMED_PATH
from tests.equilibrium.step_cases import collect, sequence
from tests.equilibrium.step_cases import shears as resumed_shears
from tests.scenes import block_on_plane, crowned, partitions, two_blocks

TOLERANCE = 1e-9
#: Pressed, sheared until all slips, let go, sheared the other way, let go, sheared again.
PATH = (0.0, 0.006, 0.02, 0.008, 0.0, -0.02, -0.004, 0.0, 0.012, 0.02)


def shears(path: tuple[float, ...]) -> list[LoadStep]:
    """Top face pressed by a hundredth and shifted along x."""
    return [LoadStep(f"shift {s:g}", supports=[Support("block", "z1", (s, 0.0, -0.01))]) for s in path]


def solved(law: Coulomb | Tresca, path: tuple[float, ...] = PATH) -> tuple[AnyState, ...]:
    scene = sheared_block(law)
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    return solve_steps(
        ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE)),
        shears(path),
    )


def shear_force(state: AnyState) -> float:
    return float(state.contact.force[:, 0].sum())


@pytest.fixture(scope="module")
def loop() -> tuple[AnyState, ...]:
    return solved(Coulomb(FRICTION))


def test_the_hysteresis_loop_is_that_of_an_independent_solver(loop: tuple[AnyState, ...]) -> None:
    before, scene = None, sheared_block(Coulomb(FRICTION))
    largest = max(abs(shear_force(state)) for state in loop)
    for step, state in zip(shears(PATH), loop, strict=True):
        before, force = coulomb_reference(step.applied_to(scene), before)
        assert shear_force(state) == pytest.approx(force[:, 0].sum(), abs=1e-6 * largest)
        np.testing.assert_allclose(state.contact.force, force, rtol=0, atol=1e-5 * np.abs(force).max())
        np.testing.assert_allclose(
            state.gather_displacement("block"), before, rtol=0, atol=1e-6 * np.abs(before).max()
        )


def test_the_loop_has_sticking_slipping_and_reversed_steps(loop: tuple[AnyState, ...]) -> None:
    forces = np.array([shear_force(state) for state in loop])
    assert forces.max() > 0.9 * np.ptp(forces) / 2
    assert forces.min() < -0.9 * np.ptp(forces) / 2
    assert {state.contact.count(Status.SLIP) for state in loop} >= {24}, "some step slips everywhere"
    assert max(state.contact.count(Status.STICK) for state in loop) > 16
    pressed = np.array([state.contact.normal_force.sum() for state in loop])
    sliding = np.array([state.contact.count(Status.STICK) == 0 for state in loop])
    np.testing.assert_allclose(np.abs(forces[sliding]), FRICTION * pressed[sliding], rtol=1e-2)


def test_unloading_does_not_return_to_the_start(loop: tuple[AnyState, ...]) -> None:
    start, back = loop[0], loop[4]
    assert PATH[0] == PATH[4] == 0.0
    assert abs(shear_force(back)) > 0.5 * abs(shear_force(loop[2]))
    assert abs(shear_force(start)) < 1e-6 * abs(shear_force(back))


def test_total_slip_adds_up_over_the_steps(loop: tuple[AnyState, ...]) -> None:
    total = sum(state.contact.slip for state in loop)
    np.testing.assert_allclose(loop[-1].contact.total_slip, total, atol=1e-9)
    assert np.abs(total).max() > 0.001


def test_a_single_step_is_the_scene_at_once() -> None:
    (state,) = solved(Coulomb(FRICTION), (0.008,))
    scene = shears((0.008,))[0].applied_to(sheared_block(Coulomb(FRICTION)))
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    once = solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE))
    np.testing.assert_allclose(state.contact.force, once.contact.force, atol=1e-12)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-9])
def test_what_sticks_has_not_slipped_and_is_let_go_without_any_force(tolerance: float) -> None:
    """Errors of the solver are no slip: the next load step would have forces that are nothing but these."""
    blocks = {"low": block((0.0,) * 3, (2.0, 2.0, 1.0), (3, 3, 1)),
              "up": block((0.0, 0.0, 1.0), (2.0, 2.0, 1.8), (2, 2, 1))}  # fmt: skip
    pair = ContactPair(Surface("up", "z0"), Surface("low", "z1"), Tresca(0.05), "node")
    bodies = {name: Body(mesh, IsotropicElasticity(1.0, 0.3)) for name, mesh in blocks.items()}
    scene = Scene(bodies, [Support("low", "z0")], contacts=[pair])
    press = TotalForce("up", "z1", (0.001, 0.0, -0.02))
    loads = {"pressed": [press], "let go": [], "still": [], "pressed again": [press]}
    steps = [LoadStep(name, each) for name, each in loads.items()]
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=tolerance)
    pressed, *after, again = solve_steps(problem, steps)
    assert pressed.contact.count(Status.STICK) == pressed.contact.points.count
    assert np.abs(pressed.contact.slip).max() > 0.0
    for state in after:
        assert not state.contact.force.any()
        assert max(np.abs(state.gather_displacement(name)).max() for name in bodies) < 1e-13
    assert not again.contact.slip_before.any()


def test_without_a_reversal_the_number_of_steps_matters_little_with_tresca() -> None:
    """A bound that does not depend on the pressure and a path without reversal: the end is the same."""
    once, many = (solved(Tresca(2.0), path)[-1] for path in ((0.02,), (0.004, 0.008, 0.012, 0.016, 0.02)))
    assert once.contact.count(Status.SLIP) == 24
    # Not quite the same: on the way the corners slip in other directions.
    assert shear_force(many) == pytest.approx(shear_force(once), rel=5e-3)


def test_the_energy_balance_of_every_step_closes(loop: tuple[AnyState, ...]) -> None:
    for state in loop:
        assert state.energies.primal == pytest.approx(state.energies.dual, rel=1e-7, abs=1e-9)
        assert state.energies.friction >= 0.0
    assert loop[2].energies.friction > 1e-3


def test_later_steps_factor_and_search_nothing_again(loop: tuple[AnyState, ...]) -> None:
    first, *others = loop
    for state in others:
        assert state.dual.inverse.factored == 0
        assert state.torn.B is first.torn.B
        assert state.torn.points is first.torn.points
        assert state.dual.problem.preconditioner is first.dual.problem.preconditioner


def test_loads_may_come_and_go() -> None:
    scene = replace(sheared_block(Coulomb(0.5)), supports=[])
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    weight, push = Traction("block", "z1", (0.0, 0.0, -4.0)), Traction("block", "x0", (3.0, 0.0, 0.0))
    sequence = LoadSequence(
        ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE))
    )
    pressed = sequence.advance(LoadStep("press", loads=[weight]))
    pushed = sequence.advance(LoadStep("push", loads=[weight, push]))
    released = sequence.advance(LoadStep("release", loads=[weight]))
    assert sequence.state is released
    assert shear_force(pressed) == pytest.approx(0.0, abs=1e-7)
    assert shear_force(pushed) == pytest.approx(-3.0, rel=1e-7), "a unit face is pushed"
    assert shear_force(released) == pytest.approx(0.0, abs=1e-7)
    left = np.linalg.norm(released.contact.friction_force, axis=1).sum()
    start = np.linalg.norm(pressed.contact.friction_force, axis=1).sum()
    assert left != pytest.approx(start, rel=1e-3), "the push leaves locked friction behind"


def test_steps_must_be_load_steps() -> None:
    problem = ContactProblem(sheared_block(Coulomb(0.3)), MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match=r"each load step must be a LoadStep, got 'press': write"):
        solve_steps(problem, ["press"])  # type: ignore[list-item]
    with pytest.raises(InvalidInputError, match=r"steps must be a sequence, got LoadStep: write \[step\]"):
        solve_steps(problem, LoadStep("press"))  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match=r"each load step must be a LoadStep, got 3: write"):
        LoadSequence(problem).advance(3)  # type: ignore[arg-type]
    with pytest.raises(
        InvalidInputError, match=r"time of LoadStep 'a' must be a finite number or None, got nan"
    ):
        LoadStep("a", time=float("nan"))


# An interrupted load history goes on from the last step that was done.
DONE = 4


@cache
def whole() -> dict[str, Any]:
    history = sequence(None, MPI.COMM_SELF)
    states = [history.advance(step) for step in resumed_shears()]
    assert {int(s) for state in states for s in state.contact.status} >= {Status.STICK, Status.SLIP}
    return {
        "forces": np.array([state.contact.force for state in states]),
        "slip": np.array([state.contact.total_slip for state in states]),
        "last slip": np.array([state.contact.slip for state in states]),
        "products": [state.solution.products for state in states],
    }


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stored") / "steps.npz"
    history = sequence(Checkpoint(path), MPI.COMM_SELF)
    for step in resumed_shears()[:DONE]:
        history.advance(step)
    return path


@pytest.fixture
def interrupted(stored: Path, tmp_path: Path) -> Path:
    """The checkpoint of a run that ended after some steps."""
    return Path(shutil.copy(stored, tmp_path))


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_history_goes_on_with_the_same_forces_and_slips(ranks: int, interrupted: Path) -> None:
    if ranks == 1:
        found = collect(interrupted, MPI.COMM_SELF)
    else:
        script = Path(__file__).with_name("step_cases.py")
        found = json.loads(run_on_ranks(script, ranks, interrupted))
    assert found["ranks"] == ranks
    assert found["products"][:DONE] == [1] * DONE
    assert min(whole()["products"][:DONE]) > 1
    for name in ("forces", "slip", "last slip"):
        expected = whole()[name]
        assert np.abs(np.array(found[name]) - expected).max() < 1e-10 * np.abs(expected).max()
    # What follows starts from the same forces, so that it costs the same.
    assert found["products"][DONE:] == whole()["products"][DONE:]


def test_a_history_that_is_complete_needs_no_solve(interrupted: Path) -> None:
    collect(interrupted, MPI.COMM_SELF)
    assert collect(interrupted, MPI.COMM_SELF)["products"] == [1] * len(RESUMED_PATH)


def test_other_steps_are_refused(interrupted: Path) -> None:
    history = sequence(Checkpoint(interrupted), MPI.COMM_SELF)
    other = resumed_shears((0.0, 0.005))
    history.advance(other[0])
    with pytest.raises(
        InvalidInputError,
        match=r"step 1 of the checkpoint .* differ step.name \('shift 0.006', 'shift 0.005'\)",
    ):
        history.advance(other[1])


def test_another_scene_is_refused(interrupted: Path) -> None:
    other = replace(sequence(None, MPI.COMM_SELF).scene, contacts=[])
    with pytest.raises(InvalidInputError, match=r"scene.contacts.*more: give the same problem or a new name"):
        LoadSequence(ContactProblem(other, MPI.COMM_SELF), checkpoint=Checkpoint(interrupted))


def test_a_history_written_less_often_ends_written(tmp_path: Path) -> None:
    path = tmp_path / "steps.npz"
    history = sequence(Checkpoint(path, every=3), MPI.COMM_SELF)
    for step in resumed_shears()[:DONE]:
        history.advance(step)
    with np.load(path) as stored:
        assert int(stored["steps"]) == 3
    history.finish()
    assert collect(path, MPI.COMM_SELF)["products"][: DONE + 1] == [1] * DONE + whole()["products"][DONE:][:1]


def test_a_body_without_contact_is_solved_again(tmp_path: Path) -> None:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (3, 2, 2))
    scene = Scene({"bar": Body(mesh, IsotropicElasticity(100.0, 0.3))}, [Support("bar", "x0")])
    steps = [LoadStep(f"pull {pull}", loads=[Traction("bar", "x1", (pull, 0.0, 0.0))]) for pull in (1.0, 2.0)]
    cut = {"bar": np.zeros(mesh.n_cells, dtype=int)}
    checkpoint = Checkpoint(tmp_path / "steps.npz")
    once, again = (
        solve_steps(ContactProblem(scene, MPI.COMM_SELF, partitions=cut), steps, checkpoint=checkpoint)
        for _ in range(2)
    )
    assert once[1].gather_displacement("bar").max() > 0.01
    for state, same in zip(once, again, strict=True):
        np.testing.assert_array_equal(state.gather_displacement("bar"), same.gather_displacement("bar"))


def test_an_unreadable_checkpoint_is_refused(interrupted: Path) -> None:
    shutil.copy(Path(__file__), interrupted)
    with pytest.raises(InvalidInputError, match=r"is not a complete checkpoint .* restore or remove it"):
        sequence(Checkpoint(interrupted), MPI.COMM_SELF)


# Starting from a neighbouring state costs less and changes nothing.
WARM_START_TOLERANCE = 1e-8
SOLVERS: dict[str, DualSolver] = {
    "face Newton": FaceNewton(tolerance=WARM_START_TOLERANCE),
    "SMALSE": Smalse(tolerance=WARM_START_TOLERANCE),
    "fixed point": FixedPoint(Smalse(tolerance=WARM_START_TOLERANCE)),
}


def posed(scene: Scene, solver: str) -> ContactProblem:
    return ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=SOLVERS[solver])


def assert_same(one: State, two: State) -> None:
    size = np.abs(two.contact.force).max()
    assert size > 0.01
    assert np.abs(one.contact.force - two.contact.force).max() < 1e-6 * size
    assert one.energies.total_potential == pytest.approx(two.energies.total_potential, rel=1e-8)


#: SMALSE needs some twelve products more for its estimate of ‖PFP‖.
FEW = {"face Newton": 5, "SMALSE": 22, "fixed point": 22}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("friction", [Coulomb(0.38), Tresca(1.0)])
def test_solving_again_costs_at_most_a_few_products(friction: Coulomb | Tresca, solver: str) -> None:
    scene = two_blocks(friction)
    problem = posed(scene, solver)
    first, again = problem.solve(), problem.solve()
    assert_solved(again, WARM_START_TOLERANCE)
    assert_same(again, first)
    assert first.counts["f_products"] > 20
    assert again.counts["f_products"] <= FEW[solver]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("friction", [Coulomb(0.38), Tresca(1.0)])
def test_a_moved_scene_has_the_same_answer_from_a_warm_and_a_cold_start(
    friction: Coulomb | Tresca, solver: str
) -> None:
    scene = two_blocks(friction)
    problem = posed(scene, solver)
    before = problem.solve()
    moved = scene.moved({"upper": crowned(scene.bodies["upper"].mesh, 0.002).points})
    warm, cold = problem.solve(moved), problem.solve(moved, start=None)
    assert_solved(cold, WARM_START_TOLERANCE)
    assert_solved(warm, WARM_START_TOLERANCE)
    assert_same(warm, cold)
    change = np.abs(cold.contact.force - before.contact.force).max()
    assert change > 1e-3 * np.abs(cold.contact.force).max()
    assert warm.counts["f_products"] < cold.counts["f_products"]


def test_another_load_has_the_same_answer_from_a_warm_and_a_cold_start() -> None:
    scene = block_on_plane(Coulomb(0.6))
    problem = posed(scene, "face Newton")
    problem.solve()
    heavier = replace(scene, loads=[Traction("block", "z1", (1.05, 0.3, -2.1))])
    warm, cold = problem.solve(heavier), problem.solve(heavier, start=None)
    assert_same(warm, cold)
    assert warm.contact.force.sum(axis=0) == pytest.approx([-2.1, -0.6, 4.2], rel=1e-6)
