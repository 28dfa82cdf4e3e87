"""Studies: parameters, protocol, conclusions and report."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.studies_page import studies_page
from fenics_contact.errors import InvalidInputError
from fenics_contact.study import (
    BALANCED,
    Errors,
    Parameters,
    Run,
    Sweep,
    accuracy_table,
    cost_table,
    read_study,
    write_report,
)
from fenics_contact.study.figures import pareto_front
from fenics_contact.study.report import reliable, table_page
from fenics_contact.study.results import check_certificates, extrapolate, measured_rate
from fenics_contact.study.scenes import find_study
from tests.conftest import ROOT
from tests.pictures.states import contains, pixels
from tests.study.samples import BASE, results, run


def test_results_survive_their_file(tmp_path: Path) -> None:
    known = results()
    words = write_report(tmp_path, known, figures=False)
    assert read_study(tmp_path) == known
    assert read_study(tmp_path / "study.json") == known
    assert write_report(tmp_path, read_study(tmp_path), figures=False) == words
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.json", "table.md"]


def test_the_table_has_answers_rates_certificates_runs_and_failures(tmp_path: Path) -> None:
    write_report(tmp_path, results(), figures=False)
    text = (tmp_path / "table.md").read_text()
    assert "(size: cells on the radius; on 2 ranks)" in text
    assert "| peak pressure | 2 %, 1 % | 4 | hexahedron |" in text
    assert "| 1e-08 | balanced | 8 | 9.6 | 1.50 |" in text
    assert "| peak pressure | theory |  | 2.00 | 1.00 |" in text
    assert "| energy | extrapolated | -10 N mm | 2.00 | 2.00 |" in text
    assert "finest mesh: several numbers are not extrapolated" in text
    assert "between 2.00 and 2.00 times the true error in 6 runs" in text
    assert "- size 8, tetrahedron, node, balanced: ConvergenceError: it did not converge" in text
    (row,) = [line for line in text.splitlines() if line.startswith("| 4 | hexahedron | mortar | 1e-08 ")]
    assert "| newton | 4 | 6400 | 80 | 2.40 | 100 | 1.0e-02 |" in row


def test_figures_show_every_way_to_spend_time(tmp_path: Path) -> None:
    known = results()
    more = replace(run(4), parameters=replace(run(4).parameters, cell="tetrahedron"))
    write_report(tmp_path, replace(known, runs=(*known.runs, more)))
    pictures = {path.stem: pixels(path) for path in tmp_path.glob("*.png")}
    assert pictures.keys() == {"accuracy", "convergence", "parts", "phases"}
    for colour in ("#0072b2", "#d55e00", "#009e73", "#222222"):  # balanced, strict, tetrahedra, Pareto front
        assert contains(pictures["accuracy"], colour)
    assert contains(pictures["convergence"], "#d55e00")
    assert contains(pictures["parts"], "#0072b2")
    assert contains(pictures["phases"], "#4466aa")


def test_results_that_are_not_there_or_not_whole_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"study\.json does not exist: run the study first"):
        read_study(tmp_path)
    (tmp_path / "study.json").write_text('{"scene": {}}')
    with pytest.raises(InvalidInputError, match=r"must hold a study, got .* run it again"):
        read_study(tmp_path)


def test_the_page_of_all_studies_takes_its_numbers_from_them(tmp_path: Path) -> None:
    for name in ("first", "second"):
        write_report(tmp_path / name, results(), figures=False)
    text = studies_page(tmp_path)
    assert text.count("## A sample") == 2
    assert "![accuracy](second/accuracy.png)" in text
    assert "| peak pressure | 2 %, 1 % | 4 | hexahedron |" in text
    assert "[All 7 runs](second/table.md)" in text
    assert "| energy | extrapolated | -10 N mm | 2.00 | 2.00 |" in text
    assert "| error of the displacement | its own estimate |  | 1.00 | 1.00 |" in text
    assert text.count("lies between 2.00 and 2.00 times the true error in 6 runs") == 2


def test_the_stored_pages_are_those_of_the_stored_results() -> None:
    folder = ROOT / "docs" / "studies"
    found = sorted(folder.glob("*/study.json"))
    assert len(found) == 3
    for file in found:
        assert file.with_name("table.md").read_text() == table_page(Errors(read_study(file)))
    assert (folder / "README.md").read_text() == studies_page(folder)


def test_a_page_of_no_studies_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"a page of studies needs some, .* holds none: run a study"):
        studies_page(tmp_path)


def test_figures_need_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fenics_contact.study import figures

    monkeypatch.chdir(tmp_path)
    known = Errors(results())
    for draw in (figures.plot_accuracy, figures.plot_convergence, figures.plot_parts, figures.plot_phases):
        picture = draw(known)
        assert picture.png is not None
        assert picture.path is None
        assert len(picture.png) > 10_000
    assert not list(tmp_path.iterdir())


# Settings of runs, and the runs that a sweep makes of them.
@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("size", 0, "size must be a positive integer, got 0"),
        ("cell", "cube", r"cell must be one of \['hexahedron', .*got 'cube'"),
        ("discretisation", "dual", r"discretisation must be one of \['node', 'mortar'\], got 'dual'"),
        ("tolerance", 2.0, 'tolerance must be a number between 0 and 1, or "balanced", got 2.0'),
        ("tolerance", "tight", "or \"balanced\", got 'tight'"),
        ("solver", "cg", r"solver must be one of \['newton', 'fixed point'\], got 'cg'"),
        ("subdomains", 0, "subdomains must be a positive integer, or None, got 0"),
    ],
)
def test_a_setting_that_no_scene_knows_is_refused(name: str, value: Any, allowed: str) -> None:
    with pytest.raises(InvalidInputError, match=allowed):
        Parameters(**{"size": 2, name: value})


def test_settings_survive_json() -> None:
    for given in (Parameters(3), Parameters(2, "tetrahedron", "mortar", 1e-3, "fixed point", 8)):
        assert Parameters(**json.loads(json.dumps(given.as_dict()))) == given


def test_settings_are_told_in_a_few_words() -> None:
    assert str(Parameters(2)) == "size 2, hexahedron, node, balanced"
    other = Parameters(2, tolerance=1e-3, solver="fixed point", subdomains=8)
    assert str(other) == "size 2, hexahedron, node, 1e-03, fixed point, 8 subdomains"


def test_a_sweep_varies_one_setting_at_a_time_and_mesh_with_tolerance() -> None:
    sweep = Sweep(
        Parameters(4),
        sizes=(2, 4),
        tolerances=(1e-2, 1e-8, BALANCED),
        cells=("tetrahedron",),
        discretisations=("mortar",),
        fixed_points=(1e-4,),
        subdomains=(8,),
    )
    runs = sweep.runs()
    assert len(runs) == len(set(runs)) == 6 + 2 + 2 + 1 + 1
    assert [run.size for run in runs] == sorted(run.size for run in runs)
    assert {(run.size, run.tolerance) for run in runs} >= {
        (n, t) for n in (2, 4) for t in (1e-2, 1e-8, BALANCED)
    }
    apart = [run.differences(sweep.base) for run in runs]
    assert max(len(set(names) - {"size", "tolerance"}) for names in apart) == 1
    assert ("tolerance", "solver") in apart


# What a scene must offer to be studied.
def test_a_study_without_anything_to_measure_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="a study needs at least one quantity, got none: give what"):
        replace(find_study("hertz"), quantities=())


def test_quantities_of_one_name_are_refused() -> None:
    study = find_study("hertz")
    with pytest.raises(InvalidInputError, match=r"quantities must have different names, got .*: rename one"):
        replace(study, quantities=study.quantities[:1] * 2)


@pytest.mark.parametrize("name", ["", "my/scene", "a b"])
def test_a_name_that_no_file_can_bear_is_refused(name: str) -> None:
    with pytest.raises(InvalidInputError, match=r"a study's name must be of letters, digits and _, got "):
        replace(find_study("hertz"), name=name)


def test_facts_hold_every_mesh_size_that_occurs() -> None:
    study = find_study("chain_links")
    facts = study.facts
    assert set(facts.spacing) == {run.size for run in (*study.sweep.runs(), *study.quick.runs())}
    assert facts.spacing[4] == pytest.approx(2.0)  # mm, through the wire
    assert facts.quantity("gradient").phases == ("objective", "adjoint", "gradient")
    assert facts.quantity("gradient").source == ""


# What is concluded from runs: errors, rates, what accuracies take, what settings cost, certificates.
def test_the_front_holds_what_nothing_else_beats() -> None:
    seconds = [1.0, 2.0, 3.0, 1.5, 4.0, 1.0]
    errors = [0.5, 0.1, 0.2, 0.6, 0.01, 0.7]
    assert pareto_front(seconds, errors) == [0, 1, 4]
    assert pareto_front([], []) == []


def test_errors_are_against_theory_the_limit_of_the_meshes_or_the_finest_of_them() -> None:
    errors = Errors(results())
    kinds = {name: reference.kind for name, reference in errors.references.items()}
    assert kinds == {"peak pressure": "theory", "energy": "extrapolated", "gradient": "finest mesh"}
    assert errors.references["energy"].value == pytest.approx(-10.0)
    assert errors.references["energy"].rate == pytest.approx(2.0)
    coarse, finest = errors.results.runs[0], errors.results.runs[-2]
    assert (coarse.parameters.size, finest.parameters.size) == (2, 8)
    assert errors.of(coarse, "peak pressure") == pytest.approx(0.04)
    assert errors.of(coarse, "energy") == pytest.approx(0.025)
    assert errors.of(coarse, "gradient") == pytest.approx(0.375 / (1.125**2 + 4) ** 0.5)
    assert errors.of(finest, "gradient") is None, "the finest mesh cannot be judged by itself"
    assert errors.of(errors.results.runs[-1], "energy") is None, "a failed run has no error"
    cut = replace(finest, parameters=replace(finest.parameters, subdomains=64))
    assert errors.of(cut, "gradient") is None, "nor by another partition of it"


def test_a_sequence_that_does_not_converge_says_why_it_is_not_extrapolated() -> None:
    runs = [run(size, 1e-8) for size in (2, 4, 8)]
    runs[1] = replace(runs[1], quantities={"energy": {"value": -20.0}})
    reference = Errors(results(runs)).references["energy"]
    assert (reference.kind, reference.value) == ("finest mesh", -10.0 + 1 / 64)
    assert "does not converge monotonically" in reference.note


def test_rates_are_those_of_the_strictest_tolerance() -> None:
    errors = Errors(results())
    strict = errors.strictest(BASE)
    assert strict.tolerance == 1e-8
    assert errors.rate(strict, "peak pressure") == pytest.approx(2.0)


def test_an_accuracy_takes_the_fastest_run_that_reaches_it() -> None:
    lines = accuracy_table(Errors(results()), targets=(0.1, 0.05, 0.01, 0.001)).splitlines()
    assert lines[2:5] == [
        "| peak pressure | 10 %, 5 % | 2 | hexahedron | mortar | balanced | newton | 2 | 0.4 | 4 % |",
        "| peak pressure | 1 % | 4 | hexahedron | mortar | balanced | newton | 4 | 1.6 | 1 % |",
        "| peak pressure | 0.1 % | 8 | hexahedron | mortar | 1e-08 | newton | 8 | 9.6 "
        "| 0.25 %: not reached |",
    ]


def test_an_accuracy_of_which_nothing_is_known_is_told() -> None:
    alone = Errors(results([run(8)]))
    lines = [line for line in accuracy_table(alone).splitlines() if line.startswith("| gradient |")]
    assert len(lines) == 1
    assert lines[0].endswith("| nothing to compare with |")


def test_what_comes_after_the_state_counts_for_quantities_that_need_it() -> None:
    found = results()
    coarse = found.runs[0]
    gradient, energy = found.scene.quantity("gradient"), found.scene.quantity("energy")
    assert coarse.seconds_of(gradient) == pytest.approx(coarse.seconds_of(energy) + 0.5)


def cost_lines(*runs: Run) -> list[str]:
    return cost_table(Errors(results(runs))).splitlines()[2:]


def test_a_strict_tolerance_is_told_by_what_it_costs_and_changes() -> None:
    runs = [run(size, tolerance) for size in (2, 4, 8) for tolerance in (1e-8, BALANCED)]
    runs[-1] = run(8, error=0.0025 + 1e-5)
    assert cost_lines(*runs) == [
        "| 1e-08 | balanced | 8 | 9.6 | 1.50 | 1.60 | 0.25 % | 0.25 % | 1e-05 | 0e+00 |  |"
    ]


def varied(seconds: float, error: float | None = None, **settings: Any) -> Run:
    known = run(4, settings.get("tolerance", BALANCED), seconds=seconds, error=error)
    counts = {**(known.counts or {}), "subdomains": settings.get("subdomains") or 4}
    return replace(known, parameters=replace(known.parameters, **settings), counts=counts)


def test_other_settings_are_told_by_what_they_cost_and_give() -> None:
    runs = [
        varied(2.0, 0.01),
        varied(3.0, tolerance=1e-6),
        varied(6.0, tolerance=1e-6, solver="fixed point"),
        varied(1.0, subdomains=2),
        varied(8.0, subdomains=16),
        varied(3.0, 0.05, cell="tetrahedron"),
        varied(1.0, 0.25, discretisation="node"),
    ]
    lines = [" | ".join(line.split(" | ")[:8]) for line in cost_lines(*runs)]
    assert lines == [
        "| 1e-06 | balanced | 4 | 3 | 1.50 | 1.60 | 1 % | 1 %",
        "| fixed point, 1e-06 | newton, 1e-06 | 4 | 6 | 2.00 | 1.00 | 1 % | 1 %",
        "| 2 subdomains | 4 subdomains | 4 | 1 | 0.50 | 1.00 | 1 % | 1 %",
        "| 16 subdomains | 4 subdomains | 4 | 8 | 4.00 | 1.00 | 1 % | 1 %",
        "| tetrahedron | hexahedron | 4 | 3 | 1.50 | 1.00 | 5 % | 1 %",
        "| node | mortar | 4 | 1 | 0.50 | 1.00 | 25 % | 1 %",
    ]


def test_an_error_that_is_small_by_chance_does_not_count() -> None:
    runs = [run(2), run(4, error=0.0), run(8, error=0.02)]
    errors = Errors(results(runs))
    assert not reliable(errors, runs[1], "peak pressure", 0.01)
    assert reliable(errors, runs[1], "peak pressure", 0.02)
    (line,) = [line for line in accuracy_table(errors, (0.01,)).splitlines() if "peak pressure" in line]
    assert line.endswith("| 2 %: not reached |")


def test_certificates_are_compared_with_true_errors() -> None:
    check = check_certificates(results())
    assert (check.checked, check.unknown, check.broken) == (6, 0, ())
    assert check.smallest_factor == check.largest_factor == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("bound", "words"), [(5e-4, "is below the true error"), (5e-2, "more than 10 times the true error")]
)
def test_a_broken_certificate_is_told(bound: float, words: str) -> None:
    broken = run(4)
    parts = {**(broken.parts or {}), "algebraic": bound}
    check = check_certificates(results([run(2), replace(broken, parts=parts)]))
    assert len(check.broken) == 1
    assert "size 4, hexahedron, mortar, balanced" in check.broken[0]
    assert words in check.broken[0]


def test_a_run_without_certificate_is_not_counted_as_checked() -> None:
    check = check_certificates(results([replace(run(2), parts=None)]))
    assert (check.checked, check.unknown, check.largest_factor) == (0, 1, None)


# Extrapolation to mesh size zero: exact for powers, refused for what does not converge.
@pytest.mark.parametrize("rate", [0.5, 1.0, 2.0, 3.5])
@pytest.mark.parametrize("spacing", [(1.0, 0.5, 0.25), (0.5, 1 / 3, 0.25, 1 / 6)])
def test_a_power_is_extrapolated_exactly_with_its_rate(rate: float, spacing: tuple[float, ...]) -> None:
    found = extrapolate(spacing, [-3.0 + 0.7 * h**rate for h in spacing])
    assert not found.refused
    assert found.value == pytest.approx(-3.0, abs=1e-9)
    assert found.rate == pytest.approx(rate, abs=1e-9)


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ((1.0, 2.0), "three meshes are needed, there are 2"),
        ((1.0, 2.0, 1.5), "does not converge monotonically"),
        ((1.0, 2.0, 3.5), "changes from mesh to mesh do not fall"),
        ((1.0, 2.0, 2.0 + 1e-6), "fall too fast"),
        ((2.0, 2.0, 2.0), "the meshes give the same"),
    ],
)
def test_what_does_not_converge_like_a_power_is_refused_with_the_reason(
    values: tuple[float, ...], reason: str
) -> None:
    found = extrapolate([1.0, 0.5, 0.25][: len(values)], values)
    assert reason in found.refused
    assert found.value == values[-1]
    assert found.rate is None


def test_the_rate_of_errors_is_that_of_the_three_finest_meshes() -> None:
    h = np.array([1.0, 0.5, 0.25, 0.125])
    errors = 3.0 * h**1.5
    errors[0] = 1.0
    assert measured_rate(h, errors) == pytest.approx(1.5)
    assert measured_rate(h[:1], errors[:1]) is None
    assert measured_rate(h, np.zeros(4)) is None
