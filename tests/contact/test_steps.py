"""Load steps: friction remembers, checked against a second formulation and another solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadSequence,
    LoadStep,
    RigidPlane,
    Scene,
    Status,
    Support,
    Surface,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState
from tests.contact.conic_reference import ConicReference

FRICTION, TOLERANCE = 0.3, 1e-9
FLOOR = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
#: Pressed, sheared until all slips, let go, sheared the other way, let go, sheared again.
PATH = (0.0, 0.006, 0.02, 0.008, 0.0, -0.02, -0.004, 0.0, 0.012, 0.02)


def sheared_block(law: Coulomb | Tresca) -> Scene:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (5, 3, 3))
    pair = ContactPair(Surface("block", "z0"), FLOOR, law)
    return Scene({"block": Body(mesh, IsotropicElasticity(1000.0, 0.3))}, contacts=[pair])


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


def coulomb_reference(scene: Scene, before: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement and contact forces of one step: a fixed point of conic programs."""
    reference = ConicReference(scene)
    normal = np.full(len(reference.rows.gap), 0.5)
    for _ in range(60):
        found = reference.solve(FRICTION * normal, before)
        change = np.abs(found.normal_force - normal).max() / found.normal_force.max()
        normal = found.normal_force
        if change < 1e-9:
            break
    assert change < 1e-7
    return found.displacement, found.contact_force


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


def test_steps_may_not_change_what_supports_hold() -> None:
    sequence = LoadSequence(ContactProblem(sheared_block(Coulomb(0.3)), MPI.COMM_SELF))
    sequence.advance(shears((0.0,))[0])
    freed = LoadStep("free", supports=[Support("block", "z1", (None, 0.0, -0.01))])
    with pytest.raises(InvalidInputError, match="may change their values, not what they hold"):
        sequence.advance(freed)
