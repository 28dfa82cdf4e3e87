"""Nodes in several pairs, whose rows contradict each other until one gives way."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import FixedPoint, RigidPlane, State
from fenics_contact.qp import FaceNewton, Smalse
from tests.contact.corner_cases import corner, planes, solved


def notes(state: State) -> str:
    return "\n".join(str(line) for line in state.solution.history)


@pytest.mark.parametrize(("friction", "push"), [(0.3, 0.002), (1.0, 0.0005), (3.0, 0.002)])
def test_a_wall_pushes_a_block_over_a_floor_that_it_sticks_to(friction: float, push: float) -> None:
    """More than 500 products while rows of the same node stood against each other; the last had no end."""
    state = solved(corner(friction, push), MPI.COMM_SELF, FaceNewton(1e-9))
    assert "rows that contradict each other" in notes(state)
    assert "rescue" not in notes(state)
    assert 10 < state.solution.products < 45


def test_forces_beside_the_wall_are_those_of_another_solver() -> None:
    scene = corner(0.3, 0.002)
    found, other = (solved(scene, MPI.COMM_SELF, way) for way in (FaceNewton(1e-9), FixedPoint(Smalse(1e-7))))
    expected = other.contact.normal_force
    assert found.contact.normal_force == pytest.approx(expected, abs=1e-4 * expected.max())
    assert np.abs(found.contact.force).max() > 0.1


@pytest.mark.parametrize("friction", [None, 0.3])
def test_of_two_floors_the_upper_one_bears(friction: float | None) -> None:
    upper, lower = (RigidPlane((0.0, 0.0, z), (0.0, 0.0, 1.0)) for z in (0.0, -0.002))
    once = solved(planes(("z0", upper, friction)), MPI.COMM_SELF, FaceNewton(1e-9))
    both = solved(planes(("z0", upper, friction), ("z0", lower, friction)), MPI.COMM_SELF, FaceNewton(1e-9))
    pressing = both.contact.normal_force.reshape(2, -1)
    assert pressing[0] == pytest.approx(once.contact.normal_force, abs=1e-7 * pressing.max())
    assert np.abs(pressing[1]).max() == 0.0
    assert both.solution.products < 40  # more than 250


def test_the_corner_is_the_same_on_two_ranks(mpirun: Any) -> None:
    ranks, products, force = json.loads(mpirun(Path(__file__).with_name("corner_cases.py"), 2))
    alone = solved(corner(1.0, 0.002), MPI.COMM_SELF, FaceNewton(1e-9))
    assert (ranks, products) == (2, alone.solution.products)
    assert np.abs(np.array(force) - alone.contact.force).max() < 1e-9 * np.abs(force).max()
