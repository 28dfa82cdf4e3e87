"""Runs that are killed, that find no room on the disk, or a checkpoint that they cannot read."""

from __future__ import annotations

import json
import os
import random
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import Checkpoint, CheckpointError, minimize
from fenics_contact.design import BundleTrust
from fenics_contact.errors import InvalidInputError
from tests.conftest import LAUNCH, ROOT, run_on_ranks
from tests.hard.conftest import Record
from tests.hard.interrupted_run import RUNS
from tests.optimize.cases import BY_NAME

GROUP = "interrupted"
CHECKPOINTS = ROOT / "tests" / "base"
#: How long a run may take until it has written once more.
PATIENCE = 120.0


def killed_after_a_write(command: list[str], path: Path, delay: float) -> str | None:
    """Start a run and kill it ``delay`` seconds after it wrote; return what it said if it ended itself."""
    before = path.stat().st_mtime_ns if path.exists() else 0
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    limit = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < limit:
        if path.exists() and path.stat().st_mtime_ns != before:
            time.sleep(delay)
            break
        time.sleep(0.002)
    if process.poll() is None:
        process.kill()
    said, errors = process.communicate()
    if process.returncode == 0:
        return said
    assert process.returncode == -9, errors
    return None


@pytest.mark.parametrize("kind", RUNS)
def test_a_run_that_is_killed_again_and_again_ends_with_the_answer_of_one_that_is_not(
    kind: str, tmp_path: Path, record: Record
) -> None:
    path, chance, kills = tmp_path / "run.npz", random.Random(1), 0
    script = Path(__file__).with_name("interrupted_run.py")
    command = [sys.executable, str(script), kind, str(path)]
    said = None
    while said is None and kills < 40:
        said = killed_after_a_write(command, path, chance.uniform(0.0, 0.15))
        kills += said is None
    assert said is not None, "the run does not come on"
    found, expected = json.loads(said), RUNS[kind](None)
    assert kills > 1
    assert found["count"] == expected["count"] > 3
    answer, exact = np.array(found["answer"]), np.array(expected["answer"])
    difference = float(np.abs(answer - exact).max() / np.abs(exact).max())
    assert difference < 1e-12
    words = {"optimisation": "a shape optimisation", "steps": "a load history"}[kind]
    record(
        GROUP,
        f"{words} killed {kills} times at random moments, each time started again",
        products=found["products"],
        steps=found["count"],
        same=difference,
    )


def test_a_writer_killed_hundreds_of_times_always_leaves_a_whole_file(tmp_path: Path, record: Record) -> None:
    kills = 300
    found = json.loads(
        run_on_ranks(CHECKPOINTS / "killed_writer.py", 1, tmp_path, kills, 7, timeout=600.0, fresh=True)
    )
    assert found["whole"] == len(found["steps"]) - 1 >= kills
    assert found["steps"] == sorted(found["steps"])
    assert found["partial"] > 20
    assert found["left"] <= 1
    record(
        GROUP,
        f"a process killed {found['whole']} times while it writes checkpoints, {found['partial']} times in "
        "the middle of a file: every file found is whole and none older than one found before",
    )


def on_a_small_disk(folder: Path) -> dict[str, object]:
    """Write checkpoints on a file system of 256 kB of our own, or where files may not grow beyond that."""
    script = CHECKPOINTS / "full_disk.py"
    mounted = f"mount -t tmpfs -o size=256k tmpfs {folder} && {LAUNCH} 1 {sys.executable} {script} {folder}"
    end = subprocess.run(
        ["unshare", "-rm", "bash", "-c", mounted], capture_output=True, text=True, timeout=120.0
    )
    if end.returncode == 0:
        return {"disk": "a disk of 256 kB", **json.loads(end.stdout)}
    limited = run_on_ranks(script, 1, folder, 120_000, fresh=True)
    return {"disk": "files of at most 120 kB", **json.loads(limited)}


def test_a_full_disk_leaves_the_last_checkpoint_and_no_litter(tmp_path: Path, record: Record) -> None:
    found = on_a_small_disk(tmp_path)
    assert found["failed"] > 3
    assert found["kept"] == found["failed"] - 1
    assert found["others"] == []
    assert "free space" in str(found["said"])
    said = str(found["said"]).partition("could not be written: ")[2].partition(" (")[0]
    record(
        GROUP,
        f"{found['disk']}: checkpoint {found['failed']} does not fit, number {found['kept']} stays",
        outcome=f"refused: could not be written: {said}; free space and run again",
    )


def test_a_minimisation_that_met_a_full_disk_goes_on_where_there_is_room(
    tmp_path: Path, record: Record
) -> None:
    case, checkpoint = BY_NAME["Maxquad"], Checkpoint(tmp_path / "run.npz")
    method = BundleTrust(tolerance=1e-6)
    whole = minimize(case.fun, case.start, method)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
        with pytest.raises(CheckpointError, match=r"File too large \(the one before is as it was\)"):
            minimize(case.fun, case.start, method, checkpoint=checkpoint)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    with np.load(tmp_path / "run.npz") as stored:
        kept = len(stored["history.value"])
    assert 5 < kept < whole.evaluations
    result = minimize(case.fun, case.start, method, checkpoint=checkpoint)
    assert result.history == whole.history
    record(
        GROUP,
        f"a minimisation meets a full disk after {kept} of {whole.evaluations} evaluations and goes on later",
        steps=result.evaluations,
        same=float(np.abs(result.x - whole.x).max()),
    )


@pytest.mark.parametrize("damage", ["cut", "spoilt", "empty", "another file"])
def test_a_checkpoint_that_cannot_be_read_is_refused_and_kept(
    damage: str, tmp_path: Path, record: Record
) -> None:
    case, path = BY_NAME["Maxquad"], tmp_path / "run.npz"
    short = replace(BundleTrust(), max_evaluations=10, raise_on_failure=False)
    minimize(case.fun, case.start, short, checkpoint=Checkpoint(path))
    content = path.read_bytes()
    middle = len(content) // 2
    path.write_bytes(
        {
            "cut": content[:middle],
            "spoilt": content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :],
            "empty": b"",
            "another file": Path(os.__file__).read_bytes(),
        }[damage]
    )
    before = path.read_bytes()
    with pytest.raises(InvalidInputError, match=r"is not a complete checkpoint .* restore") as caught:
        minimize(case.fun, case.start, checkpoint=Checkpoint(path))
    assert path.read_bytes() == before
    reason = str(caught.value).partition("complete checkpoint (")[2].partition(")")[0]
    record(GROUP, f"an unreadable checkpoint: {damage}", outcome=f"refused: no whole checkpoint ({reason})")
