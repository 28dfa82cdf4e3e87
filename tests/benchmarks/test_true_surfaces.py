"""The study of true surfaces: its page is its record, and its record can be measured again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from benchmarks.study import filled
from benchmarks.true_surfaces.cases import CASES
from benchmarks.true_surfaces.links import FINEST, RUNS, measured
from benchmarks.true_surfaces.measuring import BY_MORTAR, FACETS, errors, known
from benchmarks.true_surfaces.orders import SURFACES, gap_errors
from benchmarks.true_surfaces.report import jobs, study, tables
from fenics_contact.study.scenes.chain_links import ENERGY, GRADING, PEAK
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "studies" / "true_surfaces.md"
PLANE = ("disc on a block", "shaft in a bush")


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    return json.loads(PAGE.with_suffix(".json").read_text())


def measured_again(record: dict[str, Any], name: str, facets: int, discretisation: Any) -> dict[str, Any]:
    """Measure one line of the table anew and compare it with the record."""
    (case,) = (c for c in record["cases"] if (c["case"], c["discretisation"]) == (name, discretisation))
    if case["exact"]["from"] == "theory":
        assert case["exact"] == pytest.approx(known(name))
    (line,) = (run for run in case["runs"] if run["facets"] == facets)
    found = errors(name, facets, discretisation, case["exact"])
    for quantity in ("peak", "area"):
        assert found[quantity] == pytest.approx(line[quantity], rel=2e-3, abs=2e-4)
    return found


def test_the_page_is_its_record_and_complete(record: dict[str, Any]) -> None:
    page = PAGE.read_text()
    assert page == filled(page, tables(record))
    expected = [
        (name, way) for name in CASES for way in ("node", "mortar") if way == "node" or name in BY_MORTAR
    ]
    assert [(case["case"], case["discretisation"]) for case in record["cases"]] == expected
    assert all(tuple(run["facets"] for run in case["runs"]) == FACETS for case in record["cases"])
    assert [each["surface"] for each in record["gaps"]] == list(SURFACES)


def test_what_was_not_measured_keeps_its_numbers(record: dict[str, Any], tmp_path: Path) -> None:
    disc, link = (next(job for job in jobs(False) if job.name.startswith(kind)) for kind in ("gap", "link"))
    assert link.arguments == {"size": 1.0, "grading": 0.0, "discretisation": "node", "geometry": "faceted"}
    measured = {**record["gaps"][0], "orders": record["gaps"][1]["orders"]}
    study.write(tmp_path, {disc.name: [measured | {"ranks": 1, "load_average": 0.5}]}, False)
    written = json.loads((tmp_path / "true_surfaces.json").read_text())
    assert written["gaps"] == [measured, *record["gaps"][1:]]
    assert {name: part for name, part in written.items() if name != "gaps"} == {
        name: part for name, part in record.items() if name != "gaps"
    }


def test_true_surfaces_are_right_where_facets_are_far_off(record: dict[str, Any]) -> None:
    for case in record["cases"]:
        for run in case["runs"]:
            coarse = run["facets"] == 8
            assert run["peak"]["faceted"] > 0.25
            assert abs(run["peak"]["best"]) < (0.05 if coarse else 0.03)
            assert abs(run["area"]["best"]) < 0.025
            assert abs(run["peak"]["reconstructed"]) < (0.085 if coarse else 0.03)


def test_gaps_converge_as_they_should(record: dict[str, Any]) -> None:
    for each in record["gaps"]:
        assert each["orders"]["faceted"] == pytest.approx(2.0, abs=0.1)
        assert each["orders"]["reconstructed"] > 3.0
        assert each["orders"]["best"] > 4.0


def test_the_chain_is_right_on_true_crowns_alone(record: dict[str, Any]) -> None:
    """Hertz says 4384 MPa on 27.4 mm²; the meshes converge to one percent less."""
    by = {(r["size"], r["grading"], r["discretisation"], r["geometry"]): r for r in record["links"]}
    assert len(by) == len(RUNS)
    for size in (1.0, 1.5, 2.0):
        true, facets = (by[size, 0.0, "node", way] for way in ("best", "faceted"))
        assert true["peak"] == pytest.approx(4384.0, rel=0.04)
        assert facets["peak"] > 1.5 * 4384.0
    for way in ("node", "mortar"):
        graded = by[1.0, GRADING, way, "best"]
        assert graded["peak"] == pytest.approx(PEAK, rel=0.015)
        assert graded["area"] == pytest.approx(27.4, rel=0.04)
        assert by[1.5, FINEST, way, "best"]["peak"] == pytest.approx(PEAK, rel=0.004)
        assert by[3.0, 0.0, way, "best"]["potential"] == pytest.approx(ENERGY, rel=0.006)
    for size, error in ((1.0, 0.03), (1.5, 0.012), (2.0, 0.005), (3.0, 0.005)):
        assert by[size, 0.0, "mortar", "best"]["peak"] == pytest.approx(PEAK, rel=error)
    potentials = [by[1.0, GRADING, way, "best"]["potential"] for way in ("node", "mortar")]
    assert potentials[0] == pytest.approx(potentials[1], rel=0.01)


@pytest.mark.claim
@pytest.mark.slow
def test_a_chain_is_what_the_record_says(record: dict[str, Any]) -> None:
    stored = record["links"][RUNS.index((1.0, 0.0, "node", "best"))]
    found = measured(MPI.COMM_SELF, 1.0, 0.0, "node", "best")
    numbers = {name: value for name, value in stored.items() if not isinstance(value, str)}
    assert {name: found[name] for name in numbers} == pytest.approx(numbers, rel=1e-3)
    assert found == stored | {name: found[name] for name in numbers}


@pytest.mark.parametrize("name", PLANE)
@pytest.mark.parametrize("facets", [8, 16])
def test_a_plane_case_is_what_the_record_says(record: dict[str, Any], name: str, facets: int) -> None:
    found = measured_again(record, name, facets, "node")
    assert found["peak"]["faceted"] > 0.9
    assert abs(found["peak"]["best"]) < 0.05


def test_mortar_is_as_wrong_by_facets_as_the_record_says(record: dict[str, Any]) -> None:
    found = measured_again(record, "shaft in a bush", 16, "mortar")
    assert found["peak"]["faceted"] > 2.0


def test_gaps_of_a_disc_are_what_the_record_says(record: dict[str, Any]) -> None:
    (stored,) = (each for each in record["gaps"] if each["surface"] == "disc")
    found = gap_errors(MPI.COMM_SELF, "disc")
    for way, misses in stored["errors"].items():
        assert found["errors"][way] == pytest.approx(misses, rel=1e-2, abs=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.claim] if name == "crossed cylinders" else [])
        for name in CASES
        if name not in PLANE
    ],
)
def test_a_solid_case_is_what_the_record_says(record: dict[str, Any], name: str) -> None:
    found = measured_again(record, name, 8, "node")
    assert found["peak"]["faceted"] > 1.5
    assert abs(found["peak"]["best"]) < 0.02
