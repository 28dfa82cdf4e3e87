"""The problems of others: the page is its record, references lie within bars, and cheap ones do so again."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.others import fretting, large, linear, plastic, ring, warm
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
    # Graded quadratic meshes of 42 to 59 thousand unknowns, other than those of the rows by quadratic cells.
    assert peaks[0].value == pytest.approx(910.31, rel=1e-3)
    assert peaks[1].value == pytest.approx(899.79, rel=1e-3)


def test_the_peak_by_quadratic_cells_is_that_by_linear_ones(record: dict[str, Any]) -> None:
    rows = {row["quantity"]: row_of(row) for row in record["punch"]}
    for friction in ("0", "0.1"):
        check = rows[f"the same by quadratic cells, μ {friction} [N/mm²]"]
        linear = rows[f"largest pressure, at the edge, μ {friction} [N/mm²]"]
        assert linear.reference == check.value
        assert check.error <= 0.002 * check.value
        assert check.unknowns < linear.unknowns
        assert check.products <= 60


def test_the_half_plane_sinks_by_flamants_field_in_equilibrium() -> None:
    step, nu = 0.01, 0.3

    def stress(x: float, y: float) -> np.ndarray:
        ends = np.array([[x + step, y], [x - step, y], [x, y + step], [x, y - step]])
        moved = linear.of_half_plane(ends)
        slope = np.column_stack([moved[0] - moved[1], moved[2] - moved[3]]) / (2.0 * step)
        strain = 0.5 * (slope + slope.T)
        return 2e5 / (1.0 - nu**2) * ((1.0 - nu) * strain + nu * np.trace(strain) * np.eye(2))

    east, west, north, south = stress(38, -55), stress(36, -55), stress(37, -54), stress(37, -56)
    force = 0.5 * (east[:, 0] - west[:, 0] + north[:, 1] - south[:, 1])
    np.testing.assert_allclose(force, 0.0, atol=1e-3 * np.abs(east - west).max())
    assert np.abs(stress(37.0, -2.0 * step)[:, 1]).max() < 1e-3 * np.abs(stress(37.0, -55.0)).max()
    # All pressure passes through a level below the punch.
    places = np.linspace(-4000.0, 4000.0, 1001)
    assert 8.0 * sum(stress(x, -55.0)[1, 1] for x in places) == pytest.approx(-1e4, rel=1e-3)


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
        lambda: linear.roller(0.1), lambda: linear.punch(0.1), linear.pin, lambda: linear.flat_punch([]),
        lambda: large.billet_in_die(4), lambda: plastic.indentation(10.0), lambda: plastic.sheet(1),
        lambda: linear.tube(1e-3), fretting.fretting, lambda: large.rubber_cylinder(4),
        lambda: ring.ring(ring.quarter((2, 8)), 0.4),
    ],
)  # fmt: skip
def test_each_scene_has_a_plan(scene: Callable[[], Scene]) -> None:
    made = scene()
    assert len(made.contacts) == (2 if "sheet" in made.bodies else 1)
    assert made.plan() is not None
    assert warm.joint().contacts


@pytest.mark.claim
@pytest.mark.parametrize("name", ["pin", "roller", "flat punch", "fretting", "rubber", "ring"])
def test_a_problem_is_what_the_record_says(record: dict[str, Any], name: str) -> None:
    for row, stored in zip(PROBLEMS[name].rows(), map(row_of, record[name]), strict=True):
        assert row.value == pytest.approx(stored.value, abs=row.error + stored.error)
        assert math.isnan(row.reference) or row.agrees or row.quantity in EXPLAINED


def test_the_die_has_its_corners() -> None:
    mesh = large.die(4)
    for corner in (*large.INSIDE, *large.OUTSIDE):
        assert np.linalg.norm(mesh.points - corner, axis=1).min() < 1e-9
    inside = mesh.points[np.unique(mesh.surfaces["x0"])]
    radius = np.interp(inside[:, 1], large.INSIDE[:, 1], large.INSIDE[:, 0])
    np.testing.assert_allclose(inside[:, 0], radius, atol=1e-9)


def test_a_squeezed_billet_has_no_axial_stress() -> None:
    lame, shear = 5000.0 * 0.45 / (1.45 * 0.1), 5000.0 / 2.9
    axial = large.squeezed_height(0.96)

    def energy(z: float) -> float:
        dilatation = np.log(z * 0.96**2)
        return float(0.5 * shear * (2 * 0.96**2 + z**2 - 2.0 * dilatation) + 0.5 * lame * dilatation**2)

    slope = (energy(axial + 1e-5) - energy(axial - 1e-5)) / 2e-5
    assert abs(slope) < 1e-6 * shear
    assert axial == pytest.approx(1.0 + 2 * 0.45 / 0.55 * 0.04, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ball", "billet", "sheet"])
def test_a_path_is_what_the_record_says(record: dict[str, Any], name: str) -> None:
    for row, stored in zip(PROBLEMS[name].rows(), map(row_of, record[name]), strict=True):
        assert row.value == pytest.approx(stored.value, abs=row.error + stored.error)
        assert math.isnan(row.reference) or row.agrees


@pytest.mark.claim
@pytest.mark.slow
def test_the_punch_is_what_the_record_says(record: dict[str, Any]) -> None:
    for row, stored in zip(PROBLEMS["punch"].rows(), map(row_of, record["punch"]), strict=True):
        assert row.value == pytest.approx(stored.value, abs=row.error + stored.error)
        assert row.products <= 60
