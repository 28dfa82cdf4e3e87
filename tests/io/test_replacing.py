"""Files appear whole or not at all."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import Any

import pytest

from fenics_contact._base.files import hidden_folder
from fenics_contact.output import OutputError
from fenics_contact.output.files import replacing


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
