"""Histories of large deformations and plastic flow go on from a checkpoint as if nothing had happened."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import Checkpoint, LoadSequence, LoadStep, Scene
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from tests.large_deformations.resumed_histories import advanced, drawn, problem, yielding


@pytest.mark.parametrize("history", [drawn, yielding])
def test_the_rest_of_a_history_is_the_same(
    history: Callable[[], tuple[Scene, list[LoadStep]]], tmp_path: Path
) -> None:
    scene, steps = history()
    file = Checkpoint(tmp_path / "steps.npz")
    whole = LoadSequence(problem(scene), checkpoint=file)
    before = advanced(whole, steps[:2])
    file = Checkpoint(shutil.copy(tmp_path / "steps.npz", tmp_path / "first.npz"))
    last = advanced(whole, steps[2:])
    resumed = LoadSequence(problem(scene), checkpoint=file)
    again = advanced(resumed, steps[:2])
    assert again.solution.reason == "read from a checkpoint"
    assert np.array_equal(again.torn_displacement, before.torn_displacement)
    assert np.array_equal(again.solution.multiplier, before.solution.multiplier)
    # Normals are found again, to their last places.
    for found, was in (
        (again.contact.force, before.contact.force),
        (again.contact.slip, before.contact.slip),
    ):
        assert np.abs(found - was).max() < 1e-15
    # What fields spread inside subdomains: the openings at their interfaces.
    opening = before.solution.residuals.gluing * before.solution.residuals.gluing_scale
    assert 0.0 < opening < 1e-9
    for name in scene.bodies:
        there, here = before.displacement[name].x.array, again.displacement[name].x.array
        assert np.abs(here - there).max() <= opening
        assert np.abs(again.stress[name].x.array - before.stress[name].x.array).max() < 1e-10
    assert np.abs(again.contact.slip).max() > 1e-3
    assert again.solution.residuals.worst < 1e-9
    assert again.energies.friction == pytest.approx(before.energies.friction)
    assert again.history.values.keys() == before.history.values.keys()
    for name, values in before.history.values.items():
        assert np.array_equal(again.history.values[name], values)
        assert values.any()
    end = advanced(resumed, steps[2:])
    assert end.solution.reason != "read from a checkpoint"
    for name in scene.bodies:
        moved = last.gather_displacement(name)
        assert np.abs(end.gather_displacement(name) - moved).max() < 1e-8 * np.abs(moved).max()
    force = last.contact.force
    assert np.abs(end.contact.force - force).max() < 1e-7 * np.abs(force).max()
    assert np.abs(end.contact.slip_before - last.contact.slip_before).max() < 1e-8


ON_RANKS = """
    import json, sys
    from mpi4py import MPI
    from fenics_contact import Checkpoint
    from fenics_contact import LoadSequence
    from tests.large_deformations import resumed_histories as known

    comm = MPI.COMM_WORLD
    scene, steps = getattr(known, sys.argv[1])()
    sequence = LoadSequence(known.problem(scene, comm), checkpoint=Checkpoint(sys.argv[2]))
    reasons = [sequence.advance(step).solution.reason for step in steps[:2]]
    state = known.advanced(sequence, steps[2:])
    moved = {name: state.gather_displacement(name).tolist() for name in scene.bodies}
    history = {name: values.tolist() for name, values in state.history.values.items()}
    if comm.rank == 0:
        print(json.dumps([comm.size, reasons, moved, state.contact.force.tolist(), history]))
"""


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize("history", [drawn, yielding])
def test_the_rest_of_a_history_is_the_same_on_another_number_of_ranks(
    history: Callable[[], tuple[Scene, list[LoadStep]]], tmp_path: Path, mpirun: Callable[..., str]
) -> None:
    scene, steps = history()
    file = tmp_path / "steps.npz"
    sequence = LoadSequence(problem(scene), checkpoint=Checkpoint(file))
    advanced(sequence, steps[:2])
    printed = mpirun(ON_RANKS, 2, history.__name__, file)
    ranks, reasons, moved, force, remembered = json.loads(printed)
    assert (ranks, reasons) == (2, ["read from a checkpoint"] * 2)
    end = advanced(sequence, steps[2:])
    for name in scene.bodies:
        exact = end.gather_displacement(name)
        assert np.abs(np.array(moved[name]) - exact).max() < 1e-7 * np.abs(exact).max()
    assert np.abs(np.array(force) - end.contact.force).max() < 1e-7 * np.abs(end.contact.force).max()
    assert remembered.keys() == end.history.values.keys()
    for name, values in end.history.values.items():
        assert np.abs(np.array(remembered[name]) - values).max() < 1e-7 * np.abs(values).max()


def test_a_stored_state_of_another_mesh_is_refused(tmp_path: Path) -> None:
    scene, steps = yielding()
    file = Checkpoint(tmp_path / "steps.npz")
    state = advanced(LoadSequence(problem(scene), checkpoint=file), steps[:1])
    body = scene.bodies["block"]
    finer = replace(scene, bodies={"block": replace(body, mesh=rectangle((0, 0), (1, 1), (9, 8)))})
    with pytest.raises(InvalidInputError, match=r"in scene\.bodies\['block'\]\.mesh"):
        LoadSequence(problem(finer), checkpoint=file)
    with pytest.raises(InvalidInputError, match=r"a stored state needs .*: give its scene and partition"):
        problem(finer).restore(stored_state(state))
    steel = replace(scene, bodies={"block": replace(body, material=PlaneStrain(100.0, 0.3))})
    with pytest.raises(InvalidInputError, match=r"differs \(there, here\) in"):
        LoadSequence(problem(steel), checkpoint=file)
