"""The driver: which runs it chooses, what it keeps, and what it says when something is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.__main__ import main
from benchmarks.plan import Run, all_runs, chosen
from benchmarks.running import RunFailed, fingerprint, measure, raw_file, read

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
        "block-92k",
        "block-212k",
        "getfem-28k",
    ]


def test_the_quick_benchmark_is_a_part_of_the_full_one() -> None:
    quick, full = chosen([], quick=True), chosen([], quick=False)
    assert 0 < len(quick) < len(full) == len(all_runs())


def test_an_unknown_name_is_refused_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--only", "chian"])
    assert "or how it begins, got 'chian': use one of chain, chain-1-rank" in capsys.readouterr().err


def test_a_run_leaves_its_record_with_the_load_of_the_machine() -> None:
    record = measure(Run("tiny", "newton_block", 1, TINY))
    assert record["counts"]["unknowns"] == 135
    assert record["peak_memory"] > record["import_memory"] > 0
    assert record["load_average"] >= 0


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
    path.parent.mkdir()
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
