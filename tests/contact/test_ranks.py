"""One, two and four ranks and two ways of cutting the bodies give one answer, and fields that fit it."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Status
from tests.conftest import run_on_ranks
from tests.contact.gallery import SOFT
from tests.contact.rank_cases import PARTITIONS, TENSION, collect

RANKS = [1, 2, 4]


@cache
def answer(ranks: int) -> dict[str, Any]:
    if ranks == 1:
        return collect(MPI.COMM_SELF)
    found = json.loads(run_on_ranks(Path(__file__).with_name("rank_cases.py"), ranks))
    assert found["ranks"] == ranks
    return found


@pytest.mark.parametrize("cut", PARTITIONS)
@pytest.mark.parametrize("ranks", RANKS)
def test_objective_and_contact_forces_depend_on_neither_ranks_nor_partition(ranks: int, cut: str) -> None:
    expected, found = answer(1)["contact"]["boxes"], answer(ranks)["contact"][cut]
    assert abs(expected["objective"]) > 0.01
    assert found["objective"] == pytest.approx(expected["objective"], rel=1e-8)
    force, known = np.array(found["force"]), np.array(expected["force"])
    assert np.abs(force - known).max() < 1e-6 * np.abs(known).max()
    assert found["status"] == expected["status"]
    assert set(found["status"]) == {int(status) for status in Status}
    assert found["subdomains"] == {"boxes": 4, "bisection": 6}[cut]


@pytest.mark.parametrize("ranks", RANKS)
def test_displacement_functions_hold_the_nodal_values(ranks: int) -> None:
    for found in answer(ranks)["contact"].values():
        assert found["field error"] < 1e-9
        assert found["position error"] < 1e-14
        assert found["field nodes"] == [72, 105]


@pytest.mark.parametrize("ranks", RANKS)
def test_stress_does_not_depend_on_ranks(ranks: int) -> None:
    for found in answer(ranks)["contact"].values():
        assert min(found["stress"]) > 1.0
        assert found["stress"] == pytest.approx(answer(1)["contact"]["boxes"]["stress"], rel=1e-6)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("ranks", RANKS)
def test_a_bar_under_tension_has_its_analytic_stress_and_length(ranks: int, cell: str) -> None:
    found = answer(ranks)["uniaxial"][cell]
    elongation = 2.0 * TENSION / SOFT.young_modulus
    assert found["cells"] == {"hexahedron": 16, "tetrahedron": 96}[cell]
    assert found["contact points"] == 0
    assert found["stress error"] < 1e-7 * TENSION
    assert found["elongation"] == pytest.approx(elongation, rel=1e-8)
    assert found["primal"] == pytest.approx(-0.5 * TENSION * elongation, rel=1e-8)
    assert found["dual"] == pytest.approx(found["primal"], rel=1e-8)


@pytest.mark.parametrize("ranks", RANKS)
def test_every_rank_is_told_why_there_is_no_answer(ranks: int) -> None:
    words = answer(ranks)["refusals"]
    assert len(words) == 3 * ranks
    for start in range(0, len(words), 3):
        sliding, lifted, stopped = words[start : start + 3]
        assert "InfeasibleError: every body must be held" in sliding
        assert "body 'block' can move away under the load: translation (" in sliding
        assert "'block' can move away under the load: translation (0, 0, 1) meets no resistance" in lifted
        assert "ConvergenceError: " in stopped
