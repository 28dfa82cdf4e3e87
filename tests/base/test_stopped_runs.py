"""Runs that are told to stop keep what is done, say how to go on, and end with the answer of any other."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenics_contact import Checkpoint
from tests.base.stopped_run import RUNS
from tests.conftest import LAUNCH, launch, run_on_ranks

SCRIPT = Path(__file__).with_name("stopped_run.py")
KEPT = {"steps": "{} of 7 load steps are kept in {}: ", "optimisation": "{} evaluations are kept in {}: "}
AGAIN = "run the same command again to go on"
slow = pytest.mark.slow


def words(kind: str, done: int, path: Path) -> str:
    if (kind, done) == ("optimisation", 1):
        return f"1 evaluation is kept in {path}: {AGAIN}"
    return KEPT[kind].format(done, path) + AGAIN


@cache
def uninterrupted(kind: str) -> dict[str, Any]:
    return RUNS[kind][1](None)


def assert_goes_on(kind: str, path: Path, ranks: int = 1) -> None:
    """Go on from a file, to the answer of a run that was not stopped."""
    whole = uninterrupted(kind)
    if ranks == 1:
        found = RUNS[kind][1](Checkpoint(path, resume=True))
    else:
        found = json.loads(run_on_ranks(SCRIPT, ranks, kind, path, "none", fresh=True))
    exact = np.array(whole["answer"])
    assert np.abs(exact).max() > 0.0
    assert np.array(found["answer"]) == pytest.approx(exact, rel=1e-7, abs=1e-9 * np.abs(exact).max())
    assert len(found["products"]) == len(whole["products"])
    if kind == "steps":
        assert sum(found["products"]) < sum(whole["products"]), "the whole history was solved again"


@pytest.mark.parametrize(
    "name", ["SIGTERM", pytest.param("SIGINT", marks=slow), pytest.param("SIGUSR1", marks=slow)]
)
@pytest.mark.parametrize("kind", ["steps", pytest.param("optimisation", marks=slow)])
def test_a_signal_stops_after_the_piece_under_way(kind: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    end = launch(1, SCRIPT, kind, path, name)
    assert end.returncode == 128 + getattr(signal, name)
    assert end.stderr.splitlines() == [
        f"{name}: the run stops after the step under way, at once on a second signal; so far "
        + words(kind, 3, path),
        f"stopped by {name}: " + words(kind, 4, path),
    ]
    assert_goes_on(kind, path)


@pytest.mark.parametrize("seldom", [(), pytest.param(("seldom",), marks=slow)])
@pytest.mark.parametrize("kind", ["steps", pytest.param("optimisation", marks=slow)])
def test_ctrl_c_says_at_the_end_of_the_traceback_what_is_kept(
    kind: str, seldom: tuple[str, ...], tmp_path: Path
) -> None:
    path = tmp_path / "run.npz"
    end = launch(1, SCRIPT, kind, path, "SIGINT", "plain", *seldom)
    assert end.returncode == -signal.SIGINT
    # A history writes the rest where it is interrupted; a minimisation in the middle of an evaluation cannot.
    done = 1 if seldom and kind == "optimisation" else 3
    assert end.stderr.splitlines()[-2:] == ["KeyboardInterrupt", words(kind, done, path)]
    assert_goes_on(kind, path)


@slow
@pytest.mark.parametrize("kind", ["steps", "optimisation"])
@pytest.mark.parametrize("asked", [("plain",), ()])
def test_without_a_checkpoint_it_says_how_to_have_one(kind: str, asked: tuple[str, ...]) -> None:
    end = launch(1, SCRIPT, kind, "-", "SIGINT", *asked)
    done = 3 if asked else 4
    pieces = f"{done} load steps" if kind == "steps" else f"{done} evaluations"
    assert (
        f'nothing is kept of {pieces}: give checkpoint=Checkpoint("run.npz")' in end.stderr.splitlines()[-1]
    )
    assert end.returncode == (-signal.SIGINT if asked else 128 + signal.SIGINT)


@slow
def test_the_second_signal_leaves_the_last_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    end = launch(1, SCRIPT, "steps", path, "SIGTERM", "twice")
    assert end.returncode == 128 + signal.SIGTERM
    assert end.stderr.splitlines()[-1] == "SIGTERM again: the run stops at once; so far " + words(
        "steps", 3, path
    )
    assert_goes_on("steps", path)


@slow
@pytest.mark.parametrize("kind", ["steps", "optimisation"])
@pytest.mark.parametrize("rank", [0, 1])
def test_a_signal_that_one_rank_alone_hears_stops_both(kind: str, rank: int, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    end = launch(2, SCRIPT, kind, path, "SIGTERM", rank)
    assert end.returncode == 128 + signal.SIGTERM
    assert end.stderr.count(f"stopped by SIGTERM: {words(kind, 4, path)}") == 1
    assert_goes_on(kind, path, ranks=2)


@slow
@pytest.mark.parametrize("rank", [0, 1])
def test_a_second_signal_to_one_rank_leaves_no_rank_waiting(rank: int, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    end = launch(2, SCRIPT, "steps", path, "SIGTERM", rank, "twice", timeout=60.0)
    assert end.returncode == 128 + signal.SIGTERM
    assert_goes_on("steps", path, ranks=2)


@slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGUSR1"])
def test_a_signal_to_mpirun_leaves_a_whole_file_and_says_how_to_go_on(name: str, tmp_path: Path) -> None:
    path, log = tmp_path / "run.npz", tmp_path / "errors.txt"
    with log.open("w") as errors:
        process = subprocess.Popen(
            [str(LAUNCH), "2", sys.executable, str(SCRIPT), "steps", str(path), "wait"],
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,
        )
        limit = time.monotonic() + 60.0
        while "now" not in log.read_text() and time.monotonic() < limit:
            time.sleep(0.02)
        process.send_signal(getattr(signal, name))
        assert process.wait(60.0) != 0
    said = log.read_text()
    # What rank 0 hears is SIGTERM, one second before mpirun kills it, or what mpirun passes on.
    heard = "SIGUSR1" if name == "SIGUSR1" else "SIGTERM"
    assert said.count(f"{heard}: the run stops after the step under way") == 1
    assert f"load steps are kept in {path}: {AGAIN}" in said
    assert_goes_on("steps", path, ranks=2)
