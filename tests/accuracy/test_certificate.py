"""The certificate is an upper bound of what a solver left, in every scene, and not much more than that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, FixedPoint, Scene, Status, Tresca, solve_scene
from fenics_contact._accuracy.certificate import certify, direct_error
from fenics_contact.feti.direct import DirectSystem
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from tests.accuracy.algebraic import CASES, Measured, clamped, energy_norm, measured, solved
from tests.contact import gallery


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
    state = solve_scene(scene, MPI.COMM_SELF, partitions=gallery.partitions(scene, boxes), solver=solver)
    return measured(state)


@pytest.mark.parametrize(
    ("scene", "solver"),
    [
        (gallery.block_on_plane(Coulomb(0.6)), Smalse(tolerance=1e-3)),
        (gallery.two_blocks(Tresca(0.8)), Smalse(tolerance=1e-3)),
        (gallery.pressed_block(Coulomb(0.3)), FixedPoint(FaceNewton(tolerance=1e-3))),
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
    scene = gallery.block_on_plane(Tresca((1.0 + reserve) * push))
    found = state_of(scene, FaceNewton(tolerance=1e-4))
    known = found.certificate.known.statuses
    assert np.count_nonzero(known.slip) > np.count_nonzero(known.stick)
    assert_certified(found)


@pytest.mark.parametrize("boxes", [(1, 1, 1), (3, 1, 1), (2, 3, 2), (6, 3, 1)])
def test_every_partition_is_certified(boxes: tuple[int, int, int]) -> None:
    found = state_of(gallery.block_on_plane(Coulomb(0.6)), FaceNewton(tolerance=1e-3), boxes)
    assert np.count_nonzero(found.certificate.known.statuses.closed) > 0
    assert_certified(found)


@pytest.mark.parametrize("unit", [1e-6, 1e9])
def test_the_bound_scales_with_the_unit_of_force(unit: float) -> None:
    scene = gallery.two_blocks(Coulomb(0.38))
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
    system, solution = state.system, state.solution
    assert isinstance(system, DirectSystem)
    norm = energy_norm(state, solution.displacement)
    assert direct_error(system, solution) < 1e-12 * norm
    free = np.setdiff1d(np.arange(len(solution.displacement)), state.torn.B.indices)
    off = np.zeros_like(solution.displacement)
    off[free] = 1e-3 * np.abs(solution.displacement).max() * np.sin(np.arange(len(free)))
    wrong = replace(solution, displacement=solution.displacement + off)
    assert direct_error(system, wrong) == pytest.approx(energy_norm(state, off), rel=1e-9)
