"""The driver: which runs it chooses, what it keeps, and what it says when something is wrong."""

from __future__ import annotations

import importlib
import inspect
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks import effects, refinement, speed
from benchmarks.__main__ import STUDIES, main, set_environment
from benchmarks.cases.chain import cold_state
from benchmarks.cases.linear_face import solve_face
from benchmarks.cases.monolithic.elasticity import assemble_block, assemble_part
from benchmarks.cases.monolithic.linear import solve_linear
from benchmarks.cases.refinement import MESHES, hertz
from benchmarks.cases.scenes import block_on_plane, drilled_block
from benchmarks.held import HELD
from benchmarks.optimisation_tolerance import report as tolerance
from benchmarks.plan import run, runs
from benchmarks.study import chosen, filled
from fenics_contact import solve_scene
from fenics_contact.mesh.quality import cell_volumes
from fenics_contact.study import runner
from fenics_contact.study.runner import Job, measure
from fenics_contact.study.scenes.chain_links import graded_links
from tests.benchmarks.small_records import all_summaries
from tests.conftest import ROOT, read_environment

TINY = {"counts": [4, 2, 2]}


def test_every_run_has_a_name_of_its_own_and_a_function_that_takes_its_arguments() -> None:
    for study in STUDIES.values():
        jobs = importlib.import_module(study).study.jobs(False)
        assert len({job.name for job in jobs}) == len(jobs)
        for job in jobs:
            module, _, name = job.function.partition(":")
            call = inspect.signature(getattr(importlib.import_module(module), name))
            call.bind(None, **job.arguments)
    assert len(runs()) > 20


def test_a_name_chooses_its_run_and_a_beginning_all_runs_that_have_it() -> None:
    assert [job.name for job in chosen(runs(), ["chain"])] == ["chain"]
    assert [job.name for job in chosen(runs(), ["block", "getfem"])] == [
        "block-92k-boxes",
        "block-28k",
        "block-92k",
        "block-212k",
        "getfem-28k",
    ]
    assert chosen(runs(), []) == runs()


def test_the_quick_benchmark_is_a_part_of_the_full_one() -> None:
    quick, full = runs(quick=True), runs()
    assert {job.name for job in quick} < {job.name for job in full}
    assert {job.repeats for job in quick} == {1} < {job.repeats for job in full}


def test_commands_have_the_environment_of_all_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    file = ROOT / "scripts" / "environment"
    for name in read_environment(file):
        monkeypatch.setenv(name, "other")
    set_environment(file)
    assert {name: os.environ[name] for name in read_environment(file)} == read_environment(file)


def test_an_unknown_name_is_refused_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--only", "chian"])
    assert "or how it begins, got 'chian': use one of chain, chain-1-rank" in capsys.readouterr().err


def test_a_run_leaves_its_record_with_the_load_of_the_machine() -> None:
    record = measure(run("tiny", "newton_block", TINY, 1))
    assert record["counts"]["unknowns"] == 135
    assert record["peak_memory"] > record["import_memory"] > 0
    assert record["load_average"] >= 0


def test_what_needs_another_program_runs_without_mpi() -> None:
    record = measure(run("tiny", "getfem_block", TINY, 0))
    assert record["ranks"] == 1
    assert record.get("counts", {}).get("unknowns") == 135 or "GetFEM cannot be imported" in record["skipped"]


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks").rglob("*.py")), ids=lambda path: path.stem)
def test_every_module_has_what_it_imports(path: Path) -> None:
    parts = path.relative_to(ROOT).with_suffix("").parts
    importlib.import_module(".".join(parts[:-1] if parts[-1] == "__init__" else parts))


def test_chains_have_the_cells_that_their_runs_name() -> None:
    known = {job.name: job.arguments for job in runs()}
    ratios, types = [], []
    for name in ("chain-default", "chain-equal", "chain-tetrahedra"):
        given = {key: known[name][key] for key in ("cell", "grading") if key in known[name]}
        mesh = graded_links((24, 2, 8), **given).first.mesh
        volume = cell_volumes(mesh.points, mesh.cells)
        ratios.append(volume.max() / volume.min())
        types.append(mesh.cell_type)
    assert types == ["hexahedron", "hexahedron", "tetrahedron"]
    assert ratios[1] < 0.5 * min(ratios[0], ratios[2])


def test_the_face_of_a_state_is_solved_as_a_linear_problem() -> None:
    state, _ = cold_state(MPI.COMM_SELF, (24, 2, 8), (4, 1, 2))
    linear = solve_face(state)
    assert 0 < linear.products <= state.dual_solution.products
    assert linear.measure <= 1e-6


def test_a_linear_solve_finds_the_same_by_either_solver() -> None:
    block = assemble_block(MPI.COMM_SELF, (8, 4, 4))
    found = [solve_linear(block, solver, 1e-9) for solver in ("gamg", "cholesky")]
    assert [solution.iterations for solution in found][1] == 1 < found[0].iterations < 30
    largest = found[1].displacement.norm()
    found[0].displacement.axpy(-1.0, found[1].displacement)
    assert found[0].displacement.norm() < 1e-7 * largest


def test_a_part_of_tetrahedra_is_the_same_problem_for_both() -> None:
    mesh = drilled_block(0.2)
    assert {"x0", "z0", "z1"} == set(mesh.surfaces)
    part = assemble_part(MPI.COMM_SELF, mesh)
    assert part.stiffness.size[0] == mesh.points.size
    assert len(part.nodes) == len(np.unique(mesh.surfaces["z0"])) - np.count_nonzero(
        np.abs(mesh.points[:, [0, 2]]).max(axis=1) < 1e-9
    )
    solved = solve_linear(part, "cholesky", 1e-9)
    free = replace(block_on_plane(mesh), contacts=[])
    ours = solve_scene(free, MPI.COMM_SELF)
    assert part.load.dot(solved.displacement) == pytest.approx(2.0 * ours.energies.strain, rel=1e-8)


def test_a_case_that_fails_on_several_ranks_ends() -> None:
    record = measure(run("tiny", "sliding_block", {**TINY, "boxes": [9, 9, 9]}, limit=60.0))
    assert "boxes" in record["failed"]["message"]


@pytest.fixture
def main_with(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Return the driver with made-up measurements; names given fail. The full results are in ``full``."""
    monkeypatch.setattr(speed, "study", replace(speed.study, home=tmp_path / "full"))

    def call(*arguments: str, failing: tuple[str, ...] = (), **changes: Any) -> list[str]:
        asked = []

        def measured(job: Job, *, first: bool = True) -> dict[str, Any]:
            asked.append(job.name)
            if job.name in failing:
                return {"failed": {"kind": "crash", "message": "it ended"}, "load_average": 0.0}
            record: dict[str, Any] = dict(all_summaries().get(job.name, {}))
            if job.name in HELD:
                held = HELD[job.name]
                record["counts"] = {**record["counts"], "unknowns": held.unknowns, "f_products": held.work}
            return {**record, "load_average": 0.5, **changes}

        monkeypatch.setattr(runner, "measure", measured)
        main([*arguments, "--folder", str(tmp_path)])
        return asked

    return call


def test_a_complete_benchmark_replaces_results(main_with: Any, tmp_path: Path) -> None:
    main_with(seconds=2.0)
    before = (tmp_path / "full" / "results.json").read_text()
    main_with("--again", seconds=3.0)
    assert (tmp_path / "full" / "results.json").read_text() != before
    assert main_with() == [], "all is there"
    assert not (tmp_path / "partial").exists()


@pytest.mark.parametrize("arguments", [["--quick"], []], ids=["quick", "full"])
def test_a_failing_benchmark_leaves_good_results(
    arguments: list[str], main_with: Any, tmp_path: Path
) -> None:
    main_with(*arguments)
    folder = tmp_path / ("quick" if arguments else "full")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert len(before) == 3
    with pytest.raises(SystemExit, match="failed: linear-face: it ended"):
        main_with(*arguments, "--again", failing=("linear-face",), seconds=5.0)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert (tmp_path / "partial" / "results.json").exists()
    assert "linear-face" in main_with(*arguments), "a crash may pass"
    assert {path.name: path.read_bytes() for path in folder.iterdir()} != before


def test_a_quick_benchmark_is_no_part_of_a_full_one(main_with: Any) -> None:
    assert "chain" in main_with("--quick")
    assert main_with("--quick") == []
    assert "chain" in main_with()


def test_a_few_runs_leave_good_results(main_with: Any, tmp_path: Path) -> None:
    main_with("--only", "chain", "block")
    assert (tmp_path / "partial" / "results.md").exists()
    assert not (tmp_path / "full").exists()


def test_counts_that_are_not_kept_fail_the_benchmark(main_with: Any, tmp_path: Path) -> None:
    counts = {"torn_unknowns": 66528, "f_products": 1000, "linear_products": 2, "newton_steps": 5}
    with pytest.raises(SystemExit, match="chain must have 66528 unknowns and take 41 products or steps, got"):
        main_with("--quick", counts=counts)
    assert not (tmp_path / "quick").exists()


def test_a_report_without_measurements_of_the_present_code_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="a report needs measurements of the present code, found none"):
        main(["--report", "--folder", str(tmp_path)])


def test_the_page_of_the_effects_is_its_record() -> None:
    folder = ROOT / "benchmarks"
    records = json.loads((folder / "effects.json").read_text())
    assert effects.page(records) == (folder / "effects.md").read_text()


def test_the_page_of_refinement_is_its_record_and_products_hardly_grow() -> None:
    folder = ROOT / "benchmarks"
    records = json.loads((folder / "refinement.json").read_text())
    assert refinement.page(records) == (folder / "refinement.md").read_text()
    products = {name: found[0]["counts"]["f_products"] for name, found in records.items()}
    for scene in ("shear", "press", "hertz"):  # subdomains grow by a factor of four
        assert 0 < products[f"{scene}-3"] <= 2.5 * products[f"{scene}-2"]


def test_a_cold_state_takes_the_products_of_its_record() -> None:
    record = json.loads((ROOT / "benchmarks" / "refinement.json").read_text())["hertz-2"][0]
    scene = hertz(*MESHES["hertz"][1])
    assert solve_scene(scene, MPI.COMM_SELF).counts["f_products"] <= 1.05 * record["counts"]["f_products"]


def test_effects_are_replaced_when_all_are_measured(tmp_path: Path) -> None:
    records = json.loads((ROOT / "benchmarks" / "effects.json").read_text())
    effects.write(tmp_path, {"none": records["none"]}, False)
    assert (tmp_path / "effects.md").read_text() == effects.page(records)
    assert not (tmp_path / "effects.json").exists()
    effects.write(tmp_path, records, False)
    assert json.loads((tmp_path / "effects.json").read_text()) == records


def test_tables_take_their_places_in_a_page() -> None:
    page = "# A\n\n<!-- table: one -->\n\nold\n\n<!-- end -->\n\nwords\n"
    assert filled(page, {"one": "new\n"}) == page.replace("old", "new")
    with pytest.raises(ValueError, match="the page needs a place for 'two', got none: add the lines"):
        filled(page, {"two": ""})


def test_the_page_of_the_tolerances_has_the_tables_of_its_record() -> None:
    studies = json.loads((tolerance.HOME / "results.json").read_text())["studies"]
    page = (tolerance.HOME / "README.md").read_text()
    assert page == filled(page, tolerance.tables(studies))
    studies[0]["optima"][0]["products"] += 1
    assert page != filled(page, tolerance.tables(studies))
