"""Files are replaced as a whole: by one run, on a full disk."""

from __future__ import annotations

import errno
import fcntl
import json
import logging
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import pyvista as pv
from mpi4py import MPI

from fenics_contact import clean_environment, write_result, write_vtu
from fenics_contact._base.files import hidden_folder
from fenics_contact.errors import InvalidInputError
from fenics_contact.output import OutputError, ResultSeries, only_run_in, write_json, write_xdmf
from fenics_contact.output.files import LOCK, replacing
from tests.conftest import LAUNCH, ROOT, run_on_ranks
from tests.output.states import touching_blocks


def test_targets_are_replaced_at_the_end_only(tmp_path: Path) -> None:
    target = tmp_path / "new" / "file.txt"
    with replacing(target) as (temporary,):
        temporary.write_text("complete")
        assert temporary.name == target.name, "a file may hold its own name"
        assert not target.exists()
    assert target.read_text() == "complete"
    assert list(target.parent.iterdir()) == [target]


def test_an_error_leaves_the_old_files_and_no_litter(tmp_path: Path) -> None:
    old = [tmp_path / "a", tmp_path / "b"]
    for path in old:
        path.write_text("old")
    with pytest.raises(TypeError), replacing(*old) as paths:
        paths[0].write_text("half") and paths[1].write_text(None)
    assert sorted(tmp_path.iterdir()) == old
    assert [path.read_text() for path in old] == ["old", "old"]


def test_a_file_that_was_not_written_leaves_all_targets_alone(tmp_path: Path) -> None:
    target = tmp_path / "a"
    target.write_text("old")
    with (
        pytest.raises(OutputError, match=r"'a', 'b' could not be written .*No such file"),
        replacing(target, tmp_path / "b") as paths,
    ):
        paths[0].write_text("new")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_files_are_on_the_disk_before_they_get_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda file: (calls.append("fsync"), fsync(file))[1])
    monkeypatch.setattr(os, "replace", lambda a, b: (calls.append("replace"), replace(a, b))[1])
    with replacing(tmp_path / "a", tmp_path / "b") as paths:
        for path in paths:
            path.write_text("new")
    assert calls == ["fsync", "fsync", "replace", "replace", "fsync"]


def hidden(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


KILLED = """
    import os, signal, sys
    from pathlib import Path
    from fenics_contact.output.files import replacing
    with replacing(Path(sys.argv[1]) / "a") as (path,):
        path.write_text("half")
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_writer_has_left_is_removed_by_the_next_one(mpirun: Any, tmp_path: Path) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"exit status (-9|137)"):
        mpirun(KILLED, 1, tmp_path / "folder", fresh=True)
    folder = tmp_path / "folder"
    assert len(hidden(folder)) == 1, "the killed one has left nothing: nothing was tested"
    with replacing(folder / "another") as (path,):
        path.write_text("whole")
    assert [path.name for path in folder.iterdir()] == ["another"]


def test_what_another_writer_is_writing_stays(tmp_path: Path) -> None:
    with hidden_folder(tmp_path, "one") as one:
        with replacing(tmp_path / "a") as (path,):
            path.write_text("whole")
        assert one.is_dir()
        assert hidden(tmp_path) == [one.name]
    assert hidden(tmp_path) == []


def test_other_hidden_files_and_folders_stay(tmp_path: Path) -> None:
    for name in (".git", ".a.partial", ".a.0123abcd.partial.old"):
        (tmp_path / name).mkdir()
    (tmp_path / ".run.npz.0123abcd.partial").write_text("a checkpoint's")
    before = set(hidden(tmp_path))
    with replacing(tmp_path / "a") as (path,):
        path.write_text("whole")
    assert set(hidden(tmp_path)) == before


def test_where_there_are_no_locks_age_tells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(descriptor: int, operation: int) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", none)
    old, young = tmp_path / ".a.00000000.partial", tmp_path / ".a.00000001.partial"
    for path in (old, young):
        path.mkdir()
    os.utime(old, (0, 0))
    with replacing(tmp_path / "a") as (path,):
        path.write_text("whole")
    assert hidden(tmp_path) == [young.name]
    assert (tmp_path / "a").read_text() == "whole"


def test_a_hidden_folder_that_is_taken_away_before_it_is_locked_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, mkdir = [], Path.mkdir

    def robbed(path: Path, *args: Any, **options: Any) -> None:
        mkdir(path, *args, **options)
        if path.name.startswith(".") and not made:
            made.append(path)
            path.rmdir()

    monkeypatch.setattr(Path, "mkdir", robbed)
    with replacing(tmp_path / "a") as (path,):
        path.write_text("whole")
    assert made
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize("blocker", ["a file for a folder", "a folder for a file"])
def test_what_stands_in_the_way_is_named_and_stays(blocker: str, tmp_path: Path) -> None:
    target = tmp_path / "place" / "a"
    if blocker == "a file for a folder":
        target.parent.write_text("mine")
        reason = "File exists|Not a directory"
    else:
        target.mkdir(parents=True)
        (target / "mine").write_text("mine")
        reason = "Is a directory"
    with pytest.raises(OutputError, match=rf"'a' could not be written to the folder .*place': ({reason})"):
        with replacing(target) as (path,):
            path.write_text("new")
    assert [path.read_text() for path in tmp_path.rglob("*") if path.is_file()] == ["mine"]


def test_a_file_that_names_others_is_away_while_they_are_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names, replace = ("a", "b", "index"), os.replace
    for name in names:
        (tmp_path / name).write_text("old")
    there: list[bool] = []

    def watched(source: Path, target: Path) -> None:
        there.append((tmp_path / "index").exists())
        replace(source, target)

    monkeypatch.setattr(os, "replace", watched)
    with replacing(*(tmp_path / name for name in names)) as paths:
        for path in paths:
            path.write_text("new")
    assert there == [False, False, False]
    assert [(tmp_path / name).read_text() for name in names] == ["new"] * 3


def write_all(targets: list[Path]) -> None:
    with replacing(*targets) as paths:
        for path in paths:
            path.write_text("new")


def test_a_folder_in_the_place_of_one_of_several_files_is_found_before_any_is_replaced(
    tmp_path: Path,
) -> None:
    (tmp_path / "a").write_text("old")
    (tmp_path / "b").mkdir()
    (tmp_path / "index").write_text("old")
    targets = [tmp_path / name for name in ("a", "b", "index")]
    with pytest.raises(OutputError, match="Is a directory"):
        write_all(targets)
    assert [(tmp_path / name).read_text() for name in ("a", "index")] == ["old", "old"]


# One run at a time in a folder; a run that is killed stops nobody.

#: Takes the lock of a folder, says so and waits.
HOLDER = """
import sys
from mpi4py import MPI
from fenics_contact.output import only_run_in
with only_run_in(sys.argv[1], MPI.COMM_SELF):
    print("taken", flush=True)
    sys.stdin.read()
"""


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_second_run_is_refused_and_the_first_one_named(tmp_path: Path) -> None:
    with only_run_in(tmp_path / "there", MPI.COMM_SELF):
        words = (
            rf"another one \(process {os.getpid()} on .*, begun 20.*\) writes to '.*there': wait for its end"
        )
        with (
            pytest.raises(InvalidInputError, match=words),
            only_run_in(tmp_path / "there", MPI.COMM_SELF),
        ):
            pytest.fail("it has to be refused")
        with only_run_in(tmp_path, MPI.COMM_SELF):
            assert names(tmp_path) == {"there", LOCK}
    with only_run_in(tmp_path / "there", MPI.COMM_SELF):
        write_json(tmp_path / "there" / "result.json", {})
    assert names(tmp_path / "there") == {"result.json"}


def test_a_folder_that_nothing_was_written_to_is_gone_and_one_that_was_there_stays(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    for name in ("new", "old"):
        with pytest.raises(ZeroDivisionError), only_run_in(tmp_path / name, MPI.COMM_SELF):
            _ = 1 / 0
    assert names(tmp_path) == {"old"}
    assert names(tmp_path / "old") == set()


def test_a_run_that_is_killed_stops_nobody(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=clean_environment() | {"PYTHONPATH": str(ROOT)},
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "taken\n"
        words = rf"another one \(process {holder.pid} "
        with pytest.raises(InvalidInputError, match=words), only_run_in(tmp_path, MPI.COMM_SELF):
            pytest.fail("it has to be refused")
        holder.kill()
    assert (tmp_path / LOCK).exists(), "a killed run cannot put anything in order"
    with only_run_in(tmp_path, MPI.COMM_SELF):
        assert f"process {os.getpid()} " in (tmp_path / LOCK).read_text()
    assert names(tmp_path) == set()


def test_a_lock_whose_file_was_removed_meanwhile_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flock, calls = fcntl.flock, []

    def late(descriptor: int, how: int) -> None:
        calls.append(how)
        if len(calls) == 1:  # its owner ends between the opening and the lock
            (tmp_path / LOCK).unlink()
        flock(descriptor, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with only_run_in(tmp_path, MPI.COMM_SELF):
        assert len(calls) == 2
        assert (tmp_path / LOCK).exists()


def test_where_there_are_no_locks_a_run_goes_on_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def none(descriptor: int, how: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", none)
    with caplog.at_level(logging.WARNING), only_run_in(tmp_path, MPI.COMM_SELF):
        assert names(tmp_path) == set()
    assert "no locks there, let no other run write to this folder" in caplog.text


@pytest.mark.parametrize("name", ["file", "file/below", "loop", "a" * 300, "zero\0byte"])
def test_a_folder_that_cannot_be_made_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with (
        pytest.raises(OutputError, match=r"results cannot be written to the folder '.*': "),
        only_run_in(tmp_path / name, MPI.COMM_SELF),
    ):
        pytest.fail("it has to be refused")


def test_all_ranks_agree_whether_there_is_another_run(mpirun: Callable[..., str], tmp_path: Path) -> None:
    printed = mpirun(
        """
        import sys
        from mpi4py import MPI
        from fenics_contact.errors import InvalidInputError
        from fenics_contact.output import only_run_in
        comm, told = MPI.COMM_WORLD, []
        with only_run_in(sys.argv[1], comm):
            try:
                with only_run_in(sys.argv[1], comm):
                    told.append("both run")
            except InvalidInputError as error:
                told.append("refused" if "another one (process" in str(error) else str(error))
        comm.Barrier()
        with only_run_in(sys.argv[1], comm):
            told.append("free")
        found = comm.gather(told)
        if comm.rank == 0:
            print(found)
        """,
        2,
        tmp_path / "there",
    )
    assert printed == "[['refused', 'free'], ['refused', 'free']]\n"


# A full disk, or something that stands in the way, is named; what was there before stays as it was.
SCRIPT = Path(__file__).with_name("full_disk.py")


def on_a_small_disk(folder: Path) -> dict[str, Any] | None:
    """Write on a file system of 512 kB; None where nobody may mount one."""
    mounted = f"mount -t tmpfs -o size=512k tmpfs {folder} && {LAUNCH} 1 {sys.executable} {SCRIPT} {folder}"
    end = subprocess.run(
        ["unshare", "-rm", "bash", "-c", mounted], capture_output=True, text=True, timeout=120.0
    )
    return json.loads(end.stdout) if end.returncode == 0 else None


def test_a_full_disk_leaves_all_files_as_they_were(tmp_path: Path) -> None:
    found = on_a_small_disk(tmp_path)
    if found is None:
        found = json.loads(run_on_ranks(SCRIPT, 1, tmp_path, 3000, fresh=True))
    assert set(found["said"]) >= {"vtu", "json", "series"}
    for name, said in found["said"].items():
        assert "could not be written to the folder" in said, name
        assert "No space left on device" in said or "File too large" in said
        assert "What was there under these names is as it was: free space" in said
    assert found["kept"]
    assert found["hidden"] == []


def test_too_little_room_is_found_before_hdf5_meets_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_xdmf(touching_blocks(), tmp_path / "state.xdmf")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}

    class Usage(NamedTuple):
        free: int

    monkeypatch.setattr(shutil, "disk_usage", lambda folder: Usage(1000))
    with pytest.raises(OutputError, match=r"No space left on device: \d+ bytes are needed, 1000 are free"):
        write_xdmf(touching_blocks(), tmp_path / "state.xdmf")
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    monkeypatch.undo()
    wanted = max(path.stat().st_size for path in before)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: Usage(wanted))
    with pytest.raises(OutputError):
        write_xdmf(touching_blocks(), tmp_path / "state.xdmf")


def test_a_folder_in_the_place_of_a_file_is_named_and_kept(tmp_path: Path) -> None:
    state = touching_blocks()
    for name in ("result.json", "state_lower.vtu", "state_lower.h5", "run.pvd"):
        (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match=r"'result.json' could not be written .*: Is a directory"):
        write_result(state, tmp_path)
    with pytest.raises(OutputError, match=r"'state.vtm' could not be written .*: Is a directory"):
        write_vtu(state, tmp_path)
    with pytest.raises(OutputError, match=r"'state_lower.xdmf' could not be written .*: Is a directory"):
        write_xdmf(state, tmp_path / "state.xdmf")
    assert not list(tmp_path.rglob("*.vtm"))
    assert not list(tmp_path.rglob(".*"))


def test_a_series_in_the_place_of_a_file_or_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("mine")
    series = ResultSeries(tmp_path, "run", MPI.COMM_SELF)
    with pytest.raises(
        OutputError, match=r"could not be written to the folder .*run': (File exists|Not a d)"
    ):
        series.add(touching_blocks(), 0)
    assert (tmp_path / "run").read_text() == "mine"
    (tmp_path / "run").unlink()
    series.add(touching_blocks(), 0)
    displacement = pv.read(series.path)[0]["lower"].point_data["displacement"]
    np.testing.assert_array_equal(displacement, touching_blocks().gather_displacement("lower"))
