"""Parts of Newton's methods on quadratic programmes: steps, line search, rescue, equilibrium and PCG."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from mpi4py import MPI
from scipy.optimize import nnls

from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.qp import (
    DualProblem,
    Face,
    FaceNewton,
    FeasibleSet,
    Residuals,
    Smalse,
    Start,
    Stop,
    measure,
    solve,
)
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.cones import CoulombLaw, Proportional, TrescaLaw
from fenics_contact.qp.face import classify
from fenics_contact.qp.face_newton import slides
from fenics_contact.qp.face_system import FaceSystems
from fenics_contact.qp.krylov import projected_cg
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.newton_steps import FaceState, FaceSteps, Forcing, shorten
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.qp.rescue import ProximalPoint, Rescue, descend
from fenics_contact.qp.smalse import BoundedQuadratic, Mpgp, largest_eigenvalue, minimise
from fenics_contact.qp.solution import Iterate, SolverStep, contact_step, iterate_at, iterate_fitted
from fenics_contact.qp.solve import find_equilibrium
from tests.qp.published_friction import CYCLING, published
from tests.qp.random_problems import DenseProblem, conic_solution, count_statuses, random_problem
from tests.qp.torn_bricks import Bricks, torn_problem
from tests.qp.violations import coulomb_violations


def problem() -> DualProblem:
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5))
    return dual.with_law(CoulombLaw(dual.layout, Proportional(np.full(dual.layout.n_friction, 0.3))))


def face(*closed: bool) -> Face:
    """A face of three contacts without friction."""
    layout = ContactLayout.build(3, normal=[0, 1, 2])
    trial = np.where(closed, 1.0, -1.0)
    return classify(layout, np.zeros(0), trial, np.zeros(3), np.ones(3))


def test_a_step_from_the_same_state_is_the_same_step() -> None:
    dual = problem()
    operator = CountedOperator(dual.operator)
    steps = FaceSteps.build(dual, operator, Forcing(0.25, 0.1, 1e-8), 1000)
    far = dual.coarse.particular()
    state = steps.init(iterate_fitted(dual, far, operator(far)))
    for number in range(3):
        before, rho = state.iterate.multiplier.copy(), state.step.copy()
        (once, line), (again, other) = steps.step(state, number), steps.step(state, number)
        assert np.array_equal(once.iterate.multiplier, again.iterate.multiplier)
        assert (once.mismatch, line.residuals, line.note) == (again.mismatch, other.residuals, other.note)
        assert not np.array_equal(once.iterate.multiplier, before)
        assert np.array_equal(state.iterate.multiplier, before)
        assert np.array_equal(state.step, rho)
        assert len(once.faces) == len(state.faces) + 1
        assert not {"restriction", "fixed", "damping"} & set(vars(once.faces[0]))  # bytes of no further use
        state = once
    assert state.iterate.residuals.worst < 0.1


def test_first_slip_bounds_follow_the_forces_by_which_bodies_come_to_rest() -> None:
    dual = problem()
    operator = CountedOperator(dual.operator)
    steps = FaceSteps.build(dual, operator, Forcing(0.25, 0.1, 1e-8), 1000)
    far, layout = dual.coarse.particular(), dual.layout
    resting = steps.at_rest(iterate_fitted(dual, far, operator(far)))
    state, _ = steps.step(steps.from_rest(resting), 0)
    trial = (far - steps.natural_step * resting.residual)[layout.tangential_frictional]
    bound = state.faces[0].slip_bound
    assert 0 < np.count_nonzero(bound) < len(bound)
    assert bound == pytest.approx(0.3 * np.maximum(trial, 0.0), abs=1e-14 * bound.max())
    assert not np.allclose(bound, dual.law.bound(far), atol=0.1 * bound.max())
    taken = state.iterate.multiplier[layout.tangential[state.faces[0].slip]]
    pressing = state.iterate.multiplier[layout.tangential_frictional[state.faces[0].slip]]
    along = np.einsum("ia,ia->i", taken, state.faces[0].direction[state.faces[0].slip])
    assert along == pytest.approx(0.3 * pressing, abs=1e-12 * np.abs(pressing).max())


def test_a_disc_whose_force_would_turn_back_gets_a_smaller_step() -> None:
    dual = problem()
    operator = CountedOperator(dual.operator)
    steps = FaceSteps.build(dual, operator, Forcing(0.25, 0.1, 1e-8), 1000)
    far = dual.coarse.particular()
    state, _ = steps.step(steps.init(iterate_fitted(dual, far, operator(far))), 0)
    last = state.faces[0]
    turned = replace(state, faces=(replace(last, direction=-last.direction),))
    after, _ = steps.step(turned, 1)
    slipping = np.einsum("ia,ia->i", after.faces[0].direction, last.direction) > 0.0
    assert slipping.any()
    rows = dual.layout.tangential
    assert after.step[rows] / turned.step[rows] == pytest.approx(
        np.where(slipping, 0.3, 1.0)[:, None] * np.ones(2)
    )
    with_springs = replace(steps, safeguards=replace(steps.safeguards, adapts_step=False))
    assert np.array_equal(with_springs.step(turned, 1)[0].step, turned.step)


@pytest.mark.parametrize(
    ("faces", "reason"),
    [
        ([], "the residual stagnates"),
        ([face(True, True, True)] * 3, "the residual stagnates on one face"),
        (
            [face(True, True, False), face(False, True, True)] * 2,
            "the active set cycles with period 2, 2 statuses changed in the last step",
        ),
        (
            [face(True, True, True), face(True, True, False), face(True, False, False)],
            "the active set does not settle, 1 statuses changed in the last step",
        ),
    ],
)
def test_the_last_faces_say_why_steps_led_nowhere(faces: list[Face], reason: str) -> None:
    dual = problem()
    far = dual.coarse.particular()
    state = FaceState(iterate_fitted(dual, far, dual.operator(far)), far, tuple(faces))
    assert state.stall(MPI.COMM_SELF) == reason


def test_forcing_terms_are_those_of_eisenstat_and_walker() -> None:
    """Choice 2 with γ = 0.9, its safeguard above 0.1, no more accurate than the tolerance."""
    forcing = Forcing(0.9, np.inf, 1e-8)
    assert forcing.by_reduction(0.5, None, 0.9, 1.0) == 0.9, "nothing is known before the first step"
    assert forcing.by_reduction(1e-3, 1e-1, 1e-3, 1.0) == pytest.approx(0.9e-4)
    assert forcing.by_reduction(1e-3, 1e-1, 0.5, 1.0) == pytest.approx(0.9 * 0.5**2), "a safeguard"
    assert forcing.by_reduction(1e-3, 1e-1, 1e-3, 0.1) == pytest.approx(0.9e-5), "care"
    assert forcing.by_reduction(1e-7, 1e-1, 1e-3, 1.0) == pytest.approx(0.3e-8 / 1e-7)
    assert forcing.by_reduction(0.99, 1.0 - 1e-9, 1e-3, 1.0) == pytest.approx(0.9 * 0.99**2)


# Cutting a Newton step short costs nothing and is never worse than the whole step.
def no_product(x):
    raise AssertionError("all products on a segment are known")


def with_bounds(problem: DenseProblem) -> DualProblem:
    return problem.dual.with_law(TrescaLaw(problem.layout, problem.slip_bound))


def iterate(problem: DenseProblem, multiplier: np.ndarray, alpha: np.ndarray) -> Iterate:
    return iterate_at(with_bounds(problem), multiplier, problem.F @ multiplier, alpha)


def test_solution_between_two_iterates_is_found():
    problem = random_problem(3)
    dual = replace(with_bounds(problem), operator=no_product)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    offset = np.random.default_rng(0).standard_normal(len(problem.d))
    before = iterate(problem, solution.multiplier - 0.1 * offset, solution.alpha - 0.1)
    after = iterate(problem, solution.multiplier + 0.3 * offset, solution.alpha + 0.3)
    damped = shorten(dual, before, after)
    assert damped.fraction == 0.25
    assert damped.point.residuals.size < 1e-8 < before.residuals.size < after.residuals.size
    np.testing.assert_allclose(damped.point.multiplier, solution.multiplier, atol=1e-8)
    np.testing.assert_allclose(damped.point.product, problem.F @ damped.point.multiplier, atol=1e-12)


def test_step_that_improves_is_kept_whole():
    problem = random_problem(3)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    worse = iterate(problem, 1.1 * solution.multiplier, solution.alpha)
    better = iterate(problem, 1.01 * solution.multiplier, solution.alpha)
    damped = shorten(with_bounds(problem), worse, better)
    assert damped.fraction == 1.0
    assert damped.point is better


def test_a_huge_wrong_force_is_worse_than_one_that_is_nearly_right():
    """Relative to itself each is wrong by about one: only a common scale tells them apart."""
    problem = random_problem(3)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    huge = iterate(problem, -1e4 * np.abs(solution.multiplier), solution.alpha)
    small = iterate(problem, np.zeros_like(solution.multiplier), solution.alpha)
    assert small.residuals.worst > 0.5 * huge.residuals.worst
    one, other = huge.residuals, small.residuals
    assert one.worst_in_scales_with(other) > 100 * other.worst_in_scales_with(one)
    assert shorten(with_bounds(problem), huge, small).point is small


def test_a_jump_before_anything_is_displaced_is_worse_than_any_other():
    """Of a bolt that is drawn by a force: its first shortening opens rows, and nothing else has moved."""
    start = Residuals(np.inf, np.inf, 0.0, 0.0, force_scale=0.0, gluing_scale=0.0)
    later = Residuals(0.5, 0.1, 0.0, 0.0, force_scale=2.0, gluing_scale=3.0)
    assert later.is_worse_than(start) is False
    assert start.is_worse_than(later)
    assert start.worst_in_scales_with(start) == np.inf


def test_a_step_may_be_worse_than_the_last_iterate_if_it_is_better_than_the_one_before():
    problem = random_problem(3)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    good, fair, bad = (
        iterate(problem, part * solution.multiplier, solution.alpha) for part in (1.01, 1.1, 2.0)
    )
    assert shorten(with_bounds(problem), good, fair).point is not fair
    assert shorten(with_bounds(problem), good, fair, [bad.residuals]).point is fair


@pytest.mark.parametrize(("size", "fraction"), [(1.0, 0.01), (100.0, 0.1)], ids=["near", "far"])
def test_the_shortest_step_is_taken_near_a_solution_only(size, fraction):
    """Far from one the residual is made of contacts that are still to close, and falls little by little."""
    problem = random_problem(3)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    before, after = (
        iterate(problem, solution.multiplier, solution.alpha + size * part) for part in (-0.01, 0.99)
    )
    assert shorten(with_bounds(problem), before, after).fraction == fraction


def test_the_minimum_of_the_potential_on_a_segment_is_found():
    problem = random_problem(3)
    dual = with_bounds(problem)
    solution = solve(dual, problem.slip_bound, FaceNewton(tolerance=1e-11))
    point = ProximalPoint.build(dual, CountedOperator(dual.operator), 10.0).centred(solution.multiplier)
    begin = point.enter(iterate(problem, solution.multiplier, solution.alpha))
    offset = np.random.default_rng(0).standard_normal(len(solution.alpha))
    ends = [iterate(problem, solution.multiplier, solution.alpha + part * offset) for part in (-1e-3, 4e-3)]
    found = descend(point.problem, *(point.enter(end) for end in ends))
    assert found.fraction == pytest.approx(0.2, abs=0.03)
    assert found.point.residuals.natural < 0.2 * point.enter(ends[0]).residuals.natural
    assert descend(point.problem, point.enter(ends[0]), begin).fraction == 1.0


def test_a_step_that_was_cut_is_told():
    dual, mu_f = published(CYCLING)
    found = solve(dual, None, FaceNewton(tolerance=1e-8), friction_coefficient=mu_f)
    assert any("of the step" in step.note for step in found.history)


# Where Newton's method fails it is rescued, and where nothing helps the error says why.
@pytest.mark.parametrize("load", [1e-2, 1e-4, 1e-6, 1e-8])
def test_an_almost_unloaded_brick_on_a_round_one_is_solved(load: float) -> None:
    dual, _ = torn_problem(Bricks(n=4, crown=2.0, press=load, shear=0.1 * load, tilt=0.3))
    mu_f = np.full(dual.layout.n_friction, 0.3)
    found = solve(dual, None, FaceNewton(), friction_coefficient=mu_f)
    assert 0 < found.history[-1].closed < dual.layout.n_contact / 2
    violations = coulomb_violations(dual.layout, found.multiplier / load, found.residual, mu_f)
    assert max(violations.values()) < 1e-4
    assert found.products < 500  # more than 20 000 where iterates were compared in scales of their own


@pytest.mark.parametrize("preconditioned", [True, False])
def test_a_rescue_comes_nearer_from_anywhere(preconditioned: bool) -> None:
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5, preconditioned=preconditioned))
    dual = dual.with_law(CoulombLaw(dual.layout, Proportional(np.full(dual.layout.n_friction, 0.3))))
    far, operator = dual.coarse.particular(), CountedOperator(dual.operator)
    begin = iterate_at(dual, far, dual.operator(far), np.zeros(dual.coarse.m))
    rescue = Rescue(dual, Forcing(0.25, 0.1, 1e-6), 20_000, Smalse())
    rescued = rescue(Start(begin, operator, None, cold=False), 400)
    before, after = begin.residuals, rescued.iterate.residuals
    assert after.worst_in_scales_with(before) < 0.3 * before.worst_in_scales_with(after)
    assert rescued.line.method == ("proximal rescue" if preconditioned else "SMALSE rescue")
    assert rescued.line.residuals == after
    assert rescued.line.products == operator.products < 400
    assert (rescued.memory is None) == preconditioned


def test_the_history_says_why_a_rescue_was_called_and_what_it_reached() -> None:
    dual, _ = torn_problem(Bricks(cubes=(2, 2), crown=1.0, tilt=1.5))
    hasty = FaceNewton(tolerance=1e-10, patience=1, forcing=0.9, loosest=0.5)
    found = solve(dual, None, hasty, friction_coefficient=np.full(dual.layout.n_friction, 0.3))
    notes = [step.note for step in found.history if "rescue" in step.method]
    wanted = r"rescue from \S+ because the .+: (met its target|used its budget)"
    assert notes
    assert all(re.fullmatch(wanted, note) for note in notes)
    assert [step.iteration for step in found.history] == list(range(found.iterations))


def test_at_the_solution_springs_at_rest_change_nothing() -> None:
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5))
    bound = np.full(dual.layout.n_friction, 1e-3)
    solution = solve(dual, bound, FaceNewton(tolerance=1e-10))
    dual, operator = dual.with_law(TrescaLaw(dual.layout, bound)), CountedOperator(dual.operator)
    point = ProximalPoint.build(dual, operator, 10.0).centred(solution.multiplier)
    there = iterate_at(dual, solution.multiplier, solution.product, solution.alpha)
    inside = point.enter(there)
    assert inside.residuals.worst < 1e-8
    np.testing.assert_allclose(
        point.force(inside)[dual.layout.contact], there.multiplier[dual.layout.contact], atol=1e-10
    )
    np.testing.assert_allclose(point.leave(inside).residual, there.residual, atol=1e-14)
    away = point.centred(2.0 * solution.multiplier).enter(there)
    assert away.residuals.natural > 0.1
    assert operator.products == 0
    np.testing.assert_allclose(
        contact_step(dual.layout, point.problem.diagonal), 10 * contact_step(dual.layout, dual.diagonal)
    )


def test_forces_that_are_rounding_are_none() -> None:
    dual, _ = torn_problem(Bricks(crown=0.1))
    dual = dual.with_law(TrescaLaw(dual.layout, np.full(dual.layout.n_friction, 1e-3)))
    rng, size = np.random.default_rng(0), dual.layout.size
    multiplier = np.where(np.isin(np.arange(size), dual.layout.equality), 1.0, 0.0)
    noise = np.zeros(size)
    noise[dual.layout.contact] = rng.standard_normal(len(dual.layout.contact))
    zero = np.zeros(size)
    for scale, counts in ((1e-17, False), (1e-8, True)):
        found = measure(dual, multiplier + scale * noise, zero, zero)
        assert (found.natural > 0.0) == counts
        assert (found.violation > 0.0) == counts


def test_a_failure_says_what_was_reached_and_what_to_try() -> None:
    dual, _ = torn_problem(Bricks(n=4, cubes=(3, 2), crown=2.0, shear=0.0, tilt=0.5))
    mu_f = np.full(dual.layout.n_friction, 0.003)
    slipping = r"all \d+ discs slip, and friction may not suffice for any equilibrium; raise the friction, "
    with pytest.raises(
        ConvergenceError, match=slipping + "lower the load, add a support, or raise max_steps"
    ):
        solve(dual, None, FaceNewton(max_steps=1), friction_coefficient=mu_f)
    told = r"the best was .*, the .* and 0 rescues did not help: raise max_products, start from the solution"
    with pytest.raises(ConvergenceError, match=told) as caught:
        solve(dual, None, replace(FaceNewton(), max_products=30), friction_coefficient=40 * mu_f)
    assert caught.value.history


def test_one_step_in_which_all_slips_does_not_mean_that_friction_is_too_small() -> None:
    def step(stick: int, slip: int) -> SolverStep:
        return SolverStep("face", 0, 1, Residuals(1.0, 1.0, 1.0, 1.0, 1.0, 1.0), stick + slip, stick, slip)

    sticking, slipping = step(3, 5), step(0, 8)
    assert slides([sticking] + 6 * [slipping])
    assert not slides(6 * [slipping] + [sticking, slipping])
    assert not slides(6 * [step(0, 0)])
    assert not slides([])


# What can be held by contact and friction, and what cannot.
def without_product(x):
    raise AssertionError("the question is about G, e and the cone only")


def test_admissible_multiplier_is_found_without_a_product():
    problem = random_problem(5)
    dual = replace(problem.dual, operator=without_product)
    law = TrescaLaw(problem.layout, problem.slip_bound)
    found = find_equilibrium(dual.with_law(law))
    assert found.motion is None
    assert found.error <= 1e-4
    distance = dual.coarse.norm(dual.coarse.residual(found.multiplier))
    assert distance <= 1.01e-4 * dual.coarse.norm(dual.coarse.load)


@pytest.mark.parametrize(("friction_coefficient", "held"), [(0.195, False), (0.205, True)])
def test_sliding_limit_of_a_pulled_brick_is_found(friction_coefficient, held):
    dual, _ = torn_problem(Bricks(n=3, cubes=(2, 2), press=0.01, shear=0.002))
    mu_f = np.full(dual.layout.n_friction, friction_coefficient)
    found = find_equilibrium(dual.with_law(CoulombLaw(dual.layout, Proportional(mu_f))))
    assert (found.motion is None) == held


def test_unheld_motion_is_the_sliding_of_the_upper_brick():
    dual, torn = torn_problem(Bricks(n=3, shear=0.003))
    mu_f = np.full(dual.layout.n_friction, 0.2)
    found = find_equilibrium(dual.with_law(CoulombLaw(dual.layout, Proportional(mu_f))))
    motions = np.einsum("ij,sj->si", torn.kernel, found.motion.reshape(-1, 6))
    translation = motions.reshape(len(torn.places), -1, 3).mean(axis=1)
    upper = np.linalg.norm(translation[torn.body == 1], axis=1).min()
    assert np.abs(translation[torn.body == 0]).max() < 0.05 * upper
    assert np.abs(translation[torn.body == 1][:, 0]).min() > 0.9 * upper


@pytest.mark.parametrize("solver", [FaceNewton(), Smalse()])
def test_brick_pulled_away_from_its_support_is_refused(solver):
    dual, _ = torn_problem(Bricks(friction=False, shear=0.0, press=-0.01))
    with pytest.raises(
        InfeasibleError, match=r"contact and friction must balance the load, but leave .* % of it"
    ) as caught:
        solve(dual, None, solver)
    rows = str(caught.value).split("rows [")[1].split("]")[0]
    assert {int(row) // 6 for row in rows.split(",")} <= {2, 3}


def test_brick_pulled_sideways_without_friction_is_refused():
    dual, _ = torn_problem(Bricks(friction=False, shear=0.002))
    with pytest.raises(InfeasibleError, match="but no row of B: support it"):
        solve(dual, None, FaceNewton())


def test_brick_pulled_harder_than_its_friction_is_refused():
    dual, _ = torn_problem(Bricks(shear=0.002))
    with pytest.raises(InfeasibleError, match="add a support, or raise the friction"):
        solve(dual, np.full(dual.layout.n_friction, 1e-5), FaceNewton())


def test_loaded_motion_without_any_row_is_refused():
    layout = ContactLayout.build(2)
    G = sp.csr_matrix([[1.0, 1.0], [0.0, 0.0]])
    problem = DualProblem(
        MPI.COMM_SELF,
        lambda x: x,
        np.zeros(2),
        CoarseSpace(MPI.COMM_SELF, G, np.array([1.0, 2.0])),
        layout,
        np.ones(2),
    )
    with pytest.raises(InfeasibleError, match=r"row 1 of e, has load 2.000e\+00 but no row of B"):
        solve(problem, None, FaceNewton())


def test_problem_without_floating_bodies_is_always_held():
    problem = random_problem(5, m=0)
    law = TrescaLaw(problem.layout, problem.slip_bound)
    assert find_equilibrium(problem.dual.with_law(law)).motion is None


#
def mixed_face(layout, slip_bound, rng):
    """Open, closed, sticking, slipping and pinned contacts by turns."""
    kind = np.arange(layout.n_friction) % 3
    width = layout.tangential.shape[1]
    direction = rng.standard_normal((layout.n_friction, width))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    slip = kind == 1
    return Face(
        layout=layout,
        closed=np.arange(layout.n_contact) % 4 != 0,
        stick=kind == 0,
        slip=slip,
        slip_bound=np.where(kind == 2, 0.0, slip_bound),
        direction=np.where(slip[:, None], direction, 0.0),
        overshoot=np.where(slip, rng.uniform(1, 3, layout.n_friction), 1.0),
        flexibility=rng.uniform(0.5, 2, layout.n_friction),
    )


def saddle_point_solution(problem, face, Z):
    """Solve min over the face by one dense factorisation; returns λ and α."""
    A = Z.T @ problem.F @ Z + np.diag(face.curvature)
    GZ = problem.G @ Z
    m = len(problem.e)
    rhs = np.concatenate([Z.T @ (problem.d - problem.F @ face.fixed), problem.e - problem.G @ face.fixed])
    solution = np.linalg.solve(np.block([[A, GZ.T], [GZ, np.zeros((m, m))]]), rhs)
    return face.fixed + Z @ solution[: len(A)], -solution[len(A) :]


def solve_on_face(system, start, dual, tolerance, limit=500):
    entered = system.enter(start)
    gradient = system.gradient(entered, dual.operator(entered) - dual.rhs)
    answer = projected_cg(system, gradient, np.ones(len(gradient)), tolerance, limit)
    return entered + system.face.prolong(answer.step), answer


@pytest.mark.parametrize("tangents", [1, 2])
@pytest.mark.parametrize("m", [0, 6])
def test_solution_on_a_mixed_face_equals_the_dense_saddle_point_solution(tangents, m):
    problem = random_problem(4, m=m, tangents=tangents)
    dual, rng = problem.dual, np.random.default_rng(0)
    face = mixed_face(problem.layout, problem.slip_bound, rng)
    Z = face.restriction.toarray()
    np.testing.assert_allclose(Z.T @ Z, np.eye(face.n_face), atol=1e-14)
    assert np.count_nonzero(face.curvature) == (4 if tangents == 2 else 0)
    expected, alpha = saddle_point_solution(problem, face, Z)
    system = FaceSystems(dual, dual.operator).build(face)
    found, answer = solve_on_face(system, rng.standard_normal(len(problem.d)), dual, 1e-12)
    assert answer.stop is Stop.CONVERGED
    np.testing.assert_allclose(found, expected, atol=1e-10)
    np.testing.assert_allclose(problem.G @ found, problem.e, atol=1e-11)
    gradient = system.gradient(found, problem.F @ found - problem.d)
    np.testing.assert_allclose(system.coarse.coefficients(gradient), alpha, atol=1e-9)


def test_carried_product_and_residual_equal_recomputed_ones():
    problem = random_problem(8)
    dual = problem.dual
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(1))
    system = FaceSystems(dual, dual.operator).build(face)
    found, answer = solve_on_face(system, np.zeros(len(problem.d)), dual, 1e-6)
    np.testing.assert_allclose(answer.product, problem.F @ face.prolong(answer.step), atol=1e-11)
    gradient = system.gradient(found, problem.F @ found - problem.d)
    np.testing.assert_allclose(answer.residual, system.coarse.project(gradient), atol=1e-11)
    assert answer.measure == pytest.approx(np.linalg.norm(answer.residual))


def test_linear_torn_body_takes_few_steps_with_the_dirichlet_preconditioner():
    counts = {}
    for preconditioned in (False, True):
        dual, _ = torn_problem(Bricks(cubes=(2, 2), contact=False, preconditioned=preconditioned))
        face = mixed_face(dual.layout, np.zeros(0), np.random.default_rng(0))
        system = FaceSystems(dual, dual.operator).build(face)
        found, answer = solve_on_face(system, np.zeros(dual.layout.size), dual, 1e-9)
        assert answer.stop is Stop.CONVERGED
        residual = dual.operator(found) - dual.rhs
        assert np.linalg.norm(dual.coarse.project(residual)) < 2e-9
        counts[preconditioned] = answer.iterations
    assert counts[True] < 0.6 * counts[False]


def test_singular_operator_with_consistent_right_side_converges():
    problem = random_problem(11, rank=30, m=4)
    dual = problem.dual
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(2))
    face = replace(face, slip_bound=np.zeros_like(face.slip_bound))
    system = FaceSystems(dual, dual.operator).build(face)
    Z = face.restriction.toarray()
    inner = scipy.linalg.null_space(system.coarse.matrix.toarray())
    rank = np.linalg.matrix_rank(inner.T @ Z.T @ problem.F @ Z @ inner, tol=1e-10)
    assert rank < inner.shape[1]
    consistent = Z.T @ problem.F @ Z @ inner @ np.ones(inner.shape[1])
    answer = projected_cg(replace(system, face=face), consistent, np.ones(len(consistent)), 1e-9, 300)
    assert answer.stop is Stop.CONVERGED


def test_inconsistent_singular_system_stops_with_a_reason():
    problem = random_problem(11, rank=10, m=0)
    dual = problem.dual
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(2))
    system = FaceSystems(dual, dual.operator).build(face)
    gradient = np.random.default_rng(3).standard_normal(face.n_face)
    answer = projected_cg(system, gradient, np.ones(face.n_face), 1e-9, 300)
    assert answer.stop in (Stop.NO_CURVATURE, Stop.STAGNATION)


def test_iteration_limit_is_reported():
    problem = random_problem(4)
    dual = problem.dual
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(0))
    system = FaceSystems(dual, dual.operator).build(face)
    _, answer = solve_on_face(system, np.zeros(len(problem.d)), dual, 1e-12, limit=5)
    assert answer.stop is Stop.ITERATION_LIMIT
    assert answer.iterations == 5


def test_indefinite_preconditioner_is_reported():
    problem = random_problem(4)
    dual = replace(problem.dual, preconditioner=lambda x: -x)
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(0))
    system = FaceSystems(dual, dual.operator).build(face)
    _, answer = solve_on_face(system, np.zeros(len(problem.d)), dual, 1e-12)
    assert answer.stop is Stop.BAD_PRECONDITIONER


def test_more_directions_than_the_first_block_holds():
    problem = random_problem(6, n_equality=120, n_contact=0, m=3)
    dual = problem.dual
    face = mixed_face(problem.layout, np.zeros(0), np.random.default_rng(0))
    system = FaceSystems(dual, dual.operator).build(face)
    found, answer = solve_on_face(system, np.zeros(len(problem.d)), dual, 1e-13)
    assert 32 < answer.iterations <= 125
    expected, _ = saddle_point_solution(problem, face, face.restriction.toarray())
    np.testing.assert_allclose(found, expected, atol=1e-10)


#
def minimum(A, b, feasible, start=None, target=1e-12, **parameters):
    quadratic = BoundedQuadratic(MPI.COMM_SELF, lambda x: A @ x, b, feasible, np.linalg.norm(A, 2))
    start = np.zeros(len(b)) if start is None else start
    return minimise(quadratic, start, lambda x: target, parameters=Mpgp(**parameters), max_products=2000)


def test_nonnegative_least_squares_agrees_with_lawson_and_hanson():
    rng = np.random.default_rng(1)
    matrix, right = rng.standard_normal((40, 25)), rng.standard_normal(40)
    expected, _ = nnls(matrix, right)
    assert 5 < np.count_nonzero(expected) < 20
    feasible = FeasibleSet(ContactLayout.build(25, normal=np.arange(25)), np.zeros(0))
    found = minimum(matrix.T @ matrix, matrix.T @ right, feasible)
    assert found.reached
    np.testing.assert_allclose(found.x, expected, atol=1e-10)
    np.testing.assert_array_equal(found.x == 0.0, expected == 0.0)


def test_identity_gives_the_projection():
    layout = ContactLayout.build(4, normal=[0], tangential=[[1, 2]])
    found = minimum(np.eye(4), np.array([-1.0, 3.0, 4.0, 2.0]), FeasibleSet(layout, np.array([1.0])))
    np.testing.assert_allclose(found.x, [0.0, 0.6, 0.8, 2.0], atol=1e-12)


def test_bounds_and_discs_agree_with_a_conic_solver():
    problem = random_problem(5, m=0, n_contact=15)
    feasible = FeasibleSet(problem.layout, problem.slip_bound)
    expected = conic_solution(problem.F, problem.d, problem.G, problem.e, problem.layout, problem.slip_bound)
    assert min(count_statuses(problem.layout, expected, problem.slip_bound)) >= 2
    found = minimum(problem.F, problem.d, feasible)
    assert found.reached
    np.testing.assert_allclose(found.x, expected, atol=1e-6)


def test_quadratic_without_constraints_is_solved_by_conjugate_gradients():
    problem = random_problem(2, n_equality=30, n_contact=0, m=0)
    found = minimum(problem.F, problem.d, FeasibleSet(problem.layout, np.zeros(0)), target=1e-10)
    np.testing.assert_allclose(found.x, np.linalg.solve(problem.F, problem.d), atol=1e-8)
    assert found.iterations <= 45


def test_singular_quadratic_with_consistent_right_side_converges():
    problem = random_problem(7, m=0, rank=30)
    assert np.linalg.matrix_rank(problem.F) == 30 < len(problem.d)
    feasible = FeasibleSet(problem.layout, problem.slip_bound)
    expected = conic_solution(problem.F, problem.d, problem.G, problem.e, problem.layout, problem.slip_bound)
    found = minimum(problem.F, problem.d, feasible, target=1e-8)
    assert found.reached
    assert problem.energy(found.x) == pytest.approx(problem.energy(expected), rel=1e-9)


def test_iterates_stay_in_the_set_and_the_gradient_is_honest():
    problem = random_problem(9, m=0)
    feasible = FeasibleSet(problem.layout, problem.slip_bound)
    found = minimum(problem.F, problem.d, feasible, target=1e-3)
    assert feasible.violation(found.x) <= 1e-14
    np.testing.assert_allclose(found.gradient, problem.F @ found.x - problem.d, atol=1e-12)
    assert 0 < found.projected <= 1e-3


@pytest.mark.parametrize("limit", [3, 8, 20])
def test_the_limit_of_products_of_mpgp_is_kept_and_reported(limit):
    problem, counted = random_problem(9, m=0), []
    quadratic = BoundedQuadratic(
        MPI.COMM_SELF,
        lambda x: counted.append(1) or problem.F @ x,
        problem.d,
        FeasibleSet(problem.layout, problem.slip_bound),
        10.0,
    )
    found = minimise(
        quadratic, np.zeros(len(problem.d)), lambda x: 1e-12, parameters=Mpgp(), max_products=limit
    )
    assert not found.reached
    assert limit <= len(counted) <= limit + 1
    assert 0 < found.iterations < limit


@pytest.mark.parametrize("n", [1, 4, 60])
def test_norm_estimate_bounds_the_norm_from_above_and_closely(n):
    rng = np.random.default_rng(n)
    A = rng.standard_normal((n, n))
    A = A @ A.T
    counted = []
    estimate = largest_eigenvalue(MPI.COMM_SELF, lambda x: counted.append(1) or A @ x, n)
    exact = scipy.linalg.eigvalsh(A)[-1]
    assert exact * (1 - 1e-12) <= estimate <= 1.06 * exact
    assert len(counted) <= 20


def test_norm_of_the_zero_operator_is_zero():
    assert largest_eigenvalue(MPI.COMM_SELF, np.zeros_like, 5) == 0.0
