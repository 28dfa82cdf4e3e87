"""Contact that is smaller than the cells of its slave is never missed in silence."""

from __future__ import annotations

import logging

import pytest
from mpi4py import MPI

from fenics_contact import solve_scene, solve_to
from fenics_contact.results.resolution import CALL, BetweenNodes
from tests.contact.between_nodes import DEPTH, pressed_on_disc


@pytest.mark.parametrize("rubber", [False, True])
def test_contact_between_nodes_is_named_with_its_depth_and_what_to_do(
    rubber: bool, caplog: pytest.LogCaptureFixture
) -> None:
    state = solve_scene(pressed_on_disc(0.5, rubber=rubber), MPI.COMM_SELF, tolerance=1e-8)
    (doubt,) = (each for each in state.peak_doubts if isinstance(each, BetweenNodes))
    assert doubt.depth == pytest.approx(DEPTH, rel=1e-3)
    assert doubt.at[0] == pytest.approx(0.0, abs=1e-3)
    (words,) = (each for each in caplog.messages if "lies between nodes" in each)
    assert "the contact of plate y0 on rigid sphere lies between nodes" in words
    assert "surfaces overlap by 0.01 more than at its nodes" in words
    assert "its force, not only its largest pressure, may be off by a half or more" in words
    assert CALL in words
    assert f"peak pressure    {doubt}" in str(state)


def test_fine_meshes_touch_at_nodes(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        state = solve_scene(pressed_on_disc(0.37, 0.05), MPI.COMM_SELF, tolerance=1e-8)
    assert not any(isinstance(each, BetweenNodes) for each in state.peak_doubts)
    assert state.contact.normal_force.sum() > 0.0
    assert not [each for each in caplog.messages if "between nodes" in each]


def test_an_accuracy_is_reached_from_a_mesh_that_misses_the_contact() -> None:
    result = solve_to(pressed_on_disc(0.5), "peak_pressure", 0.05, MPI.COMM_SELF)
    finer = solve_to(pressed_on_disc(0.0), "peak_pressure", 0.05, MPI.COMM_SELF)
    assert result.relative_error < 0.05
    assert result.value == pytest.approx(finer.value, rel=0.05)
