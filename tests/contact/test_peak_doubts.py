"""A state says in one line what its meshes leave uncertain about the largest pressure."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import solve_scene
from fenics_contact._equilibrium.peaks import unmatched_nodes
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.resolution import CALL, CoarsePeak, UnmatchedNodes, in_words
from tests.contact.round_bodies import CELL, pressed

PLACE = "upper y0 on lower y1"


def found(
    cells: float, ratio: float, discretisation: str = "mortar", axis: float = 0.1
) -> tuple[LinearState, float]:
    """Return the state of two cylinders, cells on the half width, and the error of its largest pressure."""
    scene, peak = pressed(2, cells, ratio, axis, discretisation)
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    assert isinstance(state, LinearState)
    return state, abs(float(state.contact.pressure.max()) / peak - 1.0)


@pytest.mark.parametrize(("cells", "ratio", "to_edge"), [(2.0, 3.0, 1), (3.0, 0.75, None), (5.0, 3.0, 2)])
def test_cells_to_the_edge_are_those_of_the_coarser_surface(
    cells: float, ratio: float, to_edge: int | None
) -> None:
    state, error = found(cells, ratio)
    assert [doubt.cells for doubt in state.peak_doubts if isinstance(doubt, CoarsePeak)] == (
        [] if to_edge is None else [to_edge]
    )
    assert error < {1: 1.4, 2: 0.23, None: 0.035}[to_edge]
    assert (error > 0.1) == (to_edge == 1)


def test_the_line_of_a_coarse_peak() -> None:
    state, error = found(1.5, 0.75)
    (doubt,) = state.peak_doubts
    words = f"may be off by a tenth, {PLACE} touch within 2 cells of it: {CALL} refines the meshes there"
    assert str(doubt) == words
    assert f"\n  peak pressure    {words}\n" in str(state)
    assert 0.01 < error < 0.23


def test_contact_by_nodes_wavers_where_meshes_do_not_match() -> None:
    state, error = found(5.0, 1.5, "node")
    (doubt,) = state.peak_doubts
    assert isinstance(doubt, UnmatchedNodes)
    assert str(doubt) == (
        f"wavers by some percent, {PLACE} touch by nodes where meshes do not match: leave out "
        "discretisation='node'"
    )
    better, smaller = found(5.0, 1.5)
    assert better.peak_doubts == ()
    assert "peak pressure" not in str(better)
    assert smaller < 0.01 < error
    assert unmatched_nodes(found(5.0, 1.0, "node")[0], 0) is None


def test_one_line_for_several_pairs() -> None:
    doubts = [CoarsePeak("a", 3, 1), UnmatchedNodes("b"), UnmatchedNodes("c")]
    words = f"may be off by a half or more, a touch within 1 cell of it: {CALL} refines the meshes there"
    assert in_words(doubts[:1]) == words
    assert in_words(doubts) == f"{words}; likewise 2 further pairs"


@pytest.mark.claim
def test_doubts_follow_errors() -> None:
    errors = defaultdict[int, list[float]](list)
    generator = np.random.default_rng(3)
    for ratio in (0.75, 1.5, 2.0, 3.0):
        for cells in (0.8, 1.0, 1.4, 1.8, 2.5, 3.0, 3.5, 4.0, 4.5):
            state, error = found(cells, ratio, axis=generator.uniform(0.0, CELL))
            doubts = (doubt.cells for doubt in state.peak_doubts if isinstance(doubt, CoarsePeak))
            errors[next(doubts, 3)].append(error)
    assert sum(map(len, errors.values())) == 36
    assert min(map(len, errors.values())) >= 6
    assert 0.1 < np.median(errors[1]) < 0.3
    assert 0.005 < np.median(errors[2]) < 0.05
    assert np.median(errors[3]) < 0.01
    assert max(errors[3]) < 0.035
