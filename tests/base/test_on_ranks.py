"""Where the coarse problem is factored changes nothing but the time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import run_on_ranks

#: A factor that three ranks share takes long on two cores, which claims rest on.
CLAIM = [pytest.mark.slow, pytest.mark.claim]


@pytest.fixture(scope="module", params=[1, 2, pytest.param(3, marks=CLAIM)])
def answer(request: pytest.FixtureRequest) -> dict[str, Any]:
    script = Path(__file__).with_name("on_ranks.py")
    found: dict[str, Any] = json.loads(run_on_ranks(script, request.param, timeout=100).splitlines()[-1])
    found["ranks"] = request.param
    return found


def test_any_number_of_ranks_may_hold_the_factors(answer: dict[str, Any]) -> None:
    assert len(answer["errors"]) == answer["ranks"]
    assert max(answer["errors"].values()) < 1e-10


def test_null_vectors_are_found_from_the_shares_of_all_ranks(answer: dict[str, Any]) -> None:
    assert answer["rank"] == 17


@pytest.mark.parametrize("kept", ["one rank", "several ranks"])
def test_contact_forces_do_not_depend_on_the_coarse_problem(answer: dict[str, Any], kept: str) -> None:
    dense, sparse = answer["dense"], answer[kept]
    assert (dense["kind"], sparse["kind"]) == ("GramInverse", "SparseGramInverse")
    assert sparse["potential"] == pytest.approx(dense["potential"], rel=1e-8)
    largest = max(dense["forces"])
    np.testing.assert_allclose(sparse["forces"], dense["forces"], atol=1e-6 * largest)
    assert abs(sparse["products"] - dense["products"]) <= 2
