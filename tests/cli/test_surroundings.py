"""Commands where not all is as it should be: other runs, code that fails, odd names, readers gone."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI
from rich.table import Table

from fenics_contact import _cli as cli
from fenics_contact import clean_environment
from fenics_contact._base.progress import is_visible
from fenics_contact.output import only_run_in
from tests.conftest import ROOT
from tests.scene_file.texts import GOOD, STEPS, changed


def run(*arguments: object) -> int:
    return cli.main(MPI.COMM_SELF, [str(argument) for argument in arguments])


def scene(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def test_a_second_run_in_a_folder_is_refused_before_it_does_anything(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, folder = scene(tmp_path, STEPS), tmp_path / "there"
    with only_run_in(folder, MPI.COMM_SELF):
        assert run("run", path, "-o", folder) == cli.ExitCode.WRONG_INPUT
        assert "a folder must have one run at a time, another one (process" in capsys.readouterr().err
        assert run("run", path, "-o", folder, "--dry-run") == 0
        assert [file.name for file in folder.iterdir()] == [".fenics_contact.lock"]
    assert run("run", path, "-o", folder) == 0
    assert (folder / "result.json").exists()


#: A material of one's own, and what else may stand in its file; each fails in another way.
OWN = """
from fenics_contact.materials import IsotropicElasticity
{before}
def Own(**parameters):
    {inside}
    return IsotropicElasticity(10.0, 0.3)
"""


def with_own_material(folder: Path, before: str = "", inside: str = "pass") -> Path:
    (folder / "own.py").write_text(OWN.format(before=before, inside=inside))
    return scene(folder, changed(("young_modulus = 2.1e5\npoisson_ratio = 0.3", 'model = "own.py:Own"')))


def test_python_of_a_scene_is_run_unless_it_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = with_own_material(tmp_path, f"open({str(tmp_path / 'ran')!r}, 'w').close()")
    assert run("run", path, "--dry-run", "--no-python") == cli.ExitCode.WRONG_INPUT
    assert "scene.toml, line 16: materials.steel.model must not be Python code (--no-python), got" in (
        capsys.readouterr().err
    )
    assert not (tmp_path / "ran").exists()
    assert run("run", path, "--dry-run") == 0
    assert (tmp_path / "ran").exists(), "the guide says so"
    objective = 'objective = "own.py:J"\n[[design.surfaces]]\nbody = "lower"\nlower = -1\nupper = 1\n'
    path = scene(tmp_path, f"{GOOD}[design]\n{objective}")
    assert run("optimize", path, "--dry-run", "--no-python") == cli.ExitCode.WRONG_INPUT
    assert "design.objective must not be Python code (--no-python)" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("before", "inside", "words"),
    [
        ("raise SystemExit(3)", "pass", "own.py' must run without errors, it raised SystemExit: 3"),
        ("import sys; sys.exit()", "pass", "must run without errors, it raised SystemExit"),
        ("1 / 0", "pass", "it raised ZeroDivisionError: division by zero"),
        ("", "raise SystemExit", "'own.py:Own' with the parameters [] must run without errors, it raised"),
        ("", "1 / 0", "'own.py:Own' with the parameters [] must run without errors, it raised ZeroDiv"),
        ("", "raise RuntimeError('\\x1b[31m')", "it raised RuntimeError: \\x1b[31m"),
    ],
)
def test_python_of_a_scene_that_fails_or_leaves_is_an_error_at_its_key(
    before: str, inside: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("run", with_own_material(tmp_path, before, inside), "--dry-run") == cli.ExitCode.WRONG_INPUT
    said = capsys.readouterr().err
    assert said.startswith("error: scene.toml, line 15: materials.steel: ")
    assert words in said


def test_code_that_leaves_python_later_is_a_failure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    leaving = "class Material:\n    def __getattr__(self, name): raise SystemExit(0)\n"
    path = with_own_material(tmp_path, leaving)
    path.write_text(path.read_text().replace("own.py:Own", "own.py:Material"))
    assert run("run", path, "--dry-run") == cli.ExitCode.FAILED == 1
    assert "SystemExit: 0" in capsys.readouterr().err


def test_control_characters_do_not_reach_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    red = "\x1b[31m\u202e"
    folder = tmp_path / f"out{red}"
    folder.mkdir()
    (folder / "scene.toml").write_text(GOOD)
    assert run("run", folder / "scene.toml", "--dry-run") == 0
    assert run("run", tmp_path / f"{red}.toml") == 2
    assert run("run", folder / "scene.toml", "-o", folder) == 2
    assert run("run", folder / "scene.toml", f"--{red}") == 2
    assert run("view", folder) == 2
    assert run("schema", folder / "a.json") == 0
    assert run("demo", red) == 2
    assert run("accuracy", f"{red}.py") == 2
    cli.Console(MPI.COMM_SELF).write(f"said {red}\r")
    table = Table(title=f"title {red}")
    table.add_column(f"column {red}")
    table.add_row(f"cell {red}")
    cli.Console(MPI.COMM_SELF).write(table)
    logging.getLogger("fenics_contact").warning("logged %s", red)
    written = capsys.readouterr()
    for text in (written.out, written.err):
        assert "\\x1b[31m\\u202e" in text
        assert is_visible(text), text


@pytest.mark.parametrize("kind", ["folder", "loop", "nothing", "a" * 300])
@pytest.mark.parametrize("command", ["run", "view", "accuracy"])
def test_what_is_no_file_is_refused_by_every_command(
    command: str, kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"{kind}.py"
    if kind == "folder":
        path.mkdir()
    if kind == "loop":
        path.symlink_to(path)
    assert run(command, path) == cli.ExitCode.WRONG_INPUT
    written = capsys.readouterr().err
    assert written.startswith("error: ")
    assert "Traceback" not in written


def program(*arguments: object, **streams: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fenics_contact", *map(str, arguments)]
    environment = {**clean_environment(), "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, text=True, env=environment, timeout=120, check=False, **streams)


def test_a_run_whose_reader_has_gone_comes_to_its_end(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    answer = program(
        "run", scene(tmp_path, GOOD), "-o", tmp_path, "--no-pictures", stdout=write, stderr=subprocess.PIPE
    )
    os.close(write)
    assert (answer.returncode, answer.stderr) == (0, "")
    assert (tmp_path / "result.json").exists()


def test_progress_and_warnings_that_nobody_reads_end_nothing(tmp_path: Path) -> None:
    """PETSc's handler of SIGPIPE would end all ranks with a banner of MPI."""
    read, write = os.pipe()
    os.close(read)
    arguments = ("-v", "run", scene(tmp_path, STEPS), "-o", tmp_path, "--no-pictures")
    answer = program(*arguments, stdout=subprocess.PIPE, stderr=write)
    os.close(write)
    assert answer.returncode == 0
    assert f"results in {tmp_path}/" in answer.stdout
    assert (tmp_path / "result.json").exists()


def test_a_demo_whose_reader_has_gone_ends_without_a_complaint(tmp_path: Path) -> None:
    (tmp_path / "demo_wordy.py").write_text(
        "# # A wordy demo.\nfrom pathlib import Path\nfrom fenics_contact._dolfinx import version\n"
        "version()\nfor k in range(3):\n    print('word', flush=True)\nPath('done').touch()\n"
    )
    code = (
        "import sys; from pathlib import Path; from fenics_contact import __main__; "
        "from fenics_contact._cli import demos; "
        f"demos.folder_of_demos = lambda: Path({str(tmp_path)!r}); "
        "sys.exit(__main__.main(['demo', 'wordy']))"
    )
    read, write = os.pipe()
    os.close(read)
    answer = subprocess.run(
        [sys.executable, "-c", code], stdout=write, stderr=subprocess.PIPE, text=True, check=False,
        env={**clean_environment(), "PYTHONPATH": str(ROOT)}, cwd=tmp_path, timeout=120,
    )  # fmt: skip
    os.close(write)
    assert (answer.returncode, answer.stderr) == (0, "")
    assert not (tmp_path / "done").exists()


def test_what_cannot_be_said_is_told_in_a_sentence() -> None:
    with open("/dev/full", "w") as full:
        answer = program("schema", stdout=full, stderr=subprocess.PIPE)
    assert answer.returncode == cli.ExitCode.FAILED
    assert answer.stderr.startswith("error: the output of this command must be written to stdout")
    assert len(answer.stderr.splitlines()) == 1
