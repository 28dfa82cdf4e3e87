"""Mortar, ties, regions, heat, load steps and plane scenes: one answer on 1, 2 and 4 ranks, however cut."""

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
from tests.contact.effect_cases import CASES, collect, figures, solved


@cache
def answer(ranks: int) -> dict[str, Any]:
    if ranks == 1:
        return collect(MPI.COMM_SELF)
    return json.loads(run_on_ranks(Path(__file__).with_name("effect_cases.py"), ranks))


def assert_alike(found: dict[str, Any], expected: dict[str, Any]) -> None:
    assert found["energy"] == pytest.approx(expected["energy"], rel=1e-8)
    assert found["friction"] == pytest.approx(expected["friction"], rel=1e-6, abs=1e-12)
    for name in ("force", "displacement", "stress"):
        values, known = np.array(found[name]), np.array(expected[name])
        assert np.abs(values - known).max(initial=0.0) <= 1e-6 * np.abs(known).max(initial=0.0), name


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("ranks", [2, 4])
def test_the_number_of_ranks_does_not_matter(ranks: int, name: str) -> None:
    assert_alike(answer(ranks)[name], answer(1)[name])


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("parts", [1, 9])
def test_the_partition_does_not_matter(parts: int, name: str) -> None:
    assert_alike(figures(solved(MPI.COMM_SELF, name, parts)), answer(1)[name])


def test_the_cases_stick_slip_and_open() -> None:
    counts = {status: 0 for status in Status}
    for name in ("mortar", "stiff on soft", "load steps in the plane"):
        state = solved(MPI.COMM_SELF, name, 4)
        for status in Status:
            counts[status] += state.contact.count(status)
        assert state.energies.friction > 0.0
    assert min(counts.values()) >= 3
