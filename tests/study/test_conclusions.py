"""What is concluded from runs: errors, rates, what accuracies take, what settings cost, certificates."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from fenics_contact.study import BALANCED, Errors, Run, accuracy_table, cost_table
from fenics_contact.study.figures import pareto_front
from fenics_contact.study.report import reliable
from fenics_contact.study.results import check_certificates
from tests.study.samples import BASE, results, run


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
