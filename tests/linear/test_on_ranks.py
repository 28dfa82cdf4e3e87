"""On several ranks the linear answer is that of one rank, and its fields are complete."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from fenics_contact import solve_scene
from tests.conftest import run_on_ranks
from tests.feti.scenes import CELLS
from tests.linear.scenes import BOXES, TOLERANCE, cut, loaded_block

SCRIPT = Path(__file__).with_name("on_ranks.py")


@pytest.fixture(scope="module", params=[2, 4])
def ranks(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def answer(ranks: int) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(run_on_ranks(SCRIPT, ranks, timeout=100).splitlines()[-1])
    found["ranks"] = ranks
    return found


def test_the_displacement_is_that_of_a_monolithic_solve(answer: dict[str, Any]) -> None:
    errors = {name: case["error"] for name, case in answer["blocks"].items()}
    assert set(errors) == {f"{cell} {n}" for cell in CELLS for n in BOXES if n >= answer["ranks"]}
    assert max(errors.values()) < TOLERANCE, errors


def test_iterations_and_energy_do_not_depend_on_the_ranks(answer: dict[str, Any]) -> None:
    for cell in CELLS:
        scene = loaded_block(cell)
        alone = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 8), tolerance=1e-10)
        case = answer["blocks"][f"{cell} 8"]
        assert abs(case["products"] - alone.solution.products) <= 1
        assert case["energy"] == pytest.approx(alone.energies.primal, rel=1e-10)


def test_a_rank_may_own_no_multiplier(answer: dict[str, Any]) -> None:
    assert answer["bar"]["owned"][-1] == 0
    assert answer["bar"]["error"] < TOLERANCE


def test_fields_are_complete_where_ranks_have_no_cell_of_a_body(answer: dict[str, Any]) -> None:
    both = [answer["bodies"][name] for name in ("soft", "stiff")]
    assert min(min(body["cells"]) for body in both) == 0, "every rank has cells of both: nothing was tested"
    for body in both:
        assert sum(body["cells"]) == body["all cells"]
        assert body["error"] < TOLERANCE
        assert body["field"] < TOLERANCE
        assert body["stress"] < 10 * TOLERANCE
