"""A series names complete members alone, goes on where an earlier run stopped, and is what readers expect."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from mpi4py import MPI

from fenics_contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.output import ResultSeries
from fenics_contact.output import paraview as series
from fenics_contact.output.paraview import Member
from tests.design.resumed_cases import minimised, posed
from tests.equilibrium.step_cases import sequence, shears
from tests.output.states import touching_blocks
from tests.pictures.plane_states import plane_block


@lru_cache(maxsize=1)
def history() -> tuple[State, ...]:
    """A block is pressed and sheared."""
    steps = sequence(None, MPI.COMM_SELF)
    return tuple(steps.advance(step) for step in shears((0.0, 0.006, 0.02)))


def a_series(folder: Path, **options: Any) -> ResultSeries:
    return ResultSeries(folder, "run", MPI.COMM_SELF, **options)


def displacements(pvd: Path) -> dict[float, np.ndarray]:
    """Read a series as pyvista does."""
    reader, found = pv.get_reader(pvd), {}
    for value in reader.time_values:
        reader.set_active_time_value(value)
        found[value] = reader.read()[0]["block"].point_data["displacement"]
    return found


def test_every_member_is_read_back_at_its_value(tmp_path: Path) -> None:
    told = a_series(tmp_path / "new")
    for value, state in zip((0.0, 0.5, 1.25), history(), strict=True):
        path = told.add(state, value, f"at {value}")
    assert path == told.path == tmp_path / "new" / "run.pvd"
    found = displacements(path)
    assert list(found) == [0.0, 0.5, 1.25]
    for displacement, state in zip(found.values(), history(), strict=True):
        np.testing.assert_array_equal(displacement, state.gather_displacement("block"))
    assert np.abs(found[0.5] - found[0.0]).max() > 0.001
    assert told.members == tuple(Member(v, k, f"at {v}") for k, v in enumerate((0.0, 0.5, 1.25)))


def test_the_series_is_whole_after_every_member(tmp_path: Path) -> None:
    told = a_series(tmp_path, formats=("vtu", "xdmf"))
    for value, state in enumerate(history()):
        path = told.add(state, value)
        assert list(displacements(path)) == list(range(value + 1))


def test_several_bodies_and_plane_ones_keep_their_names(tmp_path: Path) -> None:
    one = ResultSeries(tmp_path, "two", MPI.COMM_SELF, formats=("xdmf",))
    one.add(touching_blocks(), 0)
    assert pv.read(one.path)[0].keys() == ["lower", "upper block"]
    other = ResultSeries(tmp_path, "plane", MPI.COMM_SELF, formats=("xdmf",))
    other.add(plane_block(), 0)
    assert not np.any(pv.read(other.path)[0]["block"].points[:, 2])


def test_a_value_added_twice_replaces_its_member(tmp_path: Path) -> None:
    told = a_series(tmp_path, formats=("xdmf",))
    first, second, third = history()
    told.add(first, 0.0, "first")
    told.add(second, 1.0)
    told.add(third, 0.0, "third")
    assert [(member.value, member.label) for member in told.members] == [(0.0, "third"), (1.0, "")]
    found = displacements(told.path)
    np.testing.assert_array_equal(found[0.0], third.gather_displacement("block"))
    assert len(list((tmp_path / "run").glob("*.vtm"))) == 2


def test_a_resumed_series_goes_on_and_forgets_what_came_later(tmp_path: Path) -> None:
    killed = a_series(tmp_path, formats=("xdmf",))
    for value in range(5):
        killed.add(history()[0], value)
    resumed = a_series(tmp_path, formats=("xdmf",))
    assert len(resumed.members) == 5, "nothing is removed before there is something new"
    resumed.add(history()[1], 3)
    assert [member.value for member in resumed.members] == [0, 1, 2, 3]
    found = displacements(resumed.path)
    assert list(found) == [0, 1, 2, 3]
    np.testing.assert_array_equal(found[3.0], history()[1].gather_displacement("block"))
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names == {
        f"run_000{number}{part}"
        for number in range(4)
        for part in (".vtm", "_block.vtu", "_block.xdmf", "_block.h5")
    }
    resumed.add(history()[2], 3.5)
    resumed.add(history()[2], 4)
    assert [member.value for member in resumed.members] == [0, 1, 2, 3, 3.5, 4]


def test_a_new_run_replaces_the_series_of_another_one_in_all_formats(tmp_path: Path) -> None:
    earlier = a_series(tmp_path, formats=("xdmf",))
    for value in range(3):
        earlier.add(history()[value], value)
    told = a_series(tmp_path)
    told.add(history()[1], 0)
    assert list(displacements(told.path)) == [0]
    assert {path.name for path in (tmp_path / "run").iterdir()} == {"run_0000.vtm", "run_0000_block.vtu"}


def test_files_of_a_member_that_was_not_completed_are_removed_by_the_next_run(tmp_path: Path) -> None:
    a_series(tmp_path).add(history()[0], 0)
    (tmp_path / "run" / "run_0007_block.vtu").write_text("half")
    mine = tmp_path / "run" / "run_notes.txt"
    mine.write_text("kept")
    a_series(tmp_path).add(history()[1], 1)
    assert not (tmp_path / "run" / "run_0007_block.vtu").exists()
    assert mine.exists()
    assert list(displacements(tmp_path / "run.pvd")) == [0, 1]


def test_a_member_whose_file_is_gone_is_left_out(tmp_path: Path) -> None:
    told = a_series(tmp_path)
    for value in range(3):
        told.add(history()[value], value)
    (tmp_path / "run" / "run_0001.vtm").unlink()
    assert [member.value for member in a_series(tmp_path).members] == [0, 2]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "no element found"),
        (
            "<VTKFile><Collection><DataSet timestep='0' file='a.vtu'/></Collection></VTKFile>",
            "invalid literal",
        ),
        ("<VTKFile><Collection><DataSet timestep='0' file='run_3.vtm'/></Collection></VTKFile>", "it names"),
        ("<VTKFile><Collection><DataSet timestep='0'/></Collection></VTKFile>", "'file'"),
    ],
)
def test_a_collection_of_another_writer_is_refused_and_kept(
    content: str, reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "run.pvd"
    path.write_text(content)
    with pytest.raises(InvalidInputError, match=rf"a ResultSeries wrote, or none, .*{reason}.*another name"):
        a_series(tmp_path)
    assert path.read_text() == content


@pytest.mark.parametrize(
    ("value", "label", "message"),
    [
        (float("nan"), "", "the value of a member must be finite, got nan"),
        (0.0, "two\nlines", "the label of a member must be one line of text"),
    ],
)
def test_values_and_labels_that_a_file_cannot_hold_are_refused(
    value: float, label: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        a_series(tmp_path).add(history()[0], value, label)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("label", ['"shift" < 0.5 & Größe', "ü'"])
def test_any_label_is_kept(label: str, tmp_path: Path) -> None:
    a_series(tmp_path).add(history()[0], 1e-300, label)
    assert a_series(tmp_path).members == (Member(1e-300, 0, label),)


def test_unknown_formats_and_names_with_folders_are_refused(tmp_path: Path) -> None:
    for formats in (("vtk",), "vtu"):
        with pytest.raises(InvalidInputError, match=r"formats must be some of \['vtu', 'xdmf'\], got"):
            a_series(tmp_path, formats=formats)
    with pytest.raises(InvalidInputError, match="name must be the beginning of a file's name, got 'a/b'"):
        ResultSeries(tmp_path, "a/b", MPI.COMM_SELF)


def test_what_cannot_be_written_leaves_the_members_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = a_series(tmp_path)
    told.add(history()[0], 0)
    before = told.path.read_bytes()

    def full(*args: Any, **options: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(series, "write_vtu", full)
    with pytest.raises(OSError, match="No space left"):
        told.add(history()[1], 1)
    monkeypatch.undo()
    assert told.path.read_bytes() == before
    told.add(history()[1], 1)
    assert list(displacements(told.path)) == [0, 1]


def test_a_series_follows_an_optimisation(tmp_path: Path) -> None:
    told, problem = a_series(tmp_path, formats=("xdmf",)), posed("block", MPI.COMM_SELF, 1e-6)
    result = minimised(
        "block", problem, None, max_evaluations=8, raise_on_failure=False, callback=told.follow(problem)
    )
    better = [record for record in result.history if record.kind.value in ("start", "serious")]
    assert len(better) > 2
    assert [member.value for member in told.members] == [record.evaluations for record in better]
    assert told.members[-1].label == f"J = {better[-1].value:.6g}"
    reader = pv.get_reader(told.path)
    reader.set_active_time_value(reader.time_values[-1])
    points = reader.read()[0]["block"].points
    np.testing.assert_array_equal(points, problem.points_of(result.x)["block"])
    assert np.abs(points - problem.scene.bodies["block"].mesh.points).max() > 1e-3, "the shape has changed"


RANKS = """
    import sys
    from mpi4py import MPI
    from fenics_contact import _dolfinx
    from fenics_contact.errors import InvalidInputError
    from fenics_contact.output import ResultSeries
    from tests.equilibrium.step_cases import sequence, shears

    comm, folder = MPI.COMM_WORLD, sys.argv[1]
    formats = ("vtu", "xdmf")
    steps, told = sequence(None, comm), ResultSeries(folder, "run", comm, formats=formats)
    states = [steps.advance(step) for step in shears((0.0, 0.006, 0.02))]
    for value, state in enumerate(states[:2]):
        told.add(state, value)
    told = ResultSeries(folder, "run", comm, formats=formats)
    for value in (1, 2):
        told.add(states[value], value)
    if comm.rank == 0:
        (told.path.parent / "other.pvd").write_text("no collection")
    comm.barrier()
    try:
        ResultSeries(folder, "other", comm)
    except InvalidInputError:
        print("refused", flush=True)
"""


def test_two_ranks_write_the_same_series(mpirun: Callable[..., str], tmp_path: Path) -> None:
    assert mpirun(RANKS, 2, tmp_path).count("refused") == 2
    found = displacements(tmp_path / "run.pvd")
    assert list(found) == [0, 1, 2]
    for displacement, state in zip(found.values(), history(), strict=True):
        near = {"rtol": 1e-4, "atol": 1e-6}
        np.testing.assert_allclose(displacement, state.gather_displacement("block"), **near)
    files = {path.suffix for path in tmp_path.rglob("run*.*")}
    assert files == {".pvd", ".vtm", ".vtu", ".xdmf", ".h5"}
    assert not list(tmp_path.rglob(".*")), "nothing hidden is left"
