"""The table of results: every row, in the agreed form, from whatever was measured."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.comparing import force_difference, potential_difference, require_agreement
from benchmarks.held import HELD
from benchmarks.plan import OPTIONAL, runs
from benchmarks.plot import plot_results
from benchmarks.report import broken, results, work
from benchmarks.speed import summaries_of, write_results
from benchmarks.targets import ROWS
from fenics_contact.errors import InvalidInputError
from tests.benchmarks.small_records import all_summaries, record

FIELDS = ["name", "quantity", "value", "unit", "target", "better", "ranks", "unknowns"]


def test_every_row_has_a_record_in_the_agreed_form(tmp_path: Path) -> None:
    write_results(tmp_path, all_summaries())
    assert results(all_summaries())[1] == []
    records = json.loads((tmp_path / "results.json").read_text())
    assert [entry["name"] for entry in records] == [row.name for row in ROWS]
    for entry in records:
        assert list(entry) == FIELDS
        assert isinstance(entry["value"], float | int)
        assert entry["better"] in ("lower", "higher")
        assert entry["ranks"] > 0
        assert entry["unknowns"] == 1000


def test_the_targets_are_those_that_were_set() -> None:
    targets = {row.name: (row.target, row.better) for row in ROWS}
    assert len(targets) == len(ROWS)
    assert targets == {
        "products": (90, "lower"),
        "products-friction-0.1": (130, "lower"),
        "products-friction-0.6": (130, "lower"),
        "friction-0.01": (1, "higher"),
        "friction-0": (1, "higher"),
        "products-refined": (150, "lower"),
        "products-over-linear": (2, "lower"),
        "products-frictionless": (27, "lower"),
        "cold-state": (6, "lower"),
        "design-step": (0.4, "lower"),
        "optimisation": (60, "lower"),
        "newton-seconds": (15, "higher"),
        "newton-memory": (0.25, "lower"),
        "gamg-seconds": (1.67, "higher"),
        "gamg-part": (1, "higher"),
        "cholesky-seconds": (1, "higher"),
        "default-partition": (1.2, "lower"),
        "default-partition-chain": (1.2, "lower"),
        "products-equal": (90, "lower"),
        "products-tetrahedra": (90, "lower"),
        "tetrahedra": (1.2, "lower"),
        "growth": (1.5, "lower"),
        "memory": (6, "lower"),
        "efficiency": (0.85, "higher"),
        "efficiency-solve": (0.85, "higher"),
        "potential-ranks": (1e-8, "lower"),
        "forces-ranks": (1e-6, "lower"),
        "potential-partitions": (1e-8, "lower"),
        "forces-partitions": (1e-6, "lower"),
    }


def test_a_row_is_met_on_the_right_side_of_its_target() -> None:
    row = ROWS[0]
    assert row.met(90)
    assert not row.met(91)
    assert replace(row, better="higher").met(91)


def test_rows_whose_runs_are_missing_are_named_and_left_out(tmp_path: Path) -> None:
    every = all_summaries()
    summaries = {name: every[name] for name in ("chain", "linear-face")}
    found, missing = results(summaries)
    assert [row.name for row, _ in found] == ["products", "products-over-linear", "cold-state"]
    assert len(missing) == len(ROWS) - 3
    write_results(tmp_path, summaries)
    assert "Not measured or refused: products-friction-0.1" in (tmp_path / "results.md").read_text()


def test_a_run_that_was_refused_has_no_products() -> None:
    summaries = all_summaries()
    summaries["chain-friction-0.1"] = summaries["chain-friction-0"]
    _, missing = results(summaries)
    assert missing == ["products-friction-0.1"]


@pytest.mark.parametrize(("error", "value"), [("InfeasibleError", 1.0), ("ConvergenceError", 0.0)])
def test_only_a_refusal_by_name_counts(error: str, value: float) -> None:
    summaries = all_summaries()
    summaries["chain-friction-0"] = {**summaries["chain-friction-0"], "refused": error}
    values = {row.name: entry["value"] for row, entry in results(summaries)[0]}
    assert values["friction-0"] == value
    assert values["friction-0.01"] == 1.0


def test_the_table_says_what_was_not_met(tmp_path: Path) -> None:
    summaries = all_summaries()
    counts = {"torn_unknowns": 1000, "f_products": 91, "kinds": 4, "subdomains": 54}
    summaries["chain"] = record(counts=counts)
    write_results(tmp_path, summaries)
    assert "\n| chain | 2 | 1000 | 4 of 54 | 91 |" in (tmp_path / "results.md").read_text()
    (line,) = (line for line in (tmp_path / "results.md").read_text().splitlines() if "μ = 0.3" in line)
    assert "| 91 products | ≤ 90 | **no** |" in line


def test_results_that_cannot_be_written_whole_leave_those_that_are_there(tmp_path: Path) -> None:
    write_results(tmp_path, all_summaries())
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(before) == {"results.md", "results.png", "results.json"}
    wrong = all_summaries()
    wrong["block-92k"] = record(total_potential=-3.0)
    with pytest.raises(ValueError, match="the problems differ"):
        write_results(tmp_path, wrong)
    unfit = all_summaries()
    unfit["chain"] = record(seconds=float("nan"))
    with pytest.raises(InvalidInputError):
        write_results(tmp_path, unfit)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_default_partition_counts_only_with_the_same_answer() -> None:
    summaries = all_summaries()
    summaries["block-92k"] = record(seconds=3.0)
    values = {row.name: entry["value"] for row, entry in results(summaries)[0]}
    assert values["default-partition"] == 1.5
    summaries["block-92k-boxes"] = record(total_potential=-2.1)
    with pytest.raises(ValueError, match="both solvers of block-92k-boxes must find the same state"):
        results(summaries)


def test_a_linear_solve_is_held_against_the_whole_state() -> None:
    summaries = all_summaries()
    summaries["gamg-92k"], summaries["cholesky-92k"] = record(seconds=3.0), record(seconds=1.0)
    values = {row.name: entry["value"] for row, entry in results(summaries)[0]}
    assert (values["gamg-seconds"], values["cholesky-seconds"]) == (1.5, 0.5)


def test_every_quick_run_is_held_but_the_one_that_may_be_skipped() -> None:
    assert {run.name for run in runs(quick=True)} - set(HELD) == {OPTIONAL}
    assert set(HELD) <= {run.name for run in runs()}


def test_more_work_or_another_size_breaks_what_is_held() -> None:
    held = HELD["chain"]

    def found(unknowns: int, products: int) -> list[str]:
        counts = {"torn_unknowns": unknowns, "f_products": products}
        return broken({"chain": record(counts=counts)})

    assert found(held.unknowns, held.work) == found(held.unknowns, held.work - 10) == []
    assert found(held.unknowns, held.work + 1) == [], "another BLAS rounds differently"
    assert "chain must have 66528 unknowns and take 41 products" in found(held.unknowns, 2 * held.work)[0]
    assert len(found(held.unknowns - 1, held.work)) == 1
    assert broken({"chain": {"skipped": "no gmsh"}}) == []


@pytest.mark.parametrize("name", ["f_products", "products", "newton_steps", "iterations"])
def test_the_work_of_a_run_is_what_it_counts(name: str) -> None:
    assert work({"counts": {"unknowns": 3, name: 7}}) == 7


def test_differences_are_relative() -> None:
    other = record(total_potential=-2.2, forces=[[0.0, 0.0, 3.0], [0.0, 3.0, 0.0]])
    assert potential_difference(record(), other) == pytest.approx(0.1)
    assert force_difference(record(), other) == pytest.approx(0.2)
    with pytest.raises(ValueError, match="same contact nodes, got 2 and 1: use the same mesh"):
        force_difference(record(), record(forces=[[0.0, 0.0, 1.0]]))


def test_solvers_that_disagree_are_not_compared() -> None:
    with pytest.raises(ValueError, match=r"both solvers of block must find .*the problems differ"):
        require_agreement("block", record(), record(total_potential=-2.1))


@pytest.mark.parametrize("names", [None, ["chain", "block-28k"]])
def test_the_picture_is_drawn_from_all_runs_and_from_few(tmp_path: Path, names: list[str] | None) -> None:
    every = all_summaries()
    plot_results(tmp_path / "results.png", every if names is None else {n: every[n] for n in names})
    assert (tmp_path / "results.png").stat().st_size > 10_000


def test_iterations_of_petsc_s_multigrid_are_the_middle_ones() -> None:
    found = [record(counts={"unknowns": 9, "iterations": count}) for count in (12, 10, 11)]
    assert summaries_of({"gamg-28k": found})["gamg-28k"]["counts"]["iterations"] == 11
    with pytest.raises(ValueError, match="counts of cholesky-28k must be equal in all repetitions"):
        summaries_of({"cholesky-28k": found})
