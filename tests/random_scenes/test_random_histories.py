"""Random histories of large deformations: the same answer elsewhere, in other units and cut otherwise.

`python -m tools.random_scenes --kind deformed --count 500` judges as many as wanted.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.results import ContactResult
from tools.random_scenes import deformed_judge
from tools.random_scenes.deformed import KINDS, history
from tools.random_scenes.deformed_judge import judge_history
from tools.random_scenes.frame import Frame
from tools.random_scenes.judge import GOOD, Outcome

#: Short ones of two kinds; claims rest on one or two of each other kind, the slow tests on more of them.
QUICK, CLAIMS, LONG = (9, 1), (25, 27, 28, 29, 115, 154), (13, 24, 26, 30, 31)


def marks(seed: int) -> list[pytest.MarkDecorator]:
    return [] if seed in QUICK else [pytest.mark.slow, *([pytest.mark.claim] if seed in CLAIMS else [])]


@pytest.mark.parametrize("seed", [pytest.param(n, marks=marks(n)) for n in (*QUICK, *CLAIMS, *LONG)])
def test_a_random_history_is_the_same_written_and_cut_otherwise(seed: int) -> None:
    verdict = judge_history(seed)
    assert verdict.outcome in GOOD, f"{verdict.detail}\n{verdict.words}"


def test_a_random_history_is_the_same_on_two_ranks_and_told_once(
    mpirun: Callable[..., str], tmp_path: Path
) -> None:
    lines, run = tmp_path / "verdicts", "from tools.random_scenes.__main__ import main; main()"
    given = f"--kind deformed --processes 0 --seeds {QUICK[1]} --output {lines}"
    told = mpirun(run, 2, *given.split())
    assert [json.loads(line)["outcome"] for line in lines.read_text().splitlines()] == ["solved"], told
    assert told.count("1 scenes") == 1


def test_verdicts_of_ranks_that_differ_are_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    comm = SimpleNamespace(allgather=lambda mine: [mine, Outcome.REFUSED])
    monkeypatch.setattr(deformed_judge, "_ended", lambda made, comm: (Outcome.SOLVED, "", 1))
    verdict = judge_history(0, comm)  # type: ignore[arg-type]
    assert (verdict.outcome, verdict.detail) == (Outcome.WRONG, "on ranks ['solved', 'refused']: ")
    assert logging.getLogger().isEnabledFor(logging.WARNING)  # who judges is silent only meanwhile


def test_seeds_meet_everything() -> None:
    words = " ".join(history(seed).words for seed in range(300))
    for part in (
        *(kind.__name__.replace("_", " ") for kind in KINDS), "plane,", "space,", "mean dilatation", "Ogden",
        "FinitePlasticity", "J2Plasticity", "quadrilateral9", "hexahedron27", "of true shape", "that turns",
        "to and fro", "lifted", "by a remote point", "bed is slave", "one surface", "unheld", "dead",
        "sliding tie", "linear E",
    ):  # fmt: skip
        assert part in words, part


def test_histories_with_loads_are_not_judged_by_internal_forces_alone() -> None:
    for recipe in (history(seed).recipe for seed in (87, 96, 98)):
        scene, _ = recipe.build(Frame.plain(recipe.dim))
        assert scene.loads
        assert recipe.remembers


def test_a_frame_gives_back_what_it_was_given() -> None:
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    frame = Frame(turn, np.array([3.0, 4.0]), 10.0, 2.0)
    assert frame.way((0.5, None)) == (None, pytest.approx(5.0))
    assert frame.back(np.array([frame.along((0.3, 0.7), 2.0)]), 2.0)[0] == pytest.approx([0.3, 0.7])
    assert frame.point((1.0, 0.0)) == pytest.approx((30.0, 50.0))


def test_answers_that_differ_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    force = ContactResult.force.fget  # type: ignore[attr-defined]
    assert judge_history(QUICK[0]).outcome is Outcome.SOLVED
    calls = []

    def wrong(self: ContactResult) -> np.ndarray:
        calls.append(self)
        return np.asarray(force(self) * (1.0 + 1e-3 * (len(calls) % 2)))

    monkeypatch.setattr(ContactResult, "force", property(wrong))
    assert deformed_judge.judge_history(QUICK[0], MPI.COMM_SELF).outcome is Outcome.WRONG
    assert replace(history(QUICK[0]), seed=1).recipe.dim in (2, 3)
