"""The study of adaptive meshes: its page is its record, and what it found still holds."""

from __future__ import annotations

import json
from typing import Any

import pytest

from benchmarks.adaptive.cases import CASES
from benchmarks.adaptive.measuring import adaptive, curve, everywhere, uniform
from benchmarks.adaptive.report import errors, order, reached, tables
from benchmarks.study import filled
from tests.conftest import ROOT

HOME = ROOT / "docs" / "studies" / "adaptive"


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    return json.loads((HOME / "results.json").read_text())


def test_the_page_is_its_record_and_complete(record: dict[str, Any]) -> None:
    page = (HOME / "README.md").read_text()
    assert page == filled(page, tables(record))
    assert [case["case"] for case in record["cases"]] == list(CASES)


@pytest.fixture(scope="module", params=["punch", "bracket"])
def measured(request: pytest.FixtureRequest, record: dict[str, Any]) -> dict[str, Any]:
    """A case up to two thousand unknowns, with the reference of the record."""
    name = request.param
    (known,) = (case for case in record["cases"] if case["case"] == name)
    case, scene = CASES[name], CASES[name].scene()
    fine = curve(adaptive(scene, case.quantities["potential"], case.accuracy, 5000))
    coarse = [
        {"unknowns": run["unknowns"], "value": run["values"]["potential"]}
        for run in (uniform(mesh, case) for mesh in everywhere(scene, 6500))
    ]
    return {"exact": known["exact"], "adaptive": {"potential": fine}, "uniform": {"potential": coarse}}


def test_the_order_survives_singular_points(measured: dict[str, Any]) -> None:
    """Linear cells: error of an energy ~ 1 / unknowns."""
    assert order(measured, "adaptive", "potential") > 0.8
    # Nearer with fewer unknowns.
    assert errors(measured, "adaptive", "potential")[-1] < errors(measured, "uniform", "potential")[-1]
    last = {way: measured[way]["potential"][-1]["unknowns"] for way in ("adaptive", "uniform")}
    assert last["adaptive"] < last["uniform"]


def test_a_percent_of_the_peak_takes_few_unknowns(record: dict[str, Any]) -> None:
    """Uniform meshes of seventy times as many are still far from it."""
    (known,) = (case for case in record["cases"] if case["case"] == "discs")
    case, scene = CASES["discs"], CASES["discs"].scene()
    fine = curve(adaptive(scene, case.quantities["peak pressure"], 0.01, 5000))
    found = {"exact": known["exact"], "adaptive": {"peak pressure": fine}}
    within = reached(found, "adaptive", "peak pressure", 0.01)
    assert within is not None
    assert within["unknowns"] < 4000
    (coarse,) = (mesh for mesh in known["uniform"]["peak pressure"] if 3e4 < mesh["unknowns"] < 5e4)
    assert abs(coarse["value"] / known["exact"]["peak pressure"] - 1.0) > 0.05


def test_the_singular_cases_keep_their_order_on_fine_meshes(record: dict[str, Any]) -> None:
    for name in ("punch", "bracket"):
        (case,) = (case for case in record["cases"] if case["case"] == name)
        assert order(case, "adaptive", "potential") > 0.85
        assert order(case, "uniform", "potential") < 0.65
