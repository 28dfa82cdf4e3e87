"""Materials, temperatures and stresses are the same on one rank and on several, some without a cell."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import run_on_ranks

RANKS = (2, 4)


@cache
def found(ranks: int) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(
        run_on_ranks(Path(__file__).with_name("on_ranks.py"), ranks, timeout=120)
    )
    return answer


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize(
    "body", ["triangle heated", "triangle plain", "hexahedron heated", "hexahedron plain"]
)
def test_displacement_and_stress_do_not_depend_on_the_ranks(body: str, ranks: int) -> None:
    for here, alone in zip(found(ranks)[body], found(1)[body], strict=True):
        size = np.abs(alone).max()
        assert size > 1e-3
        np.testing.assert_allclose(here, alone, atol=1e-7 * size)


@pytest.mark.parametrize("ranks", RANKS[1:])
def test_some_ranks_had_no_cell_of_the_heated_body(ranks: int) -> None:
    assert 0 in found(ranks)["hexahedron cells"]


@pytest.mark.parametrize("ranks", RANKS)
def test_all_ranks_refuse_a_wrong_material(ranks: int) -> None:
    assert len(found(ranks)["refused"]) == ranks
    assert all("must hold every motion without energy" in text for text in found(ranks)["refused"])
