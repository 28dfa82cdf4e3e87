"""Points are projected onto the feasible set, and the set is seen rightly from within."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fenics_contact._optimize.constraints import contradicting, feasible_set
from fenics_contact.design import LinearConstraints, nearest_feasible
from fenics_contact.errors import InvalidInputError

BOX = ([-1.0, 0.0, -np.inf], [1.0, np.inf, 2.0])
ROWS = LinearConstraints([[1.0, 1.0, 1.0], [2.0, -1.0, 0.0]], [1.0, 1.5], [[0.0, 1.0, -1.0]], [0.25])


@given(seed=st.integers(0, 10_000), size=st.sampled_from([1e-3, 1.0, 1e4]))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_projection_is_feasible_and_no_feasible_point_is_nearer(seed: int, size: float) -> None:
    generator = np.random.default_rng(seed)
    x = size * generator.standard_normal(3)
    nearest = nearest_feasible(x, BOX, ROWS)
    allowed = feasible_set(3, BOX, ROWS)
    assert allowed.violations(nearest) == []
    # A feasible point near the projection: the projection of a neighbour.
    other = nearest_feasible(nearest + 0.1 * generator.standard_normal(3), BOX, ROWS)
    assert (x - nearest) @ (other - nearest) <= 1e-6 * (1.0 + size)


def test_projection_onto_a_plane_is_the_analytic_one() -> None:
    plane = LinearConstraints([[3.0, 4.0]], [10.0])
    assert nearest_feasible([9.0, 12.0], None, plane) == pytest.approx([1.2, 1.6], abs=1e-8)


@pytest.mark.parametrize("missed", [1e-4, 1e-12, 3e-15])
def test_misses_far_smaller_than_the_box_are_removed(missed: float) -> None:
    held = LinearConstraints(np.zeros((0, 28)), np.zeros(0), np.eye(28)[:8], np.zeros(8))
    x = np.full(28, 0.25 - 130.0 * missed)  # some bounds are much nearer than others
    x[14:] = 0.05 * np.random.default_rng(0).uniform(-1.0, 1.0, 14)
    x[:8] = missed * np.array([1.0, -0.3, -0.3, 1.0, 1.0, -0.3, -0.3, 1.0])
    found = nearest_feasible(x, (-0.25, 0.25), held)
    np.testing.assert_allclose(found, np.where(np.arange(28) < 8, 0.0, x), atol=1e-9 * missed + 1e-17)


def test_feasible_point_is_its_own_projection() -> None:
    x = np.array([0.1, 0.2, -0.05])
    assert (nearest_feasible(x, BOX, ROWS) == x).all()


def test_contradicting_constraints_have_no_nearest_point() -> None:
    with pytest.raises(InvalidInputError, match="must leave at least one point"):
        nearest_feasible([0.0], (0.0, 1.0), LinearConstraints([[1.0]], [-1.0]))


def test_the_fewest_constraints_that_contradict_each_other_are_named() -> None:
    rows = LinearConstraints(
        [[1.0, 0.0, 2.0], [-1.0, -1.0, 0.0], [0.0, 1.0, 1.0]], [50.0, -3.0, 40.0], [[0.0, 0.0, 1.0]], [0.5]
    )
    message = "contradict each other: row 1 of A x ≤ b, the upper bound of x[0], the upper bound of x[1]"
    with pytest.raises(InvalidInputError, match=f"{re.escape(message)}$"):
        nearest_feasible(np.zeros(3), (-9.0, 1.0), rows)
    both = [
        LinearConstraints([[1.0, 1.0]], [0.0]),
        LinearConstraints([[0.0, 9.0]], [1.0], [[3.0, 3.0]], [6.0]),
    ]
    with pytest.raises(InvalidInputError, match=r"each other: row 0 of A x ≤ b, row 0 of E x = e$"):
        nearest_feasible(np.zeros(2), None, both)


def test_of_three_that_contradict_each_other_none_can_be_left_out() -> None:
    angles = 2 * np.pi * np.arange(3) / 3
    rows = np.column_stack([np.cos(angles), np.sin(angles)])
    extra = np.vstack([rows, [[1.0, 0.2], [0.3, -1.0]]])
    limits, equal = np.array([-1.0, -1.0, -1.0, 5.0, 5.0]), np.zeros(5, dtype=bool)
    assert contradicting(extra, limits, equal) == [0, 1, 2]
    for k in range(3):
        kept = np.delete(np.arange(5), k)
        assert contradicting(extra[kept], limits[kept], equal[kept]) == []


def test_violations_are_named_with_their_amount() -> None:
    found = feasible_set(3, BOX, ROWS).violations(np.array([-2.0, 3.0, 4.0]))
    assert len(found) == 4
    assert "x[0] = -2 is below its lower bound -1" in found[0]
    assert "x[2] = 4 is above its upper bound 2" in found[1]
    assert "row 0 of A x ≤ b is exceeded by 4" in found[2]
    assert "row 0 of E x = e is missed by -1.25" in found[3]


def test_rounding_is_no_violation() -> None:
    allowed = feasible_set(2, (-1e6, 1e6), LinearConstraints([[1e3, 1.0]], [1e9]))
    x = np.array([1e6 * (1 + 1e-12), 0.0])
    assert allowed.violations(x) == []
    assert allowed.clip(x)[0] == 1e6


def test_surroundings_are_distances_in_scaled_variables() -> None:
    scale, x = np.array([2.0, 0.5, 10.0]), np.array([0.1, 0.2, -0.05])
    near = feasible_set(3, BOX, ROWS).around(x, scale)
    assert np.linalg.norm(near.rows, axis=1) == pytest.approx(np.ones(6))
    step = 0.01 * np.array([1.0, -2.0, 3.0])
    allowed = feasible_set(3, BOX, ROWS)
    after = allowed.around(x + scale * step, scale)
    assert near.room - near.rows @ step == pytest.approx(after.room)
    assert near.miss - near.equality_rows @ step == pytest.approx(after.miss)
    assert near.room.min() > 0.0


def test_variable_with_equal_bounds_is_an_equality() -> None:
    near = feasible_set(2, ([1.0, 0.0], [1.0, 5.0])).around(np.array([1.0, 2.0]), np.ones(2))
    assert near.equality_rows.tolist() == [[1.0, 0.0]]
    assert near.rows.tolist() == [[0.0, -1.0], [0.0, 1.0]]


def test_nothing_asked_is_nothing_in_the_way() -> None:
    near = feasible_set(3).around(np.zeros(3), np.ones(3))
    assert near.rows.shape == near.equality_rows.shape == (0, 3)


def test_a_projected_point_is_feasible_where_a_variable_must_vanish() -> None:
    held = LinearConstraints(np.zeros((0, 3)), np.zeros(0), [[1.0, 0.0, 0.0], [0.0, 1.0, -1.0]], [0.0, 0.0])
    for seed in range(20):
        x = nearest_feasible(np.random.default_rng(seed).standard_normal(3), None, held)
        assert feasible_set(3, None, held).violations(x) == []
        assert abs(x[0]) < 1e-14
    assert feasible_set(3, None, held).violations(np.array([1e-17, 1.0, 1.0])) == []
    assert feasible_set(3, None, held).violations(np.array([1e-6, 1.0, 1.0]))
