"""Cells of a distributed mesh live where they are meant to, also when some rank has none."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import run_on_ranks

SCRIPT = Path(__file__).with_name("meshes_on_ranks.py")
Found = dict[str, list[dict[str, Any]]]


@pytest.fixture(scope="module", params=[2, 4])
def ranks(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def found(ranks: int) -> Found:
    """What every rank found, by the way in which the cells were dealt out."""
    answer: Found = json.loads(run_on_ranks(SCRIPT, ranks, timeout=60))
    assert len(answer) == 20
    assert all(len(reports) == ranks for reports in answer.values())
    return answer


def test_every_cell_lives_on_its_rank(found: Found) -> None:
    for name, reports in found.items():
        assert all(report["cells stay"] for report in reports), name
        assert sum(report["cells"] for report in reports) == reports[0]["all cells"], name


def test_ranks_without_cells_were_among_them(found: Found) -> None:
    empty = [name for name, reports in found.items() if min(report["cells"] for report in reports) == 0]
    assert len(empty) == 12


def test_ranks_agree_on_the_nodes_that_they_share(found: Found) -> None:
    for name, reports in found.items():
        nodes = 5 * 4 if name.startswith(("triangle", "quadrilateral")) else 5 * 4 * 4
        assert {report["all nodes"] for report in reports} == {nodes}, name
        owned = sorted(node for report in reports for node in report["owned nodes"])
        assert owned == list(range(nodes)), name


def test_nodes_are_where_they_should_be_and_values_reach_all_copies(found: Found) -> None:
    for name, reports in found.items():
        assert max(report["misplaced"] for report in reports) < 1e-14, name
        assert max(report["unheard"] for report in reports) == 0.0, name
