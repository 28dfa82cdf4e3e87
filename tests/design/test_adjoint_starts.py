"""Adjoints start from what the last one of their objective had, and are as accurate as stated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Checkpoint, ContactProblem, Coulomb, ShapeProblem, box_partition, minimize
from fenics_contact.design import (
    BundleTrust,
    DesignPoint,
    FrictionWork,
    NonlinearConstraint,
    Objective,
    PressureNorm,
    TotalPotential,
)
from fenics_contact.design.adjoint import WeakChoice, WeakPoints, linearise_face, solve_adjoint
from fenics_contact.design.adjoint_starts import adjoint_tolerance
from fenics_contact.design.base import DesignFunction
from fenics_contact.design.sensitivity import by_nodes
from fenics_contact.results.adjoint_starts import AdjointStart, NoAdjointStart, restored
from fenics_contact.results.linear_state import as_linear
from tests.design.chains import BOXES, chain, chain_designs

OBJECTIVES = {"energy": TotalPotential(), "pressure": PressureNorm(), "friction": FrictionWork()}


def posed(objective: Objective, comm: MPI.Comm = MPI.COMM_SELF) -> ShapeProblem:
    """The small chain at the default tolerance."""
    scene = chain(Coulomb(0.3), pull=80e3)
    cut = {name: box_partition(body.mesh, BOXES) for name, body in scene.bodies.items()}
    return ShapeProblem(ContactProblem(scene, comm, partitions=cut), chain_designs(), objective)


def walk(size: int, steps: int, length: float) -> list[np.ndarray]:
    """Return designs without symmetry, each near the one before."""
    random = np.random.default_rng(3)
    first = 0.02 * random.uniform(-1.0, 1.0, size)
    return [first + length * k * random.uniform(-1.0, 1.0, size) for k in range(steps + 1)]


def exact_gradient(problem: ShapeProblem, point: DesignPoint, objective: Objective) -> np.ndarray:
    """Return the gradient at the state of a design by an adjoint that is as accurate as rounding allows."""
    partials = objective.partials(point.state, problem.geometry.forms)
    linearised = linearise_face(point.state, problem.choice)
    adjoint = solve_adjoint(as_linear(point.state, ""), partials, linearised, tolerance=1e-11)
    at_nodes = by_nodes(point.state, adjoint, partials, linearised, problem.geometry.forms)
    return problem.geometry.pull_back(at_nodes)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_adjoints_of_neighbouring_designs_save_each_other_products(name: str) -> None:
    """Gradients are as exact as those of adjoints that start from their states alone: as stated."""
    warm, cold = (posed(OBJECTIVES[name]) for _ in range(2))
    designs = walk(warm.size, 3, 0.001)
    iterations = np.zeros((2, len(designs)), dtype=int)
    for k, alpha in enumerate(designs):
        cold._adjoint_start = NoAdjointStart()
        points = warm.evaluate(alpha), cold.evaluate(alpha)
        assert points[0].weak.count == 0
        iterations[:, k] = [point.adjoint_iterations for point in points]
        exact = exact_gradient(warm, points[0], OBJECTIVES[name])
        for point in points:
            off = np.linalg.norm(point.gradient - exact) / np.linalg.norm(exact)
            assert off < 2.0 * adjoint_tolerance(point.tolerance, point.weak)
    assert iterations[0, 0] == iterations[1, 0]
    assert iterations[0, 1:].sum() < 0.8 * iterations[1, 1:].sum()
    assert warm.products < cold.products


def test_a_design_that_is_met_again_needs_few_iterations_of_its_adjoint() -> None:
    problem = posed(FrictionWork())
    alpha = walk(problem.size, 0, 0.0)[0]
    first, again = problem.evaluate(alpha), problem.evaluate(alpha)
    assert first.adjoint_iterations > 10
    assert again.adjoint_iterations < 5
    assert np.linalg.norm(again.gradient - first.gradient) < 2e-5 * np.linalg.norm(first.gradient)


def test_each_objective_has_its_own_start() -> None:
    """A constraint's adjoint does not start from the objective's, nor the other way round."""
    problem = posed(TotalPotential())
    limit = problem.function(PressureNorm())
    alone = posed(TotalPotential())
    for alpha in walk(problem.size, 2, 0.002):
        value, gradient = problem(alpha)
        limit(alpha)
        expected = alone(alpha)
        assert value == expected[0]
        assert gradient.tolist() == expected[1].tolist()
    own = limit._own._adjoint_start  # type: ignore[attr-defined]
    assert isinstance(own, AdjointStart)
    assert own is not problem._adjoint_start


def test_a_start_has_no_part_along_the_multiplier_of_its_state_and_is_stored_whole() -> None:
    problem = posed(TotalPotential())
    point = problem.evaluate(walk(problem.size, 0, 0.0)[0])
    start, multiplier = problem._adjoint_start, point.state.solution.multiplier
    assert isinstance(start, AdjointStart)
    size = np.linalg.norm(start.rest) * np.linalg.norm(multiplier)
    assert abs(start.rest @ multiplier) < 1e-12 * size
    assert 0.0 < np.linalg.norm(start.rest) < 0.2 * np.linalg.norm(point.adjoint_multiplier)
    again = restored(start.stored(), point.state.torn)
    assert isinstance(again, AdjointStart)
    assert again.rest.tolist() == start.rest.tolist()
    assert not isinstance(restored({}, point.state.torn), AdjointStart)


def minimised(checkpoint: Checkpoint | None, evaluations: int) -> DesignFunction:
    """Minimise the energy with a bound of the pressure, and return the pressure as it was differentiated."""
    problem = posed(TotalPotential())
    limit = problem.function(PressureNorm())
    minimize(
        problem,
        walk(problem.size, 0, 0.0)[0],
        BundleTrust(max_evaluations=evaluations, raise_on_failure=False),
        bounds=(-0.1, 0.1),
        constraints=NonlinearConstraint(limit, 1e9),
        checkpoint=checkpoint,
    )
    return limit


def test_adjoints_of_constraints_go_on_from_a_checkpoint(tmp_path: Path) -> None:
    """Their gradients are the same to the last bit, as those of the objective are."""
    path = tmp_path / "run.npz"
    minimised(Checkpoint(path), 2)
    whole, gone_on = (minimised(each, 3)._last for each in (None, Checkpoint(path, resume=True)))
    assert whole is not None
    assert gone_on is not None
    assert gone_on.alpha.tolist() == whole.alpha.tolist()
    assert gone_on.adjoint_iterations == whole.adjoint_iterations
    assert gone_on.gradient.tolist() == whole.gradient.tolist()


@pytest.mark.parametrize(
    ("tolerance", "weak", "expected"),
    [
        (1e-6, 0, 1e-5),
        (1e-8, 0, 1e-7),
        (1e-3, 0, 1e-4),
        (1e-6, 1, 1e-7),
        (1e-13, 0, 1e-11),
        (1e-13, 1, 1e-11),
    ],
)
def test_adjoints_are_as_accurate_as_their_states_deserve(
    tolerance: float, weak: int, expected: float
) -> None:
    """Accurate states, as difference quotients need them, have accurate adjoints, kinks more so."""
    for points in WeakPoints(weak, 0, 9, WeakChoice.RELEASED), WeakPoints(0, weak, 0, WeakChoice.RELEASED):
        assert adjoint_tolerance(tolerance, points) == pytest.approx(expected)
