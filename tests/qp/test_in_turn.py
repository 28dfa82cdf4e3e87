"""Solvers in turn: what one has found is the start of the next, and the solution says which has solved it."""

from __future__ import annotations

import logging
from itertools import pairwise

import numpy as np
import pytest

from fenics_contact import FixedPoint
from fenics_contact.qp import FaceNewton, InTurn, Smalse, solve
from fenics_contact.qp.solution import StoppedError
from tests.qp.published_friction import cone_residual
from tests.qp.rigid_bodies import rigid_problem

TOLERANCE = 1e-8
#: A stack of boxes whose W is singular.
SEED = 4


def counted(history) -> bool:
    """Return whether steps are numbered through, and products and numbers of solves never fall."""
    numbered = [step.iteration for step in history] == list(range(len(history)))
    rising = all(a.products <= b.products and a.outer <= b.outer for a, b in pairwise(history))
    return numbered and rising


def test_where_the_first_solves_the_others_do_nothing() -> None:
    dual, mu_f = rigid_problem(SEED)
    alone = solve(dual, None, FaceNewton(tolerance=TOLERANCE), friction_coefficient=mu_f)
    found = solve(dual, None, InTurn().with_tolerance(TOLERANCE), friction_coefficient=mu_f)
    assert found.products == alone.products
    assert found.reason == alone.reason
    np.testing.assert_array_equal(found.multiplier, alone.multiplier)


@pytest.mark.parametrize("first", [FaceNewton(max_products=60), FixedPoint(Smalse(), max_products=100)])
def test_the_next_goes_on_from_what_the_first_has_found_and_says_so(first, caplog) -> None:
    dual, mu_f = rigid_problem(SEED)
    solvers = InTurn((first, FixedPoint(FaceNewton()), FaceNewton())).with_tolerance(TOLERANCE)
    with pytest.raises(StoppedError) as stopped:
        solve(dual, None, solvers.solvers[0], friction_coefficient=mu_f)
    with caplog.at_level(logging.INFO):
        found = solve(dual, None, solvers, friction_coefficient=mu_f)
    assert cone_residual(dual, mu_f, found.multiplier) <= TOLERANCE
    earlier = stopped.value.history
    assert [str(step) for step in found.history[: len(earlier)]] == [str(step) for step in earlier]
    assert counted(found.history)
    assert found.products > found.history[len(earlier) - 1].products == earlier[-1].products
    assert found.iterations == len(found.history)
    assert "solver 2 of those in turn has reached it" in found.reason
    assert f"FaceNewton stopped at a residual of {stopped.value.best.residuals.worst:.1e}" in caplog.text or (
        "FixedPoint of Smalse stopped" in caplog.text
    )
    assert "FixedPoint of FaceNewton goes on from there" in caplog.text


def test_the_next_begins_with_the_best_multiplier_of_the_one_before() -> None:
    dual, mu_f = rigid_problem(SEED)
    solved = solve(dual, None, FaceNewton(tolerance=1e-6), friction_coefficient=mu_f)
    strict = FaceNewton(tolerance=TOLERANCE, max_products=solved.products - 1)
    found = solve(dual, None, InTurn((strict, FaceNewton(TOLERANCE))), friction_coefficient=mu_f)
    # A second solver that began anew would need all products again.
    assert found.products - strict.max_products < 0.5 * solved.products


def test_where_all_stop_the_error_has_the_history_of_all_and_the_best_multiplier() -> None:
    dual, mu_f = rigid_problem(SEED)
    solvers = InTurn((FaceNewton(max_products=40), FixedPoint(FaceNewton(), max_products=30)))
    told = "face Newton needs residuals below .*; then the Coulomb fixed point needs .*: raise max_products"
    with pytest.raises(StoppedError, match=told) as caught:
        solve(dual, None, solvers.with_tolerance(1e-12), friction_coefficient=mu_f)
    history = caught.value.history
    assert counted(history)
    assert history[-1].outer > 0
    assert history[-1].products >= 70
    assert caught.value.best.residuals.worst < 0.5


def test_products_of_all_together_are_limited() -> None:
    dual, mu_f = rigid_problem(SEED)
    with pytest.raises(StoppedError, match="raise max_products") as caught:
        solve(dual, None, InTurn(max_products=50), friction_coefficient=mu_f)
    assert caught.value.history[-1].products <= 51
