"""Linear and other constraints: what is refused, solved and reported, also on random problems."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import clarabel
import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize as scipy_minimize

from fenics_contact import SurfaceDesign, minimize
from fenics_contact._optimize import bundle as quadratic_program
from fenics_contact._optimize.bundle import Bundle, Plane, QuadraticProgram, SubproblemError, solve
from fenics_contact._optimize.constraints import FeasibleSet, contradicting, feasible_set
from fenics_contact._optimize.manufacture import joined
from fenics_contact._optimize.subproblem import solve_step
from fenics_contact.design import (
    BundleTrust,
    LinearConstraints,
    NonlinearConstraint,
    Result,
    convex,
    fixed_rim,
    monotone,
    nearest_feasible,
    smallest_radius,
    symmetric,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface, block, rectangle, side_of
from tests.optimize.functions import Array, Fun

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
    with pytest.raises(InvalidInputError, match="no point meets all constraints"):
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


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_of_three_that_contradict_each_other_none_can_be_left_out(unit: float) -> None:
    angles = 2 * np.pi * np.arange(3) / 3
    rows = np.column_stack([np.cos(angles), np.sin(angles)])
    extra = np.vstack([rows, [[1.0, 0.2], [0.3, -1.0]]])
    limits, equal = unit * np.array([-1.0, -1.0, -1.0, 5.0, 5.0]), np.zeros(5, dtype=bool)
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


def test_bounds_are_violated_in_any_unit_of_length() -> None:
    for unit in (1e-9, 1.0, 1e9):
        allowed = feasible_set(2, (0.0, unit))
        assert len(allowed.violations(unit * np.array([-0.1, 1.1]))) == 2
        assert allowed.violations(unit * np.array([-1e-16, 1.0 + 1e-16])) == []


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


# Random problems with nonsmooth inequalities and smooth equalities, beside quadratic programming.
METHOD = BundleTrust(tolerance=1e-6, max_iterations=500, max_evaluations=600)


@dataclass(frozen=True, eq=False)
class Quadratics:
    """max_k of ½ xᵀA_k x + b_k·x + c_k.

    Attributes:
        matrices: A_k, shape (m, n, n), symmetric.
        slopes: b_k, shape (m, n).
        constants: c_k, shape (m,).
    """

    matrices: Array
    slopes: Array
    constants: Array

    def values(self, x: Array) -> Array:
        return 0.5 * np.einsum("kij,i,j->k", self.matrices, x, x) + self.slopes @ x + self.constants

    def __call__(self, x: Array) -> tuple[float, Array]:
        values = self.values(x)
        k = int(np.argmax(values))
        return float(values[k]), self.matrices[k] @ x + self.slopes[k]


@dataclass(frozen=True, eq=False)
class Problem:
    """A random problem; 0 is strictly feasible, or on the surface of the equality."""

    objective: Quadratics
    limits: list[Quadratics]
    equalities: list[Quadratics]
    start: Array
    size: float

    def minimised(self) -> Result:
        def fun(x: Array) -> tuple[float, Array]:
            value, slope = self.objective(x)
            return self.size * value, self.size * slope

        given: list[NonlinearConstraint] = [NonlinearConstraint(limit, 0.0) for limit in self.limits]
        given += [NonlinearConstraint(each, 0.0, 0.0) for each in self.equalities]
        method = BundleTrust(**{**vars(METHOD), "value_scale": self.size})
        return minimize(fun, self.start, method, bounds=(-6.0, 6.0), constraints=given, restore=True)

    def programmed(self, start: Array) -> float:
        """The least value that sequential quadratic programming finds, pieces as constraints."""
        pieces: list[dict[str, Any]] = [
            {"type": "ineq", "fun": lambda z: z[-1] - self.objective.values(z[:-1])},
            *({"type": "ineq", "fun": lambda z, one=one: -one.values(z[:-1])} for one in self.limits),
            *({"type": "eq", "fun": lambda z, one=one: one.values(z[:-1])} for one in self.equalities),
        ]
        bounds = [(-6.0, 6.0)] * start.size + [(None, None)]
        top = float(np.max(self.objective.values(start)))
        options = {"maxiter": 1000, "ftol": 1e-12}
        found = scipy.optimize.minimize(
            lambda z: z[-1], np.append(start, top), constraints=pieces, bounds=bounds, options=options
        )
        assert found.success
        return float(found.fun)


def posed(seed: int, *, convex: bool) -> Problem:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 10))

    def quadratics(count: int, bend: float, least: float) -> Array:
        square = rng.standard_normal((count, n, n))
        positive = square @ square.transpose(0, 2, 1) / n + 0.1 * np.eye(n)
        return bend * (positive if convex else 0.5 * (square + square.transpose(0, 2, 1))) + least * np.eye(n)

    objective = Quadratics(
        quadratics(5, 0.3, 0.3), 2 * rng.standard_normal((5, n)), 3 * rng.standard_normal(5)
    )
    limits = [
        Quadratics(quadratics(4, 1.0, 0.0), rng.standard_normal((4, n)), -1 - rng.uniform(0, 2, 4))
        for _ in range(int(rng.integers(1, 4)))
    ]
    surface = Quadratics(quadratics(1, 0.2, 0.0), rng.standard_normal((1, n)), np.zeros(1))
    start = np.zeros(n) if seed % 2 else rng.uniform(-3.0, 3.0, n)
    return Problem(objective, limits, [surface] * (seed % 3 == 0), start, 10.0 ** rng.uniform(-3.0, 3.0))


def checked(problem: Problem, most: int = 300) -> Result:
    result = problem.minimised()
    assert result.reason.success
    assert result.violation <= 1e-6
    assert result.evaluations < most
    return result


@pytest.mark.parametrize("seed", range(12))
def test_minima_of_convex_functions_are_those_of_quadratic_programming(seed: int) -> None:
    problem = posed(seed, convex=True)
    value = checked(problem).value / problem.size
    least = problem.programmed(np.zeros(problem.start.size))
    # A surface makes the set nonconvex: there may be a lower minimum.
    assert value - least < 1e-5 * (1 + abs(least))
    assert least - value < 1e-5 * (1 + abs(least)) or problem.equalities


@pytest.mark.parametrize("seed", range(4, 16))
def test_quadratic_programming_finds_nothing_lower_near_minima_of_nonconvex_functions(seed: int) -> None:
    problem = posed(seed, convex=False)
    # Rounding decides how such a walk goes: one takes less than 300 evaluations on one processor, 579 on
    # another.
    result = checked(problem, most=800)
    value, least = result.value / problem.size, problem.programmed(result.x)
    assert value - least < 2e-4 * (1 + abs(least))
    violated = [max(0.0, float(one.values(problem.start).max())) for one in problem.limits]
    assert seed % 2 or max(violated) > 0.1, "the start was to be infeasible"


def test_the_problems_have_active_constraints() -> None:
    active = [
        sum(one.active for one in posed(seed, convex=True).minimised().constraints) for seed in range(6)
    ]
    assert sum(active) >= 4


def test_functions_of_the_problems_have_their_gradients() -> None:
    fun: Fun = posed(1, convex=False).objective
    x, step = np.full(posed(1, convex=False).start.size, 0.3), 1e-6
    for axis in np.eye(x.size):
        slope = (fun(x + step * axis)[0] - fun(x - step * axis)[0]) / (2 * step)
        assert fun(x)[1] @ axis == pytest.approx(slope, abs=1e-6)


# Linear constraints for manufacture hold for the shapes, not only for the control points.
Numbers = np.ndarray
MESH = block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (40, 20, 1))
SURFACE = side_of(MESH, "z1")
DESIGN = SurfaceDesign("block", SURFACE, net=(6, 4))
PLANE = rectangle((0.0, 0.0), (3.0, 1.0), (30, 4))
CURVE = SurfaceDesign("plate", side_of(PLANE, "y1"), net=7)


def arc(radius: float, hollow: bool, nodes: int = 61) -> tuple[SurfaceDesign, Numbers]:
    """An arc of one radian whose body lies inside, or outside where it is hollow."""
    angle = np.linspace(0.0, 1.0, nodes)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    surface = DesignSurface(np.arange(nodes), angle[:, None], -out if hollow else out, (nodes,))
    return SurfaceDesign("disc", surface, net=8), radius * out


def on_grid(design: SurfaceDesign, alpha: Numbers) -> Numbers:
    """Displacements along the normals on the grid of nodes."""
    return (design.basis @ alpha).reshape(design.lattice.counts)


def made(constraints: LinearConstraints, seed: int, size: float = 0.1) -> Numbers:
    """The feasible control points nearest to random ones, some of which are not feasible."""
    wanted = size * np.random.default_rng(seed).standard_normal(np.shape(constraints.matrix)[1])
    found = nearest_feasible(wanted, None, constraints)
    assert np.abs(found - wanted).max() > 0.1 * size, "a point that was feasible tests nothing"
    assert np.abs(found).max() > 0.01 * size, "the reference shape tests nothing"
    return found


def curvature(points: Numbers) -> Numbers:
    """Curvature of a plane curve, positive where it turns left."""
    first = np.gradient(points, axis=0)
    second = np.gradient(first, axis=0)
    return (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / (first**2).sum(axis=1) ** 1.5


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("axis", [0, 1])
def test_a_symmetric_shape_equals_its_mirror_image(axis: int, seed: int) -> None:
    moved = on_grid(DESIGN, made(symmetric(DESIGN, axis), seed))
    assert moved == pytest.approx(np.flip(moved, axis), abs=1e-9)
    assert np.abs(moved - np.flip(moved, 1 - axis)).max() > 1e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_monotone_displacement_never_turns(axis: int, sign: int, seed: int) -> None:
    moved = on_grid(DESIGN, made(monotone(DESIGN, axis, sign), seed))
    assert (sign * np.diff(moved, axis=axis)).min() > -1e-8
    assert (sign * np.diff(moved, axis=axis)).max() > 1e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("axis", [0, 1])
def test_a_convex_profile_of_a_flat_side_is_nowhere_hollow(axis: int, seed: int) -> None:
    moved = on_grid(DESIGN, made(convex(DESIGN, axis), seed))
    assert np.diff(moved, n=2, axis=axis).max() < 1e-9
    assert np.diff(moved, n=2, axis=axis).min() < -1e-5


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("axis", [0, 1])
def test_the_radius_of_a_flat_side_is_kept(axis: int, seed: int) -> None:
    radius, spacing = 8.0, 0.1
    moved = on_grid(DESIGN, made(smallest_radius(DESIGN, axis, radius, MESH.points), seed))
    bends = np.diff(moved, n=2, axis=axis) / spacing**2
    assert np.abs(bends).max() < (1 + 1e-6) / radius
    assert np.abs(bends).max() > 0.1 / radius


def test_a_curve_of_a_plane_body_has_one_parameter() -> None:
    moved = on_grid(CURVE, made(smallest_radius(CURVE, 0, 8.0, PLANE.points), 1))
    assert 0.1 / 8.0 < np.abs(np.diff(moved, n=2)).max() / 0.1**2 < (1 + 1e-6) / 8.0
    assert len(np.asarray(symmetric(CURVE, 0).equality_matrix)) == 3


@pytest.mark.parametrize("hollow", [False, True])
def test_the_radius_of_an_arc_is_kept_with_its_own_curvature(hollow: bool) -> None:
    design, points = arc(2.0, hollow)
    for seed in range(5):
        alpha = made(smallest_radius(design, 0, 1.5, points), seed, 0.05)
        moved = points + design.displacement(alpha)
        # The curvature is that to first order in the displacement.
        assert np.abs(curvature(moved)[3:-3]).max() < 1.05 / 1.5


def test_the_radius_of_an_arc_that_moves_out_grows_and_shrinks_as_it_does() -> None:
    design, points = arc(2.0, hollow=False)
    rows = smallest_radius(design, 0, 1.5, points)
    matrix, limit = np.asarray(rows.matrix), np.asarray(rows.limit)
    for shift in (-0.1, 0.1):
        room = limit - matrix @ np.full(8, shift)
        wanted = 1 / 2.0 - shift / 4.0
        assert room == pytest.approx(np.repeat([wanted + 1 / 1.5, 1 / 1.5 - wanted], 6), rel=1e-3)


def test_an_arc_may_be_flattened_but_not_hollowed() -> None:
    design, points = arc(2.0, hollow=False)
    moved = points + design.displacement(made(convex(design, 0, points), 3, 0.3))
    assert curvature(moved)[3:-3].min() > -0.02
    without = made(convex(design, 0, points), 3, 0.3) @ np.asarray(convex(design, 0).matrix).T
    assert without.max() > 1e-3, "the arc's own curvature was not used"


def test_a_fixed_rim_moves_inside_alone() -> None:
    alpha = made(fixed_rim(DESIGN), 1)
    moved = on_grid(DESIGN, alpha)
    assert np.abs(np.concatenate([moved[0], moved[-1], moved[:, 0], moved[:, -1]])).max() < 1e-12
    assert np.abs(moved).max() > 1e-3
    wide = made(fixed_rim(CURVE, 2), 1)
    assert np.flatnonzero(np.abs(wide) > 1e-12).tolist() == [2, 3, 4]
    ends = on_grid(DESIGN, made(fixed_rim(DESIGN, (1, 0)), 1))
    assert np.abs(ends[[0, -1]]).max() < 1e-12
    assert min(np.abs(ends[1:-1, column]).max() for column in (0, -1)) > 1e-3


def test_constraints_of_several_designs_are_placed_in_all_variables() -> None:
    both = joined((DESIGN, CURVE), (1, fixed_rim(CURVE)), (0, monotone(DESIGN, 0)), (1, convex(CURVE, 0)))
    alpha = made(both, 2)
    first, second = alpha[: DESIGN.size], alpha[DESIGN.size :]
    assert np.diff(on_grid(DESIGN, first), axis=0).min() > -1e-8
    assert np.abs(on_grid(CURVE, second)[[0, -1]]).max() < 1e-12
    assert np.diff(on_grid(CURVE, second), n=2).max() < 1e-9


def test_the_nearest_symmetric_convex_shape_is_found_by_minimising() -> None:
    wanted = 0.1 * np.sin(np.arange(CURVE.size))

    def away(alpha: Numbers) -> tuple[float, Numbers]:
        return float((alpha - wanted) @ (alpha - wanted)), 2 * (alpha - wanted)

    rules = [symmetric(CURVE, 0), convex(CURVE, 0)]
    result = minimize(away, np.zeros(CURVE.size), constraints=rules)
    moved = on_grid(CURVE, result.x)
    assert moved == pytest.approx(moved[::-1], abs=1e-8)
    assert np.diff(moved, n=2).max() < 1e-9
    assert 1e-3 < np.abs(result.x).max()
    assert result.value < float(wanted @ wanted)


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (partial(symmetric, DESIGN, 2), "axis must be one of the 2 parameters of the net, got 2"),
        (partial(symmetric, CURVE, 1), "axis must be one of the 1 parameters of the net, got 1"),
        (partial(monotone, DESIGN, 0, 2), "sign of a monotone displacement must be 1 or -1, got 2"),
        (
            partial(convex, SurfaceDesign("b", SURFACE, net=(2, 4)), 0),
            "needs 3 or more control points, got 2",
        ),
        (
            partial(monotone, SurfaceDesign("b", SURFACE, net=(1, 4)), 0),
            "needs 2 or more control points, got 1",
        ),
        (partial(smallest_radius, DESIGN, 0, 0.0, MESH.points), "radius must be positive and finite, got 0"),
        (
            lambda: smallest_radius(arc(2.0, True)[0], 0, 3.0, arc(2.0, True)[1]),
            "the smallest radius must not exceed 2, got 3",
        ),
        (partial(fixed_rim, DESIGN, 2), r"a rim of 2 must be at least 1 and leave some of a net of"),
        (partial(fixed_rim, DESIGN, (0, 0)), r"a rim of \(0, 0\) must be at least 1"),
        (partial(fixed_rim, DESIGN, (1, 0, 0)), r"a rim of \(1, 0, 0\) must be at least 1"),
        (partial(joined, (DESIGN,), (1, symmetric(DESIGN, 0))), "there are 1 designs, got number 1"),
        (partial(joined, (CURVE,), (0, symmetric(DESIGN, 0))), r"design 0 must have 7 columns, .* \(0, 24\)"),
    ],
)
def test_wrong_requests_are_refused(build: Callable[[], object], text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        build()


# The step solves its quadratic programme, whatever the size of its numbers.

# Kept here because tests put something else in its place.
RUN_CLARABEL = quadratic_program._run_clarabel


def random_bundle(seed: int, m: int = 7, n: int = 4) -> Bundle:
    generator = np.random.default_rng(seed)
    errors = np.append(0.0, generator.uniform(0.0, 2.0, m - 1))
    return Bundle(
        generator.standard_normal((m, n)) + 0.3,
        errors,
        np.zeros(m),
        0.0,
        np.zeros(m),
        np.zeros(m, dtype=bool),
        np.zeros((m, 0)),
    )


def boxed(n: int = 4) -> FeasibleSet:
    return feasible_set(n, (-0.4, 0.9), LinearConstraints(np.ones((1, n)), [0.5]))


@given(seed=st.integers(0, 10_000), t=st.floats(0.05, 20.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_step_is_the_minimiser_that_an_independent_method_finds(seed: int, t: float) -> None:
    bundle, allowed = random_bundle(seed), boxed()
    near = allowed.around(np.zeros(4), np.ones(4))
    step = solve_step(bundle, near, t)
    limits = np.concatenate([bundle.measures, near.room])
    rows = np.vstack(
        [np.hstack([bundle.gradients, -np.ones((7, 1))]), np.hstack([near.rows, np.zeros((9, 1))])]
    )
    reference = scipy_minimize(
        lambda z: z[-1] + z[:-1] @ z[:-1] / (2 * t),
        np.zeros(5),
        jac=lambda z: np.append(z[:-1] / t, 1.0),
        constraints={"type": "ineq", "fun": lambda z: limits - rows @ z, "jac": lambda z: -rows},
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    ours = -step.decrease + step.length**2 / (2 * t)
    assert ours == pytest.approx(reference.fun, abs=1e-7)
    assert (rows @ np.append(step.move, -step.decrease) <= limits + 1e-8).all()


@given(seed=st.integers(0, 10_000), t=st.floats(0.05, 20.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_predicted_decrease_splits_into_aggregate_error_and_norm(seed: int, t: float) -> None:
    step = solve_step(random_bundle(seed), boxed().around(np.zeros(4), np.ones(4)), t)
    assert step.weights.sum() == pytest.approx(1.0)
    assert (step.weights >= 0.0).all()
    assert step.decrease == pytest.approx(step.aggregate_error + t * step.aggregate_norm**2, abs=1e-6)


@pytest.mark.parametrize("value", [1e-8, 1.0, 1e8])
@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_units_of_value_and_length_do_not_matter(value: float, length: float) -> None:
    plain, allowed = random_bundle(5), feasible_set(4, (-0.4, 0.9))
    step = solve_step(plain, allowed.around(np.zeros(4), np.ones(4)), 0.7)
    bundle = Bundle(
        plain.gradients * value / length,
        plain.errors * value,
        plain.distances,
        0.0,
        plain.noise,
        plain.doubtful,
        plain.pushes,
    )
    near = feasible_set(4, (-0.4 * length, 0.9 * length)).around(np.zeros(4), np.ones(4))
    other = solve_step(bundle, near, 0.7 * length**2 / value)
    assert other.move / length == pytest.approx(step.move, abs=1e-7)
    assert other.decrease / value == pytest.approx(step.decrease, rel=1e-7)


def test_aggregate_much_shorter_than_the_subgradients_is_resolved() -> None:
    # Two opposite slopes of size one whose shortest convex combination has the length 1e-6.
    bundle = Bundle(
        np.array([[1.0, 1e-6], [-1.0, 1e-6]]),
        np.zeros(2),
        np.zeros(2),
        0.0,
        np.zeros(2),
        np.zeros(2, dtype=bool),
        np.zeros((2, 0)),
    )
    step = solve_step(bundle, feasible_set(2).around(np.zeros(2), np.ones(2)), 1.0)
    assert step.aggregate_norm == pytest.approx(1e-6, rel=1e-3)
    assert step.decrease == pytest.approx(1e-12, rel=1e-2)


def test_planes_far_below_do_not_blur_the_step() -> None:
    gradients = np.array([[1.0, 1e-4], [-1.0, 1e-4], [1e3, 1e3]])
    bundle = Bundle(
        gradients,
        np.array([0.0, 0.0, 1e12]),
        np.zeros(3),
        0.0,
        np.zeros(3),
        np.zeros(3, dtype=bool),
        np.zeros((3, 0)),
    )
    step = solve_step(bundle, feasible_set(2).around(np.zeros(2), np.ones(2)), 1.0)
    assert step.aggregate_norm == pytest.approx(1e-4, rel=1e-4)
    assert step.weights[2] == pytest.approx(0.0, abs=1e-9)


def test_vanishing_subgradient_makes_no_step() -> None:
    bundle = Bundle.of_centre(Plane(np.zeros(3)), 0.0)
    step = solve_step(bundle, feasible_set(3).around(np.zeros(3), np.ones(3)), 1.0)
    assert step.length == pytest.approx(0.0, abs=1e-8)
    assert step.decrease == 0.0


def little_program(limits: list[float]) -> QuadraticProgram:
    rows = np.array([[1.0], [-1.0]])
    return QuadraticProgram(np.ones(1), np.zeros(1), np.zeros((0, 1)), np.zeros(0), rows, np.array(limits))


def test_multiplier_of_an_active_row_is_the_force_on_it() -> None:
    solution = solve(little_program([5.0, -2.0]))  # y ≤ 5, y ≥ 2
    assert solution.point == pytest.approx([2.0])
    assert solution.multipliers == pytest.approx([0.0, 2.0], abs=1e-7)
    assert solution.exact


def test_contradicting_rows_are_reported() -> None:
    with pytest.raises(
        InvalidInputError, match=r"no point meets all constraints \(PrimalInfeasible\): relax"
    ):
        solve(little_program([1.0, -2.0]))


class Refusing:
    """Stands for Clarabel: gives up, or almost solves, a number of times, then solves."""

    def __init__(self, statuses: list[Any]) -> None:
        self.statuses, self.seen = statuses, 0

    def __call__(self, program: QuadraticProgram, changes: Mapping[str, Any]) -> Any:
        answer = RUN_CLARABEL(program, changes)
        status = self.statuses[self.seen] if self.seen < len(self.statuses) else answer.status
        self.seen += 1
        return type("Answer", (), {"x": answer.x, "z": answer.z, "status": status})


def test_trouble_is_answered_with_other_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    refusing = Refusing([clarabel.SolverStatus.InsufficientProgress, clarabel.SolverStatus.NumericalError])
    monkeypatch.setattr(quadratic_program, "_run_clarabel", refusing)
    assert solve(little_program([5.0, -2.0])).point == pytest.approx([2.0])
    assert refusing.seen == 3


def test_almost_solved_serves_only_when_nothing_better_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    almost = clarabel.SolverStatus.AlmostSolved
    monkeypatch.setattr(quadratic_program, "_run_clarabel", Refusing([almost] * 9))
    assert not solve(little_program([5.0, -2.0])).exact
    monkeypatch.setattr(quadratic_program, "_run_clarabel", Refusing([almost]))
    assert solve(little_program([5.0, -2.0])).exact


def test_failure_of_every_attempt_lists_what_was_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        quadratic_program, "_run_clarabel", Refusing([clarabel.SolverStatus.MaxIterations] * 9)
    )
    with pytest.raises(SubproblemError, match=r"reported MaxIterations, .*: rescale by `scale`"):
        solve(little_program([5.0, -2.0]))
