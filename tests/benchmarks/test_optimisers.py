"""The study of optimisers is fair: one function for all, and only designs that keep the constraints count."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.optimisers import report
from benchmarks.optimisers.measuring import ALLOWED, FULL, METHODS, budget_of
from benchmarks.optimisers.report import above_best, jobs, plot, states_to, tables, write
from benchmarks.optimisers.rosenbrock import rosenbrock
from benchmarks.study import filled
from fenics_contact._base.launching import finished
from tests.conftest import ROOT


def runs() -> list[dict[str, Any]]:
    """Two methods on one problem; the second met a design that does not exist, and one outside a row."""
    common = {
        "case": "largest force, an example",
        "objective": "largest force",
        "unknowns": 100,
        "seconds": 2.0,
    }
    first = {
        **common, "method": "bundle", "value": 10.0, "violation": 0.0, "evaluations": 3, "best_evaluation": 3,
        "invalid": 0, "products": 30, "stop": "converged",
        "history": [[20.0, 0.0, 10, 0.5], [12.0, 0.0, 20, 1.0], [10.0, 0.0, 30, 2.0]],
    }  # fmt: skip
    second = {
        **common, "method": "SLSQP", "value": 11.0, "violation": 0.0, "evaluations": 4, "best_evaluation": 2,
        "invalid": 1, "products": 45, "stop": "budget spent",
        "history": [[20.0, 0.0, 10, 0.5], [11.0, 0.0, 20, 1.0], [None, 0.0, 20, 1.5], [5.0, 1.0, 45, 2.0]],
    }  # fmt: skip
    return [first, second]


def test_the_page_tells_how_far_above_the_best_and_at_what_cost(tmp_path: Path) -> None:
    (text,) = tables({"runs": runs()}).values()
    assert "## Largest force, an example" in text
    assert "| SLSQP | 11.00 | 10.000 % | none | 4 (2) | 1 | 45 | 1.50 | 1.0 | budget spent |" in text
    assert above_best(runs()[0], runs()) == 0.0
    plot(tmp_path / "optimisers.png", runs())
    assert (tmp_path / "optimisers.png").stat().st_size > 10_000


def test_states_are_counted_until_a_design_that_keeps_its_bounds_has_little_pressure() -> None:
    first, second = runs()
    assert [states_to(first, most) for most in (20.0, 12.0, 9.0)] == [1, 2, None]
    assert states_to(second, 6.0) is None, "the last design lies outside"


def test_rosenbrocks_search_follows_a_curved_valley_and_stays_in_its_box() -> None:
    tried: list[tuple[float, np.ndarray]] = []

    def valley(x: np.ndarray) -> float:
        value = float(100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2)
        tried.append((value, np.array(x)))
        return value

    box = (np.array([-1.5, -0.5]), np.array([0.8, 2.0]))
    assert rosenbrock(valley, np.array([-1.2, 1.0]), box, least=1e-6) == "converged"
    assert min(tried, key=lambda each: each[0])[1] == pytest.approx([0.8, 0.64], abs=1e-3)
    assert all((box[0] <= x).all() and (x <= box[1]).all() for _, x in tried)


def test_every_method_but_the_one_without_derivative_has_the_same_budget() -> None:
    for case in FULL:
        budgets = {method: budget_of(case, method, quick=False) for method in METHODS}
        assert budgets.pop("COBYLA") in (0, 2 * budgets["bundle"])
        budgets.pop("Rosenbrock")
        assert len(set(budgets.values())) == 1


def test_the_stored_study_has_every_problem_and_designs_that_keep_the_constraints() -> None:
    folder = ROOT / "docs" / "studies" / "optimisers"
    study = json.loads((folder / "results.json").read_text())
    expected = [(c.name, m) for c in FULL for m in METHODS if budget_of(c, m, quick=False)]
    assert [(run["case"], run["method"]) for run in study["runs"]] == expected
    for run in study["runs"]:
        assert run["violation"] <= ALLOWED
        assert run["evaluations"] == len(run["history"])
        assert len(run["design"]) == run["variables"] == (7 if "roller" in run["case"] else 28)
        assert run["value"] < np.inf
    page = (folder / "README.md").read_text()
    assert page == filled(page, tables(study))


def test_a_problem_keeps_its_numbers_until_all_its_methods_are_measured_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "plot", lambda *given: None)
    before = json.loads((ROOT / "docs" / "studies" / "optimisers" / "results.json").read_text())["runs"]
    first = {job.name: job for job in jobs(False) if job.arguments["case"] == asdict(FULL[0])}
    new = {name: [{**run, "value": 1.0, "ranks": 1}] for name, run in zip(first, before, strict=False)}
    assert [run["case"] for run in before[: len(new)]] == [FULL[0].name] * len(first)
    some = dict(list(new.items())[1:])
    for records, value in ((some, before[1]["value"]), (new, 1.0)):
        write(tmp_path, records, False)
        runs = json.loads((tmp_path / "results.json").read_text())["runs"]
        assert [(run["case"], run["method"]) for run in runs] == [
            (run["case"], run["method"]) for run in before
        ]
        assert runs[1]["value"] == value
        assert "ranks" not in runs[1]
        assert runs[len(new) :] == before[len(new) :]


@pytest.mark.slow
def test_the_quick_study_runs_from_its_first_line_to_its_last(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks", "optimisers", "--quick", "--folder", str(tmp_path)]
    ended = finished(command, 300.0, folder=ROOT)
    assert (ended.status, ended.errors) == (0, "")
    tmp_path /= "quick"
    study = json.loads((tmp_path / "results.json").read_text())
    assert [run["method"] for run in study["runs"]] == list(METHODS[:-1])
    before = {round(run["history"][0][0], 1) for run in study["runs"]}
    assert len(before) == 1, "all start from the same shape"
    assert all(run["evaluations"] <= 12 for run in study["runs"])
    assert min(run["value"] for run in study["runs"]) < 0.6 * before.pop()
    assert (tmp_path / "optimisers.png").stat().st_size > 10_000
