"""Where a face is solved no further: when what it does not know exceeds what is left of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from fenics_contact.qp import DualProblem, FaceNewton, Stop, newton_steps, solve
from fenics_contact.qp.cones import CoulombLaw, Proportional
from fenics_contact.qp.face import classify
from fenics_contact.qp.face_system import FaceSystems
from fenics_contact.qp.krylov import Enough, FaceStep, Krylov, gmres, never, projected_cg, projected_gmres
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.qp.solution import contact_step
from tests.qp.random_problems import random_problem
from tests.qp.torn_bricks import Bricks, torn_problem


def problem() -> DualProblem:
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5))
    return dual.with_law(CoulombLaw(dual.layout, Proportional(np.full(dual.layout.n_friction, 0.3))))


def test_conjugate_gradients_end_where_a_step_is_enough() -> None:
    dual, rng, asked = random_problem(3).dual, np.random.default_rng(0), list[float]()
    start, step = dual.coarse.particular(), contact_step(dual.layout, dual.diagonal)
    face = classify(dual.layout, dual.law.bound(start), start, np.zeros_like(start), step)
    system = FaceSystems(dual, CountedOperator(dual.operator)).build(face)
    gradient = rng.standard_normal(face.restriction.shape[1])
    weights = np.ones_like(gradient)

    def enough(found: Callable[[], tuple[np.ndarray, np.ndarray]], size: float) -> bool:
        step, product = found()
        assert product == pytest.approx(dual.operator(system.advance(step)))
        asked.append(size)
        return len(asked) == 2

    found = projected_cg(system, gradient, weights, 1e-12, 100, enough)
    assert (found.stop, found.iterations, found.measure) == (Stop.ENOUGH, 8, asked[-1])
    assert projected_cg(system, gradient, weights, 1e-12, 100).iterations > 8


def test_gmres_ends_where_a_step_is_enough() -> None:
    dual, rng = random_problem(3).dual, np.random.default_rng(0)
    first, asked = rng.standard_normal(dual.layout.size), list[float]()

    def expand(vector: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        return dual.operator(vector), (vector,)

    def enough(at: Callable[[], Krylov], size: float) -> bool:
        found = at()
        left = np.linalg.norm(first - dual.operator(found.combined(0, len(first))))
        assert left == pytest.approx(found.residual)
        assert size == found.residual
        asked.append(size)
        return len(asked) == 2

    found = gmres(dual.comm, first, expand, 1e-12, 100, 60, enough)
    assert (found.stop, found.iterations, found.residual) == (Stop.ENOUGH, 8, asked[-1])


def test_a_face_whose_statuses_stay_is_asked_what_it_does_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a status change the tolerance is loose, and the face is not asked."""
    calls: list[tuple[Enough, FaceStep]] = []

    def recorded(method: Any) -> Any:
        def call(*given: Any) -> FaceStep:
            calls.append((given[-1], found := method(*given)))
            return found

        return call

    for name, method in (("projected_cg", projected_cg), ("projected_gmres", projected_gmres)):
        monkeypatch.setattr(newton_steps, name, recorded(method))
    history = solve(dual := problem(), None, FaceNewton(tolerance=1e-8), law=dual.law).history
    stays = [", 0 status changes" in line.note for line in history]
    assert [enough is not never for enough, _ in calls] == stays
    assert 1 < sum(stays) < len(stays)
    for enough, found in calls:
        if enough is not never:
            at = partial(_end, found)
            if found.iterations < 4:  # not asked yet
                assert not enough(at, 1e-300), "what is left may fall with the face"
            assert enough(at, 1e-300), "what the face does not know has not fallen"
            assert not enough(at, 1e300)


def _end(found: FaceStep) -> tuple[np.ndarray, np.ndarray]:
    return found.step, found.product
