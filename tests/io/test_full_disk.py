"""A full disk, or something that stands in the way, is named; what was there before stays as it was."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import pyvista as pv
from mpi4py import MPI

from fenics_contact import write_result, write_vtu
from fenics_contact.output import OutputError, ResultSeries, write_xdmf
from tests.conftest import LAUNCH, run_on_ranks
from tests.io.states import touching_blocks

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
