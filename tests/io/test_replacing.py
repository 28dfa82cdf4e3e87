"""Files appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fenics_contact.io.replacing import replacing


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
    with pytest.raises(FileNotFoundError), replacing(target, tmp_path / "b") as paths:
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
