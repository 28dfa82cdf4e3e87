"""`ContactProblem`: what it keeps from one answer to the next, and what it does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, Support, Traction, solve_scene
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.qp import FaceNewton
from tests.contact.gallery import block_on_plane, partitions

SCENE = block_on_plane(Coulomb(0.6))
HEAVIER = replace(SCENE, loads=[Traction("block", "z1", (1.05, 0.3, -2.1))])


def posed(**more: Any) -> ContactProblem:
    return ContactProblem(SCENE, MPI.COMM_SELF, partitions=partitions(SCENE), tolerance=1e-8, **more)


def test_a_problem_solved_once_is_a_scene_solved_in_one_call() -> None:
    problem = posed()
    state = problem.solve()
    once = solve_scene(SCENE, MPI.COMM_SELF, partitions=partitions(SCENE), tolerance=1e-8)
    assert problem.state is state
    np.testing.assert_array_equal(state.contact.force, once.contact.force)
    assert state.counts == once.counts


def test_subdomains_stay_and_seconds_add_up() -> None:
    problem = posed()
    first = problem.solve()
    decomposition, spent = problem.decomposition, dict(problem.timer.seconds)
    second = problem.solve(HEAVIER)
    assert second.torn.decomposition is decomposition is first.torn.decomposition
    assert problem.timer.seconds["decompose"] == spent["decompose"]
    assert problem.timer.seconds["solve"] > spent["solve"]


def test_a_failure_leaves_the_last_answer() -> None:
    problem = posed(solver=FaceNewton(max_products=3000))
    state = problem.solve()
    problem.solver = FaceNewton(max_products=1)
    with pytest.raises(ConvergenceError, match=r"none of them was left for a step.*raise max_products"):
        problem.solve(HEAVIER, start=None)
    assert problem.state is state


def test_other_supported_components_than_those_of_the_first_scene_are_refused() -> None:
    problem = posed()
    problem.solve()
    with pytest.raises(InvalidInputError, match="support"):
        problem.solve(replace(SCENE, supports=[*SCENE.supports, Support("block", "z1")]))


def test_a_problem_that_follows_a_state_goes_on_from_it() -> None:
    state = posed().solve()
    following = ContactProblem.following(state, tolerance=1e-8)
    again = following.solve()
    assert again.torn.decomposition is state.torn.decomposition
    assert again.counts["f_products"] < 5 < state.counts["f_products"]


def test_a_stored_state_is_restored_beside_the_last_answer() -> None:
    problem = posed()
    light = problem.solve()
    heavy = problem.solve(HEAVIER)
    found = problem.restore(stored_state(light), SCENE)
    assert problem.state is heavy
    np.testing.assert_allclose(found.contact.force, light.contact.force, atol=1e-9)
    assert found.solution.products == 1
