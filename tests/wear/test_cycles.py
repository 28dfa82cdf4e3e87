"""Wear over many cycles: errors of jumps hold against small steps, and histories end at their limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Checkpoint,
    ContactProblem,
    HoldCurrent,
    LoadStep,
    Support,
    Wear,
    WearLimits,
    wear_to,
)
from fenics_contact._wear import cycles as of_cycles
from fenics_contact.errors import ConvergenceError, InvalidInputError
from tests.equilibrium.wear_cases import FORCE, fretted, punch, worn

COEFFICIENT = 1e-5


def problem_of(scene: Any) -> ContactProblem:
    """Return a problem whose states are much more accurate than jumps."""
    return ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8)


def test_errors_of_jumps_hold_along_the_whole_history(monkeypatch: pytest.MonkeyPatch) -> None:
    profiles: list[tuple[np.ndarray, np.ndarray]] = []
    profile = of_cycles._profile

    def kept(*tracks: Any) -> tuple[np.ndarray, np.ndarray]:
        profiles.append(profile(*tracks))
        return profiles[-1]

    monkeypatch.setattr(of_cycles, "_profile", kept)
    scene = punch(Wear(COEFFICIENT, sliding=1.0))
    history = wear_to(problem_of(scene), 1000.0, tolerance=0.05)
    ends = [jump.cycles for jump in history.jumps]
    assert ends[-1] == pytest.approx(1000.0)
    assert 6 <= len(ends) <= 14
    parts = np.concatenate([np.full(12, size / 12) for size in np.diff([0.0, *ends])])
    exact = worn(scene, [LoadStep(str(k), cycles=size) for k, size in enumerate(parts)])[11::12]
    tried = {round(float(depth.max()), 12): (depth, error) for depth, error in profiles}
    for jump, state in zip(history.jumps, exact, strict=True):
        depth, error = tried[round(jump.depth, 12)]
        missed = np.abs(depth - state.contact.worn_depth).max()
        assert missed < jump.depth_error == error.max()
        assert jump.depth_error <= 0.05 * jump.depth
        assert jump.volume == pytest.approx(COEFFICIENT * FORCE * jump.cycles, rel=1e-9)
        assert jump.volume_error < 1e-9 * jump.volume
    np.testing.assert_array_equal(history.depth, depth)


def test_cycles_of_fretting_are_solved_singly_before_jumps() -> None:
    scene, (press, *moves) = fretted(Wear(2e-3), ways=(0.012, -0.012))
    count = 20
    cycles = [LoadStep(f"{n} {each.name}", supports=each.supports) for n in range(count) for each in moves]
    truth = worn(scene, [press, *cycles])
    history = wear_to(problem_of(scene), count, steps=moves, first=[press], tolerance=0.05)
    assert history.jumps[0].jump == 1.0
    assert history.jumps[0].depth_error == 0.0, "what is solved cycle by cycle has no error by jumps"
    first = truth[2].contact
    assert history.jumps[0].volume == pytest.approx(first.worn_volume(), rel=1e-6)
    assert len(history.jumps) < 8
    end = truth[-1].contact
    assert (
        np.abs(history.depth - end.worn_depth).max() < history.depth_error.max() < 0.06 * end.worn_depth.max()
    )
    assert abs(history.volume[0] - end.worn_volume()) < history.jumps[-1].volume_error


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"depth": 0.004}, "the depth 0.004 is reached"),
        ({"volume": 0.01}, "the volume 0.01 is reached"),
        ({"pressure": 9.0}, "the pressure has fallen to 9"),
    ],
)
def test_a_history_ends_at_its_limit(limits: dict[str, float], words: str) -> None:
    scene = punch(Wear(COEFFICIENT, sliding=1.0))
    history = wear_to(problem_of(scene), 1e4, tolerance=0.1, limits=WearLimits(**limits))
    ((name, limit),) = limits.items()
    assert getattr(history.jumps[-1], name) == pytest.approx(limit, rel=0.011)
    assert history.reason == words
    assert words in str(history)


def test_what_does_not_wear_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"wear_to needs a pair that wears, got none"):
        wear_to(punch(None), 10.0, MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match=r"nothing slides under pressure there: give Wear\(sliding"):
        wear_to(punch(Wear(COEFFICIENT)), 10.0, MPI.COMM_SELF, first=[LoadStep("press")])
    scene = punch(Wear(COEFFICIENT, sliding=1.0))
    with pytest.raises(InvalidInputError, match="cycles must be positive"):
        wear_to(scene, -1.0, MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match="tolerance must lie between 0 and 1, got 2"):
        wear_to(scene, 1.0, MPI.COMM_SELF, tolerance=2.0)


def test_jumps_that_cannot_be_solved_are_halved(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = punch(Wear(COEFFICIENT, sliding=1.0))
    problem, solve = problem_of(scene), ContactProblem.solve

    def failing(self: Any, scene: Any, **given: Any) -> Any:
        if scene.contacts[0].wear.cycles > 2.0:
            raise ConvergenceError("too long")
        return solve(self, scene, **given)

    monkeypatch.setattr(ContactProblem, "solve", failing)
    history = wear_to(problem, 10.0, tolerance=0.5)
    assert max(jump.jump for jump in history.jumps) <= 2.0
    monkeypatch.setattr(of_cycles._Pair, "least", 1.0)
    with pytest.raises(ConvergenceError, match="jumps of wear must be longer than"):
        wear_to(problem, 10.0)


@pytest.mark.parametrize("by_slip", [False, True])
def test_an_interrupted_history_goes_on_from_its_file(
    by_slip: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, steps = fretted(Wear(2e-3), ways=(0.012, -0.012))
    given: dict[str, Any] = {"steps": steps[1:], "first": steps[:1]}
    cycles = 10.0
    if not by_slip:
        scene, given, cycles = punch(Wear(COEFFICIENT, sliding=1.0)), {}, 300.0
    given["tolerance"] = 0.1
    whole = wear_to(problem_of(scene), cycles, **given)
    kept, solve, left = Checkpoint(tmp_path / "wear.npz"), ContactProblem.solve, [7]

    def stopping(self: Any, *arguments: Any, **named: Any) -> Any:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt
        return solve(self, *arguments, **named)

    with monkeypatch.context() as patched:
        patched.setattr(ContactProblem, "solve", stopping)
        with pytest.raises(KeyboardInterrupt):
            wear_to(problem_of(scene), cycles, checkpoint=kept, **given)
    again = wear_to(problem_of(scene), cycles, checkpoint=kept, **given)
    assert len(again.jumps) == len(whole.jumps)
    np.testing.assert_allclose(again.depth, whole.depth, atol=1e-6 * whole.depth.max())
    done = wear_to(problem_of(scene), cycles, checkpoint=kept, **given)
    assert done.jumps == again.jumps, "nothing is left to do"
    longer = wear_to(problem_of(scene), 2.0 * cycles, checkpoint=kept, **given)
    assert longer.jumps[: len(done.jumps)] == done.jumps
    with pytest.raises(InvalidInputError, match="differs"):
        wear_to(problem_of(scene), cycles, checkpoint=kept, **{**given, "tolerance": 0.2})


def test_a_file_of_wear_needs_the_displacements_of_supports(tmp_path: Path) -> None:
    scene = punch(Wear(COEFFICIENT, sliding=1.0))
    kept = Checkpoint(tmp_path / "wear.npz")
    with pytest.raises(InvalidInputError, match=r"checkpoints of wear do not keep shapes, got follow=0\.2"):
        wear_to(problem_of(scene), 10.0, follow=0.2, checkpoint=kept)
    keeping = LoadStep("hold", supports=[Support("punch", "x0", (HoldCurrent(), None))])
    with pytest.raises(InvalidInputError, match="a checkpoint of wear needs values of all supports"):
        wear_to(problem_of(scene), 10.0, steps=[keeping], checkpoint=kept)
