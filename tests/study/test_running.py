"""Runs are done once, kept, done again where they must be, and none ends the study."""

from __future__ import annotations

import io
import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fenics_contact.study import Settings, running
from fenics_contact.study.running import collected, measure_all, prepare
from fenics_contact.study.store import Store
from tests.study.samples import BLOCK, GOOD, Machine


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    machine = Machine()
    monkeypatch.setattr(running, "measure", machine)
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
        measure_all(study, io.StringIO())
    # One warm-up on the smallest mesh, then three runs; nothing the second time.
    assert [task.parameters.size for task in machine.asked] == [2, 2, 3, 4]
    assert len(list((tmp_path / "runs").glob("*.json"))) == 3
    assert [run.parameters.size for run in collected(study).good] == [2, 3, 4]


def test_an_interrupted_study_goes_on_where_it_was(machine: Machine, scene: str, tmp_path: Path) -> None:
    study = plan(scene, tmp_path / "runs")
    machine.answers[4] = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        measure_all(study, io.StringIO())
    assert [run.parameters.size for run in collected(study).good] == [2, 3], "what is done is usable"
    machine.answers.clear()
    machine.asked.clear()
    measure_all(study, io.StringIO())
    assert [task.parameters.size for task in machine.asked] == [2, 4]  # warm-up and run
    assert len(collected(study).good) == 3


def test_other_code_other_settings_and_other_ranks_are_other_runs(
    machine: Machine, scene: str, tmp_path: Path
) -> None:
    first = plan(scene, tmp_path)
    Path(scene).write_text(BLOCK + "\n# changed")
    others = [plan(scene, tmp_path), plan(scene, tmp_path, ranks=2)]
    files = {study.store.file(study.tasks[0], 0) for study in [first, *others]}
    assert len(files) == 3
    assert plan(scene, tmp_path).store.file(others[0].tasks[0], 0) in files


def test_the_median_of_the_repeats_counts(machine: Machine, scene: str, tmp_path: Path) -> None:
    study = plan(scene, tmp_path / "runs", repeats=3)
    measure_all(study, io.StringIO())
    run = collected(study).good[0]
    own = sorted(
        2.0 + 0.1 * (k + 1) for k, task in enumerate(machine.asked) if task.parameters.size == 2 and k
    )
    assert run.repeats == len(own) == 3
    assert run.seconds == pytest.approx(own[1])
    assert run.spread == pytest.approx((own[0], own[2]))
    assert [task.verify for task in machine.asked].count(False) == 6, "errors are looked for once"


def test_long_runs_are_not_repeated(machine: Machine, scene: str, tmp_path: Path) -> None:
    machine.seconds = 60.0
    measure_all(plan(scene, tmp_path / "runs", repeats=2), io.StringIO())
    assert [task.parameters.size for task in machine.asked] == [2, 2, 3, 4]


def test_a_failed_run_is_recorded_and_ends_nothing(machine: Machine, scene: str, tmp_path: Path) -> None:
    machine.answers[3] = {"failed": {"kind": "ConvergenceError", "message": "too hard"}, "load_average": 0.1}
    study = plan(scene, tmp_path / "runs")
    measure_all(study, io.StringIO())
    found = collected(study)
    assert [run.failed for run in found.runs] == ["", "ConvergenceError: too hard", ""]
    assert len(found.good) == 2
    machine.asked.clear()
    measure_all(study, io.StringIO())
    assert machine.asked == [], "it would fail again"


@pytest.mark.parametrize("kind", ["crash", "timeout"])
def test_what_may_have_failed_by_chance_is_tried_again(
    machine: Machine, scene: str, tmp_path: Path, kind: str
) -> None:
    machine.answers[3] = {"failed": {"kind": kind, "message": "gone"}, "load_average": 0.1}
    study = plan(scene, tmp_path / "runs")
    measure_all(study, io.StringIO())
    assert [run.failed for run in collected(study).runs] == ["", f"{kind}: gone", ""]
    machine.answers.clear()
    measure_all(study, io.StringIO())
    assert len(collected(study).good) == 3


@pytest.mark.parametrize(
    "content", ['{"seconds": 1', "[]", '{"seconds": -1}', '{"seconds": "soon"}', "\udcff"]
)
def test_a_damaged_file_is_reported_and_its_run_done_again(
    machine: Machine, scene: str, tmp_path: Path, content: str, caplog: pytest.LogCaptureFixture
) -> None:
    study = plan(scene, tmp_path / "runs")
    measure_all(study, io.StringIO())
    damaged = study.store.file(study.tasks[1], 0)
    damaged.write_bytes(content.encode(errors="surrogateescape"))
    machine.asked.clear()
    with caplog.at_level(logging.WARNING):
        measure_all(study, io.StringIO())
    assert any(damaged.name in record.message and "done again" in record.message for record in caplog.records)
    assert [task.parameters.size for task in machine.asked] == [2, 3]  # warm-up and run
    assert json.loads(damaged.read_text())["seconds"] > 0


def test_a_store_keeps_what_a_run_was(tmp_path: Path, scene: str) -> None:
    task = plan(scene, tmp_path).tasks[0]
    store = Store(tmp_path, "mark")
    store.write(task, 0, GOOD)
    kept = json.loads(store.file(task, 0).read_text())
    assert kept["parameters"] == task.parameters.as_dict()
    assert (kept["scene"], kept["ranks"], kept["code"]) == ("pressed_block.py", 1, "mark")
    assert store.read(task, 1) is None
    assert store.read(replace(task, ranks=2), 0) is None
