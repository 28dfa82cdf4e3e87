"""The driver: which runs it chooses, what it keeps, and what it says when something is wrong."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from benchmarks import __main__ as driver
from benchmarks.__main__ import main
from benchmarks.cases.chain import cold_state
from benchmarks.cases.linear_face import solve_face
from benchmarks.cases.monolithic.elasticity import assemble_block
from benchmarks.cases.monolithic.linear import solve_linear
from benchmarks.held import HELD
from benchmarks.plan import Run, all_runs, chosen
from benchmarks.running import RunFailed, fingerprint, measure, raw_file, read
from fenics_contact.launching import finished
from tests.benchmarks.small_records import all_summaries
from tests.conftest import LAUNCH, ROOT

TINY = ("--counts", "4", "2", "2")


def test_every_run_belongs_to_a_case_and_has_a_name_of_its_own() -> None:
    runs = all_runs()
    assert len({run.name for run in runs}) == len(runs) > 20
    cases = Path(__file__).parents[2] / "benchmarks" / "cases"
    assert [run.case for run in runs if not (cases / f"{run.case}.py").exists()] == []


def test_a_name_chooses_its_run_and_a_beginning_all_runs_that_have_it() -> None:
    assert [run.name for run in chosen(["chain"], quick=False)] == ["chain"]
    assert [run.name for run in chosen(["block", "getfem"], quick=False)] == [
        "block-28k",
        "block-28k-default",
        "block-92k",
        "block-92k-default",
        "block-212k",
        "block-212k-default",
        "getfem-28k",
    ]


def test_the_quick_benchmark_is_a_part_of_the_full_one() -> None:
    quick, full = chosen([], quick=True), chosen([], quick=False)
    assert 0 < len(quick) < len(full) == len(all_runs())
    assert {run.name for run in quick} < {run.name for run in full}
    assert {run.repeats for run in quick} == {1} < {run.repeats for run in full}


def test_an_unknown_name_is_refused_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--only", "chian"])
    assert "or how it begins, got 'chian': use one of chain, chain-1-rank" in capsys.readouterr().err


def test_a_run_leaves_its_record_with_the_load_of_the_machine() -> None:
    record = measure(Run("tiny", "newton_block", 1, TINY))
    assert record["counts"]["unknowns"] == 135
    assert record["peak_memory"] > record["import_memory"] > 0
    assert record["load_average"] >= 0


def test_a_run_on_several_threads_has_them() -> None:
    record = measure(Run("tiny", "linear_block", 1, (*TINY, "--solver", "gamg"), threads=2))
    assert record["counts"]["unknowns"] == 135
    script = "import os, sys; sys.stdout.write(os.environ['OPENBLAS_NUM_THREADS'])"
    command = [str(LAUNCH), "1", "OPENBLAS_NUM_THREADS=2", sys.executable, "-c", script]
    assert finished(command, 60.0).output == "2"


def test_a_run_without_end_is_ended() -> None:
    with pytest.raises(RunFailed, match=r"tiny must end within 0\.1 s, and did not"):
        measure(Run("tiny", "newton_block", 1, TINY, seconds=0.1))


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks").rglob("*.py")), ids=lambda path: path.stem)
def test_every_module_has_what_it_imports(path: Path) -> None:
    parts = path.relative_to(ROOT).with_suffix("").parts
    importlib.import_module(".".join(parts[:-1] if parts[-1] == "__init__" else parts))


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


def test_a_case_that_fails_is_reported_with_its_output() -> None:
    with pytest.raises(RunFailed, match=r"tiny must print one JSON .* exit status 2 (?s:.*)--counts"):
        measure(Run("tiny", "newton_block", 1))


def test_a_case_that_fails_on_several_ranks_ends() -> None:
    options = (*TINY, "--boxes", "9", "9", "9")
    with pytest.raises(RunFailed, match="boxes"):
        measure(Run("tiny", "sliding_block", 2, options, seconds=60.0))


def test_raw_results_are_read_again_for_the_same_code_only(tmp_path: Path) -> None:
    run = Run("tiny", "newton_block")
    path = raw_file(run, "this", 1, tmp_path)
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps({"seconds": 1.0}))
    assert read(run, "this", tmp_path) == [{"seconds": 1.0}]
    assert read(run, "other", tmp_path) == []


def test_the_fingerprint_follows_the_code_that_is_measured(tmp_path: Path) -> None:
    (tmp_path / "fenics_contact").mkdir()
    (tmp_path / "fenics_contact" / "a.py").write_text("x = 1\n")
    before = fingerprint(tmp_path)
    (tmp_path / "README.md").write_text("words\n")
    assert fingerprint(tmp_path) == before
    (tmp_path / "fenics_contact" / "a.py").write_text("x = 2\n")
    assert fingerprint(tmp_path) != before


@pytest.fixture
def main_with(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Return the driver with made-up measurements; names given fail. The full results are in ``full``."""
    monkeypatch.setattr(driver, "FOLDER", tmp_path / "full")

    def run(*arguments: str, failing: tuple[str, ...] = (), **changes: Any) -> None:
        def measured(run: Run) -> dict[str, Any]:
            if run.name in failing:
                raise RunFailed(f"{run.name} must print one JSON object")
            record: dict[str, Any] = dict(all_summaries().get(run.name, {}))
            if run.name in HELD:
                held = HELD[run.name]
                record["counts"] = {**record["counts"], "unknowns": held.unknowns, "f_products": held.work}
            return {**record, **changes}

        monkeypatch.setattr(driver, "measure", measured)
        main([*arguments, "--folder", str(tmp_path)])

    return run


def test_a_complete_benchmark_replaces_results(main_with: Any, tmp_path: Path) -> None:
    main_with(seconds=2.0)
    before = (tmp_path / "full" / "results.json").read_text()
    main_with("--again", seconds=3.0)
    assert (tmp_path / "full" / "results.json").read_text() != before
    assert not (tmp_path / "partial").exists()


@pytest.mark.parametrize("arguments", [["--quick"], []], ids=["quick", "full"])
def test_a_failing_benchmark_leaves_good_results(
    arguments: list[str], main_with: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main_with(*arguments)
    folder = tmp_path / ("quick" if arguments else "full")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert len(before) == 3
    with pytest.raises(SystemExit, match="failed: linear-face"):
        main_with(*arguments, "--again", failing=("linear-face",), seconds=5.0)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert (tmp_path / "partial" / "results.json").exists()
    assert "linear-face must print one JSON object" in capsys.readouterr().err


def test_a_few_runs_leave_good_results(main_with: Any, tmp_path: Path) -> None:
    main_with("--only", "chain", "block")
    assert (tmp_path / "partial" / "results.md").exists()
    assert not (tmp_path / "full").exists()


def test_counts_that_are_not_kept_fail_the_benchmark(main_with: Any, tmp_path: Path) -> None:
    counts = {"torn_unknowns": 66528, "f_products": 1000, "linear_products": 2, "newton_steps": 5}
    with pytest.raises(SystemExit, match="chain must have 66528 unknowns and take 90 products or steps, got"):
        main_with("--quick", counts=counts)
    assert not (tmp_path / "quick").exists()
