"""Scenes in which features meet: the same turned, mirrored, in other units, numbered and cut otherwise.

`python -m tools.random_scenes --kind meetings --count 500` judges as many as wanted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fenics_contact.results import ContactResult
from tools.random_scenes import meetings_judge
from tools.random_scenes.judge import GOOD, Outcome
from tools.random_scenes.meetings import SlidingPair, Writing, meeting
from tools.random_scenes.meetings_judge import judge_meeting

QUICK = [0, *range(2, 8)]
#: Scenes that failed once: edges of periodic bodies whose meshes do not match; friction that is unloaded, and
#: at nodes that supports hold.
FOUND = [93, 106, 215, 226, 456, 128, 365, 468, 202]
SLOW = [pytest.param(n, marks=pytest.mark.slow) for n in range(8, 60)]


@pytest.mark.parametrize("seed", [*QUICK, *FOUND, *SLOW])
def test_a_scene_in_which_features_meet_is_the_same_however_it_is_written(seed: int) -> None:
    verdict = judge_meeting(seed)
    assert verdict.outcome in GOOD, f"{verdict.detail}\n{verdict.words}"


def test_seeds_meet_everything() -> None:
    made = [meeting(seed) for seed in range(120)]
    words = " ".join(each.words for each in made)
    for part in (
        "on a bed", "on a rigid foot", "on a floor", "tied", "Tresca", "exponential", "table", "a spring of",
        "sides that move alike", "periodic", "rigid top", "unloaded", "mirrored", "cut in 16", "low is slave",
        "units 1e-09", "units 1e+09", "units 1 ",
    ):  # fmt: skip
        assert part in words, part
    assert {each.other.seed for each in made} == {None, 1, 2, 3}


def test_a_writing_turns_and_mirrors_rotations() -> None:
    mirror = Writing(np.diag([-1.0, 1.0, 1.0]), np.array([1.0, 0.0, 0.0]), 10.0)
    assert mirror.point((2.0, 0.0, 0.0)) == pytest.approx((-10.0, 0.0, 0.0))
    assert mirror.along((1.0, 2.0, 0.0)) == pytest.approx((-1.0, 2.0, 0.0))
    assert mirror.around((1.0, 2.0, 0.0)) == pytest.approx((1.0, -2.0, 0.0))
    assert mirror.open((None, 1.0, 0.0), 2.0, axial=True) == (None, pytest.approx(-2.0), pytest.approx(0.0))


@pytest.mark.parametrize(("factor", "wrong"), [(1.0 + 1e-3, True), (1.0, False)])
def test_answers_that_differ_are_noticed(factor: float, wrong: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    force: Callable[[ContactResult], np.ndarray] = ContactResult.force.fget  # type: ignore[attr-defined]
    calls: list[ContactResult] = []

    def changed(self: ContactResult) -> np.ndarray:
        calls.append(self)
        return np.asarray(force(self) * (factor if len(calls) % 2 else 1.0))

    monkeypatch.setattr(ContactResult, "force", property(changed))
    assert (judge_meeting(3).outcome is Outcome.WRONG) is wrong


def test_a_refusal_of_one_writing_alone_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    def made(seed: int) -> SlidingPair:
        found = meeting(seed)
        return replace(found, other=replace(found.other, length=0.0))

    monkeypatch.setattr(meetings_judge, "meeting", made)
    assert judge_meeting(3).outcome in (Outcome.WRONG, Outcome.TRACEBACK)
