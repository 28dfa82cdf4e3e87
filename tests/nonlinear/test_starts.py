"""Where Newton's method starts in a load step of bodies that touch."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.large_deformations.ironing import ironing
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    LoadSequence,
    LoadStep,
    MovingObstacle,
    RigidSphere,
    Scene,
    State,
    Support,
    Surface,
    solve_steps,
)
from fenics_contact._large_deformations.loading import RigidStart
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from tests.nonlinear.ironing import die

#: Of the die: down, then along.
WAY = [(0.0, -0.8), (0.25, -0.8), (0.5, -0.8), (0.75, -0.8)]


def drawn(columns: int, cells: int, count: int) -> list[State]:
    """A die that is pressed into a block and drawn along it, without friction."""
    bodies = {
        "block": Body(rectangle((0.0, 0.0), (6.0, 4.0), (columns, columns // 2)), NeoHooke(1.0, 0.32)),
        "die": Body(die(cells), NeoHooke(10.0, 0.32)),
    }
    held = [[Support("block", "y0"), Support("die", "y1", at)] for at in WAY]
    pair = ContactPair(Surface("die", "y0"), Surface("block", "y1"), discretisation="mortar")
    steps = [LoadStep(f"{at}", supports=supports) for at, supports in zip(WAY, held, strict=True)]
    scene = Scene(bodies, held[0], contacts=[pair])
    return list(solve_steps(ContactProblem(scene, MPI.COMM_SELF), steps[:count]))


def without_moving_first(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(RigidStart, "moved", lambda *given: None)


def begun_again(states: list[State]) -> list[bool]:
    return ["begun again" in state.solution.history[0].note for state in states]


def require_the_same(found: list[State], other: list[State]) -> None:
    for one, two in zip(found, other, strict=True):
        force = two.contact.force
        assert np.abs(force).max() > 0.0
        np.testing.assert_allclose(one.contact.force, force, atol=1e-6 * np.abs(force).max())


def test_a_die_that_slides_starts_where_its_support_takes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    found = drawn(16, 6, 4)
    without_moving_first(monkeypatch)
    other = drawn(16, 6, 4)
    require_the_same(found, other)
    assert not any(begun_again(found))
    taken, usual = (sum(len(s.solution.history) for s in states[1:]) for states in (found, other))
    assert taken <= 0.8 * usual, f"{taken} Newton steps where {usual} are usual"


def test_a_start_whose_first_step_fails_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    found = drawn(12, 5, 2)
    without_moving_first(monkeypatch)
    other = drawn(12, 5, 2)
    require_the_same(found, other)
    assert begun_again(found) == [False, True]
    assert not any(begun_again(other))
    taken, usual = (len(states[-1].solution.history) for states in (found, other))
    assert taken == usual + 1, "the step that failed, and no other"


@pytest.mark.slow
@pytest.mark.claim
def test_ironing_by_five_millimetres_takes_the_newton_steps_of_the_study() -> None:
    sequence = LoadSequence(ContactProblem(ironing(48, "mortar"), MPI.COMM_SELF))
    places = [(0.0, 0.25 * k) for k in range(1, 5)] + [(0.25 * k, 1.0) for k in range(1, 21)]
    taken = []
    for across, down in places:
        supports = [Support("bed", "y0"), Support("die", "y1", (across, -down))]
        state = sequence.advance(LoadStep(f"{across} {down}", supports=supports))
        taken.append(len(state.solution.history))
    assert sum(taken) == pytest.approx(130, abs=6)
    assert max(taken[8:]) <= 6


@pytest.mark.parametrize("parts", [1, 2])
def test_a_tool_that_meets_nothing_at_first_presses_later(parts: int) -> None:
    """By then no force acts anywhere, with which what is to act could be compared."""

    def pressed(*times: float) -> State:
        tool = MovingObstacle(RigidSphere((1.0, 2.25), 1.0), lambda time: (None, (0.0, -0.2 * time)))
        pad = Body(rectangle((0.0, 0.0), (2.0, 1.0), (7, 3)), NeoHooke(1.0, 0.3))
        pair = ContactPair(Surface("pad", "y1"), tool)
        scene = Scene({"pad": pad}, [Support("pad", "y0")], contacts=[pair])
        problem = ContactProblem(scene, MPI.COMM_SELF, partitions={"pad": np.arange(21) * parts // 21})
        return list(solve_steps(problem, [LoadStep(str(time), time=time) for time in times]))[-1]

    assert pressed(1.0).contact.normal_force.sum() == 0.0
    at_once, later = pressed(2.0), pressed(0.5, 1.0, 2.0)
    assert at_once.contact.normal_force.sum() > 0.1
    require_the_same([later], [at_once])
    assert later.contact.gap.min() > -1e-8
