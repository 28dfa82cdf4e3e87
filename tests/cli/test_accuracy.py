"""The command line: what it refuses, and a whole study that is killed in the middle and goes on."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fenics_contact import clean_environment
from fenics_contact.__main__ import main
from fenics_contact.study import read_study, runner
from tests.conftest import ROOT
from tests.study.samples import BLOCK, Machine


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["accuracy", "hertzz"],
            r"a study is one of ['hertz', 'cattaneo_mindlin', 'chain_links'] or a Python",
        ),
        (["accuracy", "nowhere.py"], "there must be a Python file 'nowhere.py', there is none"),
        (["accuracy", "hertz", "--cells", "cube"], "cell must be one of ['hexahedron', "),
        (
            ["accuracy", "hertz", "--report", "--output", "/nowhere"],
            "a report needs runs that have an answer",
        ),
    ],
)
def test_what_cannot_be_studied_is_refused(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["accuracy", "hertz", "--tolerances", "2"], 'a number between 0 and 1, or "balanced", got 2.0'),
        (["accuracy", "hertz", "--discretisations", "dual"], "must be one of ['node', 'mortar'], got 'dual'"),
        (["accuracy", "hertz", "--tolerances", "tight"], "between 0 and 1, or \"balanced\", got 'tight'"),
        (["accuracy", "hertz", "--limit", "soon"], "Invalid value for '--limit'"),
        (["accuracy", "hertz", "--ranks", "0"], "Invalid value for '--ranks'"),
        (["accuracy"], "Missing argument 'SCENE'"),
        (["acuracy", "hertz"], "No such command 'acuracy'. Did you mean 'accuracy'?"),
        ([], "Missing command."),
    ],
)
def test_options_that_do_not_exist_are_refused_with_those_that_do(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("content", ["", "study = 3"])
def test_a_file_without_a_study_is_refused(
    content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "scene.py"
    file.write_text(content)
    assert main(["accuracy", str(file)]) == 2
    assert "must define `study`, a StudyScene, got" in capsys.readouterr().err


def test_help_names_the_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["accuracy", "--help"]) == 0
    assert "hertz, cattaneo_mindlin, chain_links" in " ".join(capsys.readouterr().out.split())


def test_an_interrupt_from_the_keyboard_leaves_a_report_of_what_was_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, folder = tmp_path / "pressed_block.py", tmp_path / "study"
    scene.write_text(BLOCK)
    machine = Machine()
    machine.answers[4] = KeyboardInterrupt()
    monkeypatch.setattr(runner, "measure", machine)
    assert main(["accuracy", str(scene), "--output", str(folder), "--quick", "--no-figures"]) == 130
    assert "interrupted: what is done is kept" in capsys.readouterr().err
    assert [run.parameters.size for run in read_study(folder).good] == [2, 3]
    assert "# A pressed block" in (folder / "table.md").read_text()
    machine.answers[3] = KeyboardInterrupt()
    settings = ["--output", str(folder), "--runs", str(tmp_path / "others"), "--quick", "--no-figures"]
    assert main(["accuracy", str(scene), *settings]) == 130
    assert "results of an earlier run stay in" in capsys.readouterr().out
    assert [run.parameters.size for run in read_study(folder).good] == [2, 3]


def start(*arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "fenics_contact", "accuracy", *map(str, arguments)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=clean_environment() | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.claim
def test_a_study_of_ones_own_scene_that_was_stopped_goes_on_and_reports(tmp_path: Path) -> None:
    scene, folder = tmp_path / "pressed_block.py", tmp_path / "study"
    scene.write_text(BLOCK)
    arguments = (scene, "--output", folder, "--repeats", 1, "--no-figures")
    stopped = start(*arguments)
    while not list(folder.glob("runs/*.json")) and stopped.poll() is None:
        time.sleep(0.05)
    stopped.send_signal(signal.SIGTERM)
    words = stopped.communicate(timeout=60.0)
    assert stopped.returncode == 143, words
    assert "the same command goes on from there" in words[1]
    assert read_study(folder).good, "what was done is reported"
    (first,) = folder.glob("runs/*.json")
    kept = first.stat().st_mtime_ns

    again = start(*arguments)
    words = again.communicate(timeout=120.0)
    assert again.returncode == 0, words
    assert words[0].startswith("**What an accuracy takes** (size: cells along an edge; on 1 rank)")
    assert "| shortening | 10 %, 5 %, 2 %, 1 %, 0.5 % | " in words[0]
    assert " | quadrilateral | node | 1e-06 | newton | " in words[0]
    assert first.stat().st_mtime_ns == kept
    assert "1/2 size 3" in words[1], "one of three runs was there"
    found = read_study(folder)
    assert [run.failed for run in found.runs] == ["", "InvalidInputError: three cells cannot be built", ""]
    for run in found.good:
        assert run.value("shortening") == pytest.approx(0.01, rel=1e-5)
        assert run.seconds > 0
        assert run.memory is not None
        assert run.memory > 50 * 2**20
        assert run.parts is not None
        assert run.true_errors is not None
    data = json.loads((folder / "study.json").read_text())
    assert data["findings"]["certificates"]["broken"] == []
    assert "/" not in json.dumps(data["runs"]), "results name no place on this machine"
