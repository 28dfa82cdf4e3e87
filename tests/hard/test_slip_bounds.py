"""Slip bounds of exactly zero on some nodes, beside large ones: given to the dual solvers directly."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import FixedPoint, Tresca
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.qp import DualSolution, DualSolver, FaceNewton, Smalse, solve
from tests.hard.conftest import Record
from tests.scenes import partitions, pressed_block
from tools.hard_cases.trial import TOLERANCE, fallbacks

SOLVERS: dict[str, DualSolver] = {
    "face Newton": FaceNewton(tolerance=TOLERANCE),
    "SMALSE": Smalse(tolerance=TOLERANCE),
}


def system() -> DualSystem:
    scene = pressed_block(Tresca(0.5))
    return DualSystem(build_torn_system(scene, decompose(scene, partitions(scene), MPI.COMM_SELF)))


def natural(dual: DualSystem, solution: DualSolution, bound: np.ndarray) -> float:
    """Return ‖λ − P(λ − r/diag F)‖ over ‖λ_N‖, from a fresh product."""
    problem, layout, multiplier = dual.problem, dual.problem.layout, solution.multiplier
    r = dual.apply(multiplier) - problem.rhs - problem.coarse.transpose(solution.alpha)
    normal, tau = multiplier[layout.normal], multiplier[layout.tangential]
    pushed = np.maximum(normal - r[layout.normal] / problem.diagonal[layout.normal], 0.0)
    drawn = tau - r[layout.tangential] / problem.diagonal[layout.tangential].mean(axis=1, keepdims=True)
    length = np.linalg.norm(drawn, axis=1)
    drawn *= np.minimum(1.0, bound / np.where(length > 0, length, 1.0))[:, None]
    return float(
        np.hypot(np.linalg.norm(normal - pushed), np.linalg.norm(tau - drawn)) / np.linalg.norm(normal)
    )


@pytest.mark.parametrize("coulomb", [False, True], ids=["given bounds", "bounds that follow the pressure"])
@pytest.mark.parametrize("name", SOLVERS)
def test_a_slip_bound_of_exactly_zero_on_every_other_node(name: str, coulomb: bool, record: Record) -> None:
    dual = system()
    layout = dual.problem.layout
    every_other = np.arange(layout.n_friction) % 2 == 0
    if coulomb:
        mu = np.where(every_other, 0.0, 0.4)
        solver = FixedPoint(SOLVERS[name]) if name == "SMALSE" else SOLVERS[name]
        solution = solve(dual.problem, None, solver, friction_coefficient=mu)
        bound = mu * np.maximum(solution.multiplier[layout.tangential_frictional], 0.0)
    else:
        bound = np.where(every_other, 0.0, 0.05)
        solution = solve(dual.problem, bound, SOLVERS[name])
    tau = np.linalg.norm(solution.multiplier[layout.tangential], axis=1)
    assert tau[every_other].max() == 0.0
    assert tau[~every_other].max() > 0.01
    assert (tau - bound).max() <= TOLERANCE * np.linalg.norm(solution.multiplier[layout.normal])
    found = natural(dual, solution, bound)
    assert found <= 1.01 * TOLERANCE
    record(
        "friction",
        f"{name}, slip bounds of zero on every other node, {'μ λ_N' if coulomb else 'given ones'} elsewhere",
        scene=f"{dual.torn.decomposition.torn_unknowns} / 2 / {layout.n_contact}", tolerance=TOLERANCE,
        products=solution.products, steps=solution.iterations, natural=found,
        fallbacks=fallbacks(solution.history),
    )  # fmt: skip


def test_slip_bounds_of_zero_everywhere_are_no_friction(record: Record) -> None:
    dual = system()
    layout = dual.problem.layout
    nothing = np.zeros(layout.n_friction)
    solution = solve(dual.problem, nothing, SOLVERS["face Newton"])
    scene = pressed_block(None)
    smooth = DualSystem(build_torn_system(scene, decompose(scene, partitions(scene), MPI.COMM_SELF)))
    expected = solve(smooth.problem, None, SOLVERS["face Newton"])
    normal = solution.multiplier[layout.normal]
    other = expected.multiplier[smooth.problem.layout.normal]
    same = float(np.abs(normal - other).max() / np.abs(other).max())
    assert np.abs(solution.multiplier[layout.tangential]).max() == 0.0
    assert same <= 1e-7
    record(
        "friction", "a slip bound of zero on all nodes, the same as no friction", tolerance=TOLERANCE,
        scene=f"{dual.torn.decomposition.torn_unknowns} / 2 / {layout.n_contact}", products=solution.products,
        steps=solution.iterations, natural=natural(dual, solution, nothing), same=same,
        fallbacks=fallbacks(solution.history),
    )  # fmt: skip
