"""Certificates of errors, whole and in parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    FixedPoint,
    RigidPlane,
    Scene,
    Status,
    Support,
    Surface,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
)
from fenics_contact._accuracy import certificate
from fenics_contact._accuracy.certificate import Certificate, certify, direct_error
from fenics_contact._accuracy.discretisation import discretisation_error
from fenics_contact._accuracy.state_errors import friction_error, solver_errors, state_errors
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.qp import DualSolution, DualSolver, FaceNewton, Smalse
from fenics_contact.qp.cones import FeasibleSet
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.dual_solve import solve_dual
from fenics_contact.results.linear_state import DirectState
from tests import scenes
from tests.accuracy.algebraic import CASES, Measured, clamped, energy_norm, measured, solved


def assert_certified(found: Measured, factor: float = 10.0) -> None:
    """Require an upper bound that is not much more, and that both errors together tell the whole one.

    That holds for the displacement as the solver found it and for that of whole bodies, which fields show.
    """
    assert found.error > 0.0
    assert max(found.error, found.shown) <= found.bound < factor * max(found.error, found.shown)
    whole = max(found.whole, found.shown_whole)
    assert whole <= found.bound + found.friction < factor * whole


@pytest.mark.parametrize("name", CASES)
def test_the_bound_is_above_the_error_and_near_it(name: str) -> None:
    """At the tolerance that users get, and at a loose one."""
    for tolerance in (None, 1e-2):
        assert_certified(measured(solved(name, tolerance), CASES[name].finest), CASES[name].factor)


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        (name, tolerance)
        for name, case in CASES.items()
        for tolerance in (1e-1, 1e-3, 1e-5, 1e-8)
        if tolerance >= 1e3 * case.finest
    ],
)
def test_the_bound_is_near_the_error_at_every_tolerance(name: str, tolerance: float) -> None:
    assert_certified(measured(solved(name, tolerance), CASES[name].finest), CASES[name].factor)


def state_of(scene: Scene, solver: DualSolver, boxes: tuple[int, int, int] = (2, 1, 1)) -> Measured:
    state = solve_scene(scene, MPI.COMM_SELF, partitions=scenes.partitions(scene, boxes), solver=solver)
    return measured(state)


@pytest.mark.parametrize(
    ("scene", "solver"),
    [
        (scenes.block_on_plane(Coulomb(0.6)), Smalse(tolerance=1e-3)),
        (scenes.two_blocks(Tresca(0.8)), Smalse(tolerance=1e-3)),
        (scenes.pressed_block(Coulomb(0.3)), FixedPoint(FaceNewton(tolerance=1e-3))),
    ],
    ids=["SMALSE with a floating body", "SMALSE", "two loops"],
)
def test_answers_out_of_balance_and_outside_the_cone_are_certified(scene: Scene, solver: DualSolver) -> None:
    found = state_of(scene, solver)
    assert found.certificate.moved > 0.0, "nothing had to be moved into the cone"
    assert_certified(found)


@pytest.mark.parametrize("reserve", [1e-1, 1e-3, 1e-6])
def test_a_load_that_friction_just_resists_is_certified(reserve: float) -> None:
    push = np.hypot(1.0, 0.3)  # on as much area as the floor
    scene = scenes.block_on_plane(Tresca((1.0 + reserve) * push))
    found = state_of(scene, FaceNewton(tolerance=1e-4))
    known = found.certificate.known.statuses
    assert np.count_nonzero(known.slip) > np.count_nonzero(known.stick)
    assert_certified(found)


@pytest.mark.parametrize("boxes", [(1, 1, 1), (3, 1, 1), (2, 3, 2), (6, 3, 1)])
def test_every_partition_is_certified(boxes: tuple[int, int, int]) -> None:
    found = state_of(scenes.block_on_plane(Coulomb(0.6)), FaceNewton(tolerance=1e-3), boxes)
    assert np.count_nonzero(found.certificate.known.statuses.closed) > 0
    assert_certified(found)


@pytest.mark.parametrize("unit", [1e-6, 1e9])
def test_the_bound_scales_with_the_unit_of_force(unit: float) -> None:
    scene = scenes.two_blocks(Coulomb(0.38))
    bodies = {
        name: replace(body, material=replace(body.material, young_modulus=unit * body.material.young_modulus))
        for name, body in scene.bodies.items()
    }
    loads = [replace(load, value=tuple(unit * np.array(load.value))) for load in scene.loads]
    solver = FaceNewton(tolerance=1e-4)
    plain, scaled = state_of(scene, solver), state_of(replace(scene, bodies=bodies, loads=loads), solver)
    assert scaled.bound == pytest.approx(plain.bound, rel=1e-3)
    assert scaled.friction == pytest.approx(plain.friction, rel=1e-3)


def test_an_admissible_pair_is_what_it_says() -> None:
    state = solved("a body that friction holds", 1e-2)
    problem, known = state.dual.problem, certify(state.dual, state.dual_solution).known
    normal, tau = known.multiplier[problem.layout.normal], known.multiplier[problem.layout.tangential]
    assert normal.min() >= 0.0
    assert np.all(np.linalg.norm(tau, axis=1) <= known.slip_bound * (1 + 1e-14))
    assert problem.coarse.residual(known.multiplier) == pytest.approx(0.0, abs=1e-11)
    assert np.array_equal(known.slip_bound, state.dual_solution.slip_bound)
    assert {state.contact.count(status) > 0 for status in Status} == {True}


def test_a_state_without_a_load_has_no_error() -> None:
    scene = replace(clamped(), loads=[])
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions={"block": CASES["a linear block"].cut(scene)["block"]}
    )
    errors = state.estimate_errors()
    assert (errors.algebraic, errors.friction, errors.discretisation) == (0.0, 0.0, 0.0)


def test_the_error_of_a_factorisation_is_that_of_its_residual() -> None:
    scene = clamped()
    whole = {"block": np.zeros(scene.bodies["block"].mesh.n_cells, dtype=int)}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=whole)
    assert isinstance(state, DirectState)
    system, solution = state.system, state.solution
    norm = energy_norm(state, solution.displacement)
    assert direct_error(system, solution) < 1e-12 * norm
    free = np.setdiff1d(np.arange(len(solution.displacement)), state.torn.B.indices)
    off = np.zeros_like(solution.displacement)
    off[free] = 1e-3 * np.abs(solution.displacement).max() * np.sin(np.arange(len(free)))
    wrong = replace(solution, displacement=solution.displacement + off)
    assert direct_error(system, wrong) == pytest.approx(energy_norm(state, off), rel=1e-9)


# States in which one part of the certificate decides: without it the bound would be below the error.

#: Friction can resist twice the push.
BOUND, PUSH = 0.1, 0.05


def lying(push: float, cells: tuple[int, int], friction: Tresca | None = None) -> AnyState:
    """A block that lies on a floor, in one piece: nothing but contact holds it."""
    mesh = rectangle((0.0, 0.0), (3.0, 1.0), cells)
    scene = Scene(
        {"block": Body(mesh, PlaneStrain(100.0, 0.3))},
        loads=[Traction("block", "y1", (push, -1.0))],
        contacts=[ContactPair(Surface("block", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), friction)],
    )
    whole = {"block": np.zeros(mesh.n_cells, dtype=int)}
    return solve_scene(scene, MPI.COMM_SELF, partitions=whole, solver=FaceNewton(tolerance=1e-11))


def made(state: AnyState, multiplier: np.ndarray, way: np.ndarray) -> DualSolution:
    """Return the state of a multiplier with the block moved rigidly besides by a vector."""
    problem = state.dual.problem
    product = problem.operator(multiplier)
    mesh = state.torn.decomposition.meshes[0]
    alpha = state.dual_solution.alpha + np.linalg.lstsq(
        state.dual.kernel.tocsr().toarray(), np.tile(way, len(mesh.nodes)), rcond=None
    )[0]  # fmt: skip
    residual = product - problem.rhs - problem.coarse.transpose(alpha)
    return replace(
        state.dual_solution, multiplier=multiplier, product=product, alpha=alpha, residual=residual
    )


def error_of(state: AnyState, solution: DualSolution) -> float:
    found = state.dual.displacement(solution.multiplier, solution.alpha)
    return energy_norm(state, found - state.torn_displacement)


def without(part: str, patch: pytest.MonkeyPatch, state: AnyState, solution: DualSolution) -> Certificate:
    with patch.context() as context:
        context.setattr(FeasibleSet, part, lambda *_: 0.0)
        return certify(state.dual, solution)


@pytest.mark.parametrize("cells", [(3, 1), (5, 3), (7, 2)])
def test_forces_across_a_gap_do_work(cells: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    """The block hovers over the floor, on forces that balance its load."""
    state = lying(0.0, cells)
    problem = state.dual.problem
    layout = problem.layout
    hovering = made(state, problem.coarse.particular(), np.array([0.0, 1.0]))
    assert hovering.multiplier[layout.normal].min() > 0.0
    found = certify(state.dual, hovering)
    np.testing.assert_allclose(found.known.multiplier, hovering.multiplier, atol=1e-12)
    assert not found.known.statuses.closed.any()
    error = error_of(state, hovering)
    assert error > 0.05 * energy_norm(state, state.torn_displacement)
    assert error <= found.bound
    assert without("pressed", monkeypatch, state, hovering).bound < 0.1 * error
    np.testing.assert_allclose(
        found.gap, hovering.multiplier[layout.normal] @ hovering.residual[layout.normal], rtol=1e-9
    )


@pytest.mark.parametrize("cells", [(3, 1), (5, 3), (7, 2)])
def test_friction_that_falls_short_of_its_bound_does_less_work(
    cells: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The block slides, though only a part of its nodes resists as much as it could."""
    state = lying(PUSH, cells, Tresca(BOUND))
    layout = state.dual.problem.layout
    bound = state.dual_solution.slip_bound
    multiplier = state.dual_solution.multiplier.copy()
    order = np.argsort(np.abs(state.contact_places[:, 0] - 1.5))
    resisting = np.zeros(len(bound))
    left = 3.0 * PUSH
    for disc in order:  # from the middle outwards
        resisting[disc] = min(bound[disc], left)
        left -= resisting[disc]
    sign = np.sign(multiplier[layout.tangential].sum())
    multiplier[layout.tangential[:, 0]] = sign * resisting
    sliding = made(state, multiplier, np.array([1.0, 0.0]))
    for _ in range(3):  # what is moved into the cone once stays there
        sliding = made(state, certify(state.dual, sliding).known.multiplier, np.array([1.0, 0.0]))
    found, error = certify(state.dual, sliding), error_of(state, sliding)
    assert found.moved < 0.1 * error
    assert error > 1e-3 * energy_norm(state, state.torn_displacement)
    assert error <= found.bound
    assert without("rubbed", monkeypatch, state, sliding).bound < 0.9 * error


@pytest.mark.parametrize(
    ("scene", "solver"),
    [
        (scenes.two_blocks(Coulomb(2.0)), FaceNewton(tolerance=1e-3)),
        (scenes.pressed_block(Coulomb(1.0), push=0.1), FixedPoint(FaceNewton(tolerance=1e-2))),
    ],
    ids=["one loop", "two loops"],
)
def test_the_estimate_by_the_law_of_friction_is_needed(scene: Scene, solver: FaceNewton | FixedPoint) -> None:
    """What separates a state from Coulomb's law may be more than the bound at its own slip bounds."""
    state = solve_scene(scene, MPI.COMM_SELF, partitions=scenes.partitions(scene), solver=solver)
    found = measured(state)
    assert found.error <= found.bound
    assert found.bound < found.whole <= found.bound + found.friction
    errors = state.estimate_errors()
    assert "(at most, at the slip bounds of the state)" in str(errors)
    assert errors.algebraic + errors.friction == pytest.approx(found.bound + found.friction, rel=0.02)


def worst(state: AnyState, sewn: bool) -> np.ndarray:
    """Return the error of the multiplier for which a bound of the other displacement alone is least enough.

    Every row is closed, so that all is linear: δλ moves by u = −K⁺Bᵀδλ, w closes its rows, a sews them. The
    result has the largest ‖u + a‖ for a given ‖w‖, or the largest ‖u‖ for a given ½‖w‖ + ‖a − ½w‖, nearly.
    """
    system, problem = state.dual, state.dual.problem
    size = len(state.dual_solution.multiplier)
    balanced = scipy.linalg.orth(np.column_stack([problem.coarse.project(unit) for unit in np.eye(size)]))
    closing = system.preconditioner.lifting(sp.identity(size, format="csr"))
    found = []
    for change in balanced.T:
        residual = problem.coarse.project(problem.operator(change))
        sewing, way = system.sewn(residual), closing.jump(residual)
        moved = -system.inverse(system.force(change))
        found.append([moved, *map(system.inverse.extend, (sewing, way))])
    u, a, w = np.array(found).transpose(1, 2, 0)
    K = sp.block_diag([subdomain.stiffness for subdomain in state.torn.subdomains])
    energy = [part.T @ (K @ part) for part in (u, u + a, w, a - 0.5 * w)]
    above, below = (energy[1], energy[2]) if sewn else (energy[0], 0.25 * energy[2] + energy[3])
    _, vectors = scipy.linalg.eigh(above, below + 1e-9 * np.trace(below) * np.eye(len(below)))
    return np.asarray(balanced @ vectors[:, -1])


@pytest.mark.parametrize("sewn", [True, False])
def test_the_bound_is_that_of_both_displacements(sewn: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sewing may lead away from the solution or to it: one displacement may be farther than the other."""
    mesh = rectangle((0.0, 0.0), (3.0, 1.0), (4, 2))
    scene = Scene(
        {"block": Body(mesh, PlaneStrain(100.0, 0.3))},
        [Support("block", "y1", (0.0, -0.05))],
        contacts=[ContactPair(Surface("block", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)))],
    )
    cut = {"block": box_partition(mesh, (2, 1))}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-12))
    system, exact = state.dual, state.dual_solution
    change = worst(state, sewn)
    change *= 0.01 * np.linalg.norm(exact.multiplier) / np.linalg.norm(change)
    product = system.problem.operator(exact.multiplier + change)
    alpha = system.problem.coarse.coefficients(product - system.problem.rhs)
    residual = product - system.problem.rhs - system.problem.coarse.transpose(alpha)
    found = replace(
        exact, multiplier=exact.multiplier + change, product=product, alpha=alpha, residual=residual
    )
    torn = system.displacement(found.multiplier, alpha)
    errors = [energy_norm(state, u - state.torn_displacement) for u in (torn, system.conforming(torn))]
    assert max(errors) <= certify(system, found).bound
    both = certificate._distances
    other = 0 if sewn else 1
    with monkeypatch.context() as patch:
        patch.setattr(certificate, "_distances", lambda *given: (both(*given)[other],))
        assert certify(system, found).bound < 0.95 * errors[1 - other]


def test_given_slip_bounds_are_never_raised() -> None:
    """Where no friction within them balances the load nothing is known of the error, and that is said."""
    state = lying(PUSH, (5, 3), Tresca(BOUND))
    weak = replace(state.dual_solution, slip_bound=0.4 * state.dual_solution.slip_bound)
    found = certify(state.dual, weak)
    np.testing.assert_array_equal(found.known.slip_bound, weak.slip_bound)
    assert found.known.unbalanced > 1e-3
    assert found.bound == np.inf
    estimate = discretisation_error(state.torn, state.conforming_displacement)
    told = str(state_errors(solver_errors(state.dual, weak), estimate, state.energies.norm))
    assert "algebraic       unknown" in told
    assert "(at most)" in str(state.estimate_errors())


def test_slip_bounds_that_follow_normal_forces_are_raised_where_these_are_too_weak() -> None:
    """Friction holds the block by a thousandth, the solver knows normal forces to a tenth."""
    resisted = np.hypot(1.0, 0.3) / 2.0
    scene = scenes.block_on_plane(Coulomb(1.001 * resisted))
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions=scenes.partitions(scene), solver=FixedPoint(Smalse(tolerance=0.1))
    )
    system, solution = state.dual, state.dual_solution
    found = certify(system, solution)
    push = np.hypot(2.0, 0.6)
    assert solution.slip_bound.sum() < push <= found.known.slip_bound.sum() * (1 + 1e-9)
    assert np.all(found.known.slip_bound >= solution.slip_bound)
    exact = solve_dual(system, FaceNewton(tolerance=1e-10))
    error = energy_norm(state, state.torn_displacement - system.displacement(exact.multiplier, exact.alpha))
    friction = friction_error(system, solution, found)
    assert error <= found.bound + friction
    not_raised = replace(found, known=replace(found.known, slip_bound=solution.slip_bound))
    assert friction > 1.05 * friction_error(system, solution, not_raised) > 0.0


@pytest.mark.parametrize("reserve", [1e-2, 1e-6, 1e-10])
@pytest.mark.parametrize("tolerance", [1e-1, 1e-2])
def test_friction_that_just_resists_is_balanced_within_given_bounds(reserve: float, tolerance: float) -> None:
    """The set of admissible multipliers is narrow; SMALSE's own are out of balance."""
    scene = scenes.block_on_plane(Tresca((1.0 + reserve) * np.hypot(1.0, 0.3)))
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions=scenes.partitions(scene), solver=Smalse(tolerance=tolerance)
    )
    found = measured(state)
    known = found.certificate.known
    np.testing.assert_array_equal(known.slip_bound, state.dual_solution.slip_bound)
    assert known.unbalanced < 1e-9
    assert 0.0 < max(found.error, found.shown) <= found.bound < 10.0 * found.error
