"""Studies are run in processes of their own."""

from __future__ import annotations

import io
import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.study import Errors, Parameters, Settings, run_study, runner
from fenics_contact.study import runner as running
from fenics_contact.study.measuring import measured
from fenics_contact.study.results import check_certificates
from fenics_contact.study.runner import Job, measure, prepare
from fenics_contact.study.scenes import BUILT_IN, find_study
from fenics_contact.study.scenes.nested_box import mirrored, nested_box, nested_half
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


# The built-in studies: what they measure is right, their certificates hold, ranks agree.
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_nested_box_fills_its_cube_and_its_mirror_image_too(cell: str) -> None:
    mesh = nested_box(1.25, 40.0, 2, cell)
    assert mesh.volume == pytest.approx(40.0**3)
    assert mirrored(mesh).volume == pytest.approx(40.0**3)
    sides = np.linalg.norm(mesh.points[mesh.cells[:, 1]] - mesh.points[mesh.cells[:, 0]], axis=1)
    assert sides.max() / sides.min() > 10, "nothing is graded"
    assert set(mesh.surfaces) == {"x0", "x1", "y0", "y1", "z0", "z1"}


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_a_nested_half_fills_its_rectangle_with_cells_that_are_not_slender(cell: str) -> None:
    mesh = nested_half(1.25, 30.0, 5, cell)
    upside_down = mirrored(mesh)
    assert mesh.volume == pytest.approx(2 * 30.0**2)
    assert upside_down.volume == pytest.approx(2 * 30.0**2)
    assert (mesh.points[:, 1].min(), upside_down.points[:, 1].max()) == (0.0, 0.0)
    corners = mesh.points[mesh.cells]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert (sides.max(axis=1) / sides.min(axis=1)).max() < 3.0
    assert sides.max() / sides.min() > 10, "nothing is graded"
    assert set(mesh.surfaces) == {"x0", "x1", "y0", "y1"}


def test_one_run_knows_its_errors_and_what_bounds_them() -> None:
    study = find_study("hertz")
    parameters = replace(study.sweep.base, size=2, tolerance=1e-3)
    record = measured(MPI.COMM_SELF, "hertz", parameters.as_dict(), verify=True)
    parts, true = record["parts"], record["true_errors"]
    assert 1e-8 < true.algebraic <= parts["algebraic"] <= 10 * true.algebraic
    assert true.uncertainty < 1e-3 * true.algebraic
    assert parts["friction"] == 0.0
    assert record["quantities"]["contact radius"]["error"] == pytest.approx(-0.0254, abs=0.002)
    assert set(record["phases"]) >= {"mesh", "factor", "solve"}
    assert sum(record["phases"].values()) <= 1.01 * record["seconds"]


def test_forces_that_balance_do_not_bridge_open_gaps() -> None:
    """Of four contacts that press three slip: what they lack once cost the gaps of the thirty open ones."""
    study = find_study("chain_links")
    parameters = replace(study.sweep.base, size=2, discretisation="mortar")
    record = measured(MPI.COMM_SELF, "chain_links", parameters.as_dict(), verify=True)
    true = record["true_errors"].algebraic
    assert true <= record["parts"]["algebraic"] <= 10 * true


def test_every_built_in_study_plans_all_that_it_promises() -> None:
    for name in BUILT_IN:
        study = find_study(name)
        assert study.name == name
        assert len(study.sweep.sizes) >= 4
        assert len(study.quick.runs()) < len(study.sweep.runs())
        assert study.sweep.base in study.sweep.runs()
        assert {"balanced", 1e-8} <= set(study.sweep.tolerances)


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_certificates_hold_in_every_run_of_a_quick_study(name: str, tmp_path: Path) -> None:
    results = run_study(name, tmp_path, sweep=find_study(name).quick, settings=Settings(repeats=1))
    assert [run.failed for run in results.runs] == [""] * len(results.runs)
    check = check_certificates(results)
    assert check.broken == ()
    assert (check.checked, check.unknown) == (len(results.runs), 0)
    errors = Errors(results)
    strict = errors.sequence(errors.strictest(results.base))
    estimates = [run.parts["discretisation"] for run in strict if run.parts]
    assert len(estimates) == 3
    assert estimates == sorted(estimates, reverse=True), "finer meshes are better"


@pytest.mark.slow
def test_two_ranks_find_what_one_finds() -> None:
    what = {"scene": "chain_links", "parameters": Parameters(2, tolerance=1e-8).as_dict(), "verify": True}
    function = "fenics_contact.study.measuring:measured"
    one, two = (measure(Job("chain", function, what, ranks=n, limit=300.0)) for n in (1, 2))
    assert "failed" not in one, one
    assert "failed" not in two, two
    for quantity in find_study("chain_links").quantities:
        values = [record["quantities"][quantity.name]["value"] for record in (one, two)]
        np.testing.assert_allclose(values[0], values[1], rtol=1e-5)
    assert two["memory"] > one["memory"]
