"""Commands under mpirun: one rank speaks, all end alike."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from fenics_contact._cli.console import ExitCode
from tests.conftest import LAUNCH, ROOT, launch
from tests.scene_file.texts import GOOD, changed

#: Takes long: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]

#: Runs commands one after the other on all ranks and tells how each ended on each rank.
SCRIPT = """
import contextlib, io, json, sys
from mpi4py import MPI
from fenics_contact import _cli as cli
comm, told = MPI.COMM_WORLD, []
for arguments in json.loads(sys.argv[1]):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = cli.main(comm, arguments)
    told.append(comm.gather((code, out.getvalue(), err.getvalue())))
if comm.rank == 0:
    print(json.dumps(told))
"""


def test_one_rank_speaks_and_all_end_alike(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(GOOD)
    (tmp_path / "slides.toml").write_text(changed(("coefficient = 0.3", "coefficient = 0.0")))
    commands = [
        ["run", str(path), "-o", str(tmp_path / "out"), "--no-pictures"],
        ["run", str(path), "--set", "contacts.0.friction.coefficient=-1"],
        ["run", str(tmp_path / "slides.toml"), "-o", str(tmp_path / "out")],
        ["--help"],
        ["nothing"],
        ["accuracy", "hertz"],
        ["view", str(tmp_path / "out")],
        ["view", "nowhere"],
        ["info"],
    ]
    answer = launch(2, "-c", SCRIPT, json.dumps(commands))
    assert answer.returncode == 0, answer.stderr
    told = json.loads(answer.stdout)
    codes = [[code for code, _, _ in ranks] for ranks in told]
    assert codes == [[code, code] for code in (0, 2, 4, 0, 2, 2, 0, 2, 0)]
    assert [ranks[1][1:] for ranks in told] == [["", ""]] * len(commands), "rank 1 says nothing"
    assert "scene.toml on 2 ranks" in told[0][0][1]
    assert "coefficient must be a number of at least 0, a formula" in told[1][0][2]
    assert "give --ranks 2" in told[5][0][2]
    assert "2 on 1 node" in told[8][0][1]
    assert (tmp_path / "out" / "state.vtm").exists()


def test_the_program_ends_with_its_code_under_mpirun(tmp_path: Path) -> None:
    answer = launch(2, "-m", "fenics_contact", "run", tmp_path / "nowhere.toml")
    assert answer.returncode == 2
    assert answer.stderr.count("error: there must be a scene file") == 1
    assert "Traceback" not in answer.stderr
    assert "MPI_ABORT" not in answer.stderr


#: A scene of six steps, and their normal forces.
SHEARED = (
    "--set", "steps.1.count=3", "--set", "steps.2.count=1", "--set", "steps.3.count=1", "--no-pictures",
    ROOT / "demos" / "scenes" / "sheared_block.toml",
)  # fmt: skip
FORCES = [193.665, 191.284, 181.971, 173.993, 171.657, 171.225]


def assert_has_all_steps(output: Path) -> None:
    steps = json.loads((output / "result.json").read_text())["more"]["steps"]
    assert steps["number"] == list(range(6))
    assert steps["normal_force"] == pytest.approx(FORCES, rel=1e-5)
    assert (output / "history.pvd").read_text().count("timestep") == 6


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_run_that_is_terminated_goes_on(ranks: int, tmp_path: Path) -> None:
    arguments = ("-m", "fenics_contact", "run", *SHEARED, "-o", tmp_path)
    command = [str(LAUNCH), str(ranks), sys.executable, *map(str, arguments)]
    stopped = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "history.pvd").exists() and stopped.poll() is None:
        time.sleep(0.05)
    # What the launcher passes on to ranks and waits for; alone, the process hears it itself.
    stopped.send_signal(signal.SIGUSR1 if ranks > 1 else signal.SIGTERM)
    _, words = stopped.communicate(timeout=120.0)
    assert stopped.returncode == (ExitCode.STOPPED if ranks > 1 else ExitCode.TERMINATED), words
    assert "Traceback" not in words
    assert (tmp_path / "checkpoint.npz").exists()
    assert not (tmp_path / "result.json").exists()
    again = launch(ranks, *arguments, "--resume", timeout=300.0)
    assert again.returncode == 0, again.stderr
    assert "going on from" in again.stdout
    assert_has_all_steps(tmp_path)


def test_a_sheared_block_has_the_same_steps_on_four_ranks(mpirun: Callable[..., str], tmp_path: Path) -> None:
    run = "import sys; from mpi4py import MPI; from fenics_contact import _cli as cli"
    mpirun(f"{run}; sys.exit(cli.main(MPI.COMM_WORLD, sys.argv[1:]))", 4, "run", *SHEARED, "-o", tmp_path)
    assert_has_all_steps(tmp_path)
