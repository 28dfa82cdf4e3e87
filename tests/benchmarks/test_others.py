"""The problems of others: the page is its record, references lie within bars, and cheap ones do so again."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import pytest

from benchmarks.others import large, linear, ring, warm
from benchmarks.others.report import PROBLEMS, QUICK, check, row_of, tables
from benchmarks.others.rows import Row
from benchmarks.study import filled
from fenics_contact import Scene
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "studies" / "others.md"
#: Rows whose references are of unresolved meshes, or of another body, as the page says.
EXPLAINED = (
    "u_z of the foundation on the axis, μ 0 [mm]",
    "u_z of the foundation on the axis, μ 0.1 [mm]",
    "way of the punch under 10 kN/mm [mm]",
    *(f"force on half a plate, μ {mu}, {k}/4 of the way [N/cm]" for mu in ("0", "0.4") for k in (1, 2, 3, 4)),
)


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    return json.loads(PAGE.with_suffix(".json").read_text())


def test_the_page_is_its_record_and_complete(record: dict[str, Any]) -> None:
    page = PAGE.read_text()
    assert page == filled(page, tables(record))
    assert list(record) == list(PROBLEMS)


def test_references_lie_within_the_bars(record: dict[str, Any]) -> None:
    rows = {row["quantity"]: row_of(row) for problem in record.values() for row in problem}
    missed = [name for name, row in rows.items() if not math.isnan(row.reference) and not row.agrees]
    assert sorted(missed) == sorted(EXPLAINED)
    assert sum(row.agrees for row in rows.values()) >= 10
    assert len(check({name: [{"rows": rows}] for name, rows in record.items()})) == len(EXPLAINED)


def test_the_peak_at_the_rounded_edge_has_a_small_bar_and_takes_few_products(record: dict[str, Any]) -> None:
    peaks = [row_of(row) for row in record["punch"] if "largest pressure" in row["quantity"]]
    assert len(peaks) == 2
    for row in peaks:
        assert row.error <= 0.005 * row.value
        assert row.products == max(products for _, products in row.levels) <= 60
    assert peaks[0].value == pytest.approx(910.4, rel=2e-3)  # graded quadratic meshes


@pytest.mark.slow
def test_code_asters_force_on_the_plate_has_a_support_in_it() -> None:
    """Nine digits of two sums and two displacements, with friction, which it prints."""
    row = ring.printed_row(0.4)
    assert row.value == pytest.approx(33.4798287993, rel=1e-9)
    assert row.levels[0][0] == pytest.approx(22.865, abs=1e-3)


@pytest.mark.parametrize("name", QUICK)
def test_a_cheap_problem_is_what_the_record_says(record: dict[str, Any], name: str) -> None:
    found = PROBLEMS[name].rows()
    assert found
    for row, stored in zip(found, map(row_of, record[name]), strict=True):
        assert row.agrees
        assert (row.quantity, row.unknowns) == (stored.quantity, stored.unknowns)
        assert row.value == pytest.approx(stored.value, abs=stored.error)


def test_a_reference_outside_of_the_bar_is_found() -> None:
    row = Row("force [N]", 1.0, 0.01, reference=1.02, source="theory")
    assert not row.agrees
    assert check({"pin": [{"rows": [row.record]}]}) == ["pin: force [N] is 1 ± 0.01, not 1.02"]


@pytest.mark.parametrize(
    "scene",
    [
        lambda: linear.roller(0.1), lambda: linear.punch(0.1), linear.pin, linear.flat_punch,
        lambda: linear.tube(1e-3), lambda: large.rubber_cylinder(4),
        lambda: ring.ring(ring.quarter((2, 8)), 0.4),
    ],
)  # fmt: skip
def test_each_scene_has_a_plan(scene: Callable[[], Scene]) -> None:
    made = scene()
    assert len(made.contacts) == 1
    assert made.plan() is not None
    assert warm.joint().contacts


@pytest.mark.claim
@pytest.mark.parametrize("name", ["pin", "roller", "flat punch", "rubber", "ring"])
def test_a_problem_is_what_the_record_says(record: dict[str, Any], name: str) -> None:
    for row, stored in zip(PROBLEMS[name].rows(), map(row_of, record[name]), strict=True):
        assert row.value == pytest.approx(stored.value, abs=row.error + stored.error)
        assert math.isnan(row.reference) or row.agrees or row.quantity in EXPLAINED


@pytest.mark.claim
@pytest.mark.slow
def test_the_punch_is_what_the_record_says(record: dict[str, Any]) -> None:
    for row, stored in zip(PROBLEMS["punch"].rows(), map(row_of, record["punch"]), strict=True):
        assert row.value == pytest.approx(stored.value, abs=row.error + stored.error)
        assert row.products <= 60
