"""An interrupted load history goes on from the last step that was done."""

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
    ContactProblem,
    LoadSequence,
    LoadStep,
    Scene,
    Status,
    Support,
    Traction,
    solve_steps,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.conftest import run_on_ranks
from tests.contact.step_cases import PATH, collect, sequence, shears

DONE = 4


@cache
def whole() -> dict[str, Any]:
    history = sequence(None, MPI.COMM_SELF)
    states = [history.advance(step) for step in shears()]
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
    for step in shears()[:DONE]:
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
    assert collect(interrupted, MPI.COMM_SELF)["products"] == [1] * len(PATH)


def test_other_steps_are_refused(interrupted: Path) -> None:
    history = sequence(Checkpoint(interrupted), MPI.COMM_SELF)
    other = shears((0.0, 0.005))
    history.advance(other[0])
    with pytest.raises(
        InvalidInputError,
        match=r"step 1 of the checkpoint .* differ step.name \('shift 0.006', 'shift 0.005'\)",
    ):
        history.advance(other[1])


def test_another_scene_is_refused(interrupted: Path) -> None:
    other = replace(sequence(None, MPI.COMM_SELF).scene, contacts=[])
    with pytest.raises(InvalidInputError, match=r"scene.contacts.*more: give the same problem to go on"):
        LoadSequence(ContactProblem(other, MPI.COMM_SELF), checkpoint=Checkpoint(interrupted))


def test_a_history_written_less_often_ends_written(tmp_path: Path) -> None:
    path = tmp_path / "steps.npz"
    history = sequence(Checkpoint(path, every=3), MPI.COMM_SELF)
    for step in shears()[:DONE]:
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
    with pytest.raises(InvalidInputError, match=r"is not a complete checkpoint .* move it away"):
        sequence(Checkpoint(interrupted), MPI.COMM_SELF)
