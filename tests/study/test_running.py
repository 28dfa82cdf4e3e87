"""Runs are done once, kept, done again where they must be, and none ends the study."""

from __future__ import annotations

import io
import json
import logging
from pathlib import Path
from typing import Any

import pytest

from fenics_contact.study import Settings, runner
from fenics_contact.study import runner as running
from fenics_contact.study.runner import prepare
from tests.study.samples import BLOCK, Machine


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    machine = Machine()
    monkeypatch.setattr(runner, "measure", machine)
    return machine


@pytest.fixture
def scene(tmp_path: Path) -> str:
    file = tmp_path / "pressed_block.py"
    file.write_text(BLOCK)
    return str(file)


def plan(scene: str, folder: Path, **settings: Any) -> running.StudyPlan:
    return prepare(scene, folder, settings=Settings(**{"repeats": 1, **settings}))


def test_every_run_is_done_once(machine: Machine, scene: str, tmp_path: Path) -> None:
    for _ in range(2):
        study = plan(scene, tmp_path / "runs")
        study.measure(io.StringIO())
    # One warm-up on the smallest mesh, then three runs; nothing the second time.
    assert machine.asked == [2, 2, 3, 4]
    assert len(list((tmp_path / "runs").glob("*.json"))) == 3
    assert [run.parameters.size for run in study.collected().good] == [2, 3, 4]


def test_an_interrupted_study_goes_on_where_it_was(machine: Machine, scene: str, tmp_path: Path) -> None:
    study = plan(scene, tmp_path / "runs")
    machine.answers[4] = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        study.measure(io.StringIO())
    assert [run.parameters.size for run in study.collected().good] == [2, 3], "what is done is usable"
    machine.answers.clear()
    machine.asked.clear()
    study.measure(io.StringIO())
    assert machine.asked == [2, 4]  # warm-up and run
    assert len(study.collected().good) == 3


def test_other_code_other_settings_and_other_ranks_are_other_runs(
    machine: Machine, scene: str, tmp_path: Path
) -> None:
    first = plan(scene, tmp_path)
    Path(scene).write_text(BLOCK + "\n# changed")
    others = [plan(scene, tmp_path), plan(scene, tmp_path, ranks=2)]
    files = {study.store.file(next(iter(study.jobs.values())), 0) for study in [first, *others]}
    assert len(files) == 3
    assert plan(scene, tmp_path).store.file(next(iter(others[0].jobs.values())), 0) in files


def test_the_median_of_the_repeats_counts(machine: Machine, scene: str, tmp_path: Path) -> None:
    study = plan(scene, tmp_path / "runs", repeats=3)
    study.measure(io.StringIO())
    run = study.collected().good[0]
    own = sorted(2.0 + 0.1 * (k + 1) for k, size in enumerate(machine.asked) if size == 2 and k)
    assert run.repeats == len(own) == 3
    assert run.seconds == pytest.approx(own[1])
    assert run.spread == pytest.approx((own[0], own[2]))
    assert machine.verified.count(False) == 6, "errors are looked for once"


def test_long_runs_are_not_repeated(machine: Machine, scene: str, tmp_path: Path) -> None:
    machine.seconds = 60.0
    plan(scene, tmp_path / "runs", repeats=2).measure(io.StringIO())
    assert machine.asked == [2, 2, 3, 4]


def test_a_failed_run_is_recorded_and_ends_nothing(machine: Machine, scene: str, tmp_path: Path) -> None:
    machine.answers[3] = {"failed": {"kind": "ConvergenceError", "message": "too hard"}, "load_average": 0.1}
    study = plan(scene, tmp_path / "runs")
    study.measure(io.StringIO())
    found = study.collected()
    assert [run.failed for run in found.runs] == ["", "ConvergenceError: too hard", ""]
    assert len(found.good) == 2
    machine.asked.clear()
    study.measure(io.StringIO())
    assert machine.asked == [], "it would fail again"


@pytest.mark.parametrize("kind", ["crash", "timeout"])
def test_what_may_have_failed_by_chance_is_tried_again(
    machine: Machine, scene: str, tmp_path: Path, kind: str
) -> None:
    machine.answers[3] = {"failed": {"kind": kind, "message": "gone"}, "load_average": 0.1}
    study = plan(scene, tmp_path / "runs")
    study.measure(io.StringIO())
    assert [run.failed for run in study.collected().runs] == ["", f"{kind}: gone", ""]
    machine.answers.clear()
    study.measure(io.StringIO())
    assert len(study.collected().good) == 3


@pytest.mark.parametrize(
    "content", ['{"seconds": 1', "[]", '{"seconds": -1}', '{"seconds": "soon"}', "\udcff"]
)
def test_a_damaged_file_is_reported_and_its_run_done_again(
    machine: Machine, scene: str, tmp_path: Path, content: str, caplog: pytest.LogCaptureFixture
) -> None:
    study = plan(scene, tmp_path / "runs")
    study.measure(io.StringIO())
    damaged = study.store.file(list(study.jobs.values())[1], 0)
    damaged.write_bytes(content.encode(errors="surrogateescape"))
    machine.asked.clear()
    with caplog.at_level(logging.WARNING):
        study.measure(io.StringIO())
    assert any(damaged.name in record.message and "done again" in record.message for record in caplog.records)
    assert machine.asked == [2, 3]  # warm-up and run
    assert json.loads(damaged.read_text())["seconds"] > 0
