"""An interrupted shape optimisation goes on as if nothing had happened, on any number of ranks."""

from __future__ import annotations

import json
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Checkpoint, ShapeProblem
from fenics_contact.design import Result
from fenics_contact.errors import InvalidInputError
from tests.conftest import run_on_ranks
from tests.design.resumed_cases import BOUND, gone_on, minimised, posed


@cache
def uninterrupted(name: str) -> tuple[ShapeProblem, Result]:
    problem = posed(name, MPI.COMM_SELF)
    return problem, minimised(name, problem, None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Checkpoints of runs that were stopped after three evaluations."""
    here = tmp_path_factory.mktemp("interrupted")
    for name in BOUND:
        short = {"max_evaluations": 3, "raise_on_failure": False}
        result = minimised(name, posed(name, MPI.COMM_SELF), Checkpoint(here / f"{name}.npz"), **short)
        assert result.evaluations == 3 < uninterrupted(name)[1].evaluations
    return here


@cache
def answer(name: str, ranks: int, folder: Path) -> dict[str, Any]:
    if ranks == 1:
        path = folder / f"{name} on one rank.npz"
        shutil.copy(folder / f"{name}.npz", path)
        return gone_on(name, path, MPI.COMM_SELF)
    return on_ranks(ranks, folder)[name]


@cache
def on_ranks(ranks: int, folder: Path) -> dict[str, Any]:
    script = Path(__file__).with_name("resumed_cases.py")
    found: dict[str, Any] = json.loads(run_on_ranks(script, ranks, folder))
    return found


@pytest.mark.parametrize("name", BOUND)
def test_the_same_designs_are_met_to_the_last_bit(name: str, folder: Path) -> None:
    problem, whole = uninterrupted(name)
    found = answer(name, 1, folder)
    assert found["values"] == [record.value for record in whole.history]
    assert found["x"] == whole.x.tolist()
    assert found["evaluations"] == problem.evaluations > 3
    assert problem.inexact is (name == "block")


@pytest.mark.parametrize("name", BOUND)
def test_two_ranks_go_on_from_what_one_rank_has_left(name: str, folder: Path) -> None:
    _, whole = uninterrupted(name)
    found = answer(name, 2, folder)
    assert found["ranks"] == 2
    assert found["same"], "ranks hold different designs"
    assert found["kinds"] == [record.kind.name for record in whole.history]
    # Sums over ranks round differently; a state that is solved to 1e-5 may keep some of that.
    values = [record.value for record in whole.history]
    assert found["values"] == pytest.approx(values, rel=1e-7)
    assert found["x"] == pytest.approx(whole.x.tolist(), abs=1e-5 * BOUND[name])


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", BOUND)
def test_first_and_best_design_are_built_again(name: str, ranks: int, folder: Path) -> None:
    problem, _ = uninterrupted(name)
    found = answer(name, ranks, folder)
    assert problem.first is not None
    force = problem.first.state.contact.force
    assert np.abs(np.array(found["first force"]) - force).max() < 1e-9 * np.abs(force).max()
    assert found["best alpha"] == found["x"]


def test_what_error_went_with_which_tolerance_is_known_after_going_on(folder: Path) -> None:
    """The tolerance of the next state is guessed from it: a run that forgot it would solve twice."""
    before, after = posed("block", MPI.COMM_SELF), posed("block", MPI.COMM_SELF)
    start = np.zeros(before.size)
    before(start)
    assert before._memory.error_by_tolerance > 0.0
    after.recall(before.memory())
    assert after._memory.error_by_tolerance == before._memory.error_by_tolerance
    assert after.evaluate(start).tolerance == before.evaluate(start).tolerance


def test_a_checkpoint_of_another_scene_is_refused(folder: Path) -> None:
    problem = posed("chain", MPI.COMM_SELF, 1e-7)
    with pytest.raises(InvalidInputError, match=r"in tolerance \(1e-05, 1e-07\): give the same problem"):
        minimised("chain", problem, Checkpoint(folder / "chain.npz"))
