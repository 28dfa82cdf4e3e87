"""Whatever happens to the writer, a reader finds a whole checkpoint."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import Checkpoint, CheckpointError
from fenics_contact._base.files import write_whole
from tests.conftest import run_on_ranks

HERE = Path(__file__).parent
KIND, PROBLEM = "test", {"problem": "one"}


def stored(path: Path, **arrays: object) -> Checkpoint:
    checkpoint = Checkpoint(path)
    checkpoint.write(KIND, PROBLEM, arrays, None)
    return checkpoint


def test_a_writer_killed_at_any_moment_leaves_a_whole_file(tmp_path: Path) -> None:
    found = json.loads(run_on_ranks(HERE / "killed_writer.py", 1, tmp_path, 60, 1, fresh=True))
    steps = found["steps"]
    assert found["whole"] == len(steps) - 1 >= 60
    assert steps == sorted(steps), "a step that was written is never lost"
    assert steps[-1] >= 10, "the processes hardly came to write"
    assert found["partial"] > 3, "hardly any process was killed while it wrote"
    assert found["left"] <= 1, "what earlier ones left is removed"


def test_a_file_that_may_not_grow_any_more_leaves_the_old_checkpoint(tmp_path: Path) -> None:
    found = json.loads(run_on_ranks(HERE / "full_disk.py", 1, tmp_path, 40_000, fresh=True))
    assert found["failed"] > 2
    assert found["kept"] == found["failed"] - 1
    assert found["others"] == []
    assert "could not be written: File too large (the one before is as it was)" in found["said"]
    assert "free space" in found["said"]
    assert "run again to go on" in found["said"]


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    checkpoint = stored(tmp_path / "run.npz", step=1)

    def full(*arguments: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, call, full)
    with pytest.raises(CheckpointError, match=r"No space left on device \(the one before is as it was\)"):
        checkpoint.write(KIND, PROBLEM, {"step": 2}, None)
    monkeypatch.undo()
    found = checkpoint.read(KIND, PROBLEM, None)
    assert found is not None
    assert found["step"] == 1
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def test_a_folder_that_is_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("no folder")
    with pytest.raises(CheckpointError, match=r"could not be written: .*\(there is none yet\)"):
        stored(tmp_path / "runs" / "run.npz", step=1)


def test_a_second_writer_to_the_same_name_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, fsync = tmp_path / "run.npz", os.fsync

    def interrupted(descriptor: int) -> None:
        monkeypatch.setattr(os, "fsync", fsync)
        write_whole(path, b"of another run")
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(CheckpointError, match="let one run write, and run again"):
        write_whole(path, b"of this run")
    assert path.read_bytes() == b"of another run"


def test_folders_are_made_and_a_number_of_evaluations_is_required(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "run.npz"
    found = stored(path, numbers=np.arange(3.0)).read(KIND, PROBLEM, None)
    assert found is not None
    assert found["numbers"].tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(ValueError, match="every must be at least 1, got 0"):
        Checkpoint(path, every=0)
