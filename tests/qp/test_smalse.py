"""SMALSE-M and MPGP: what their parameters may be, what they cost, and the rates that theory has for them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.qp import Mpgp, Smalse, solve
from tests.qp.random_problems import random_problem

NAN = float("nan")


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: Mpgp(expansion=2.0), r"expansion of Mpgp, ᾱ‖A‖, must be in \(0, 2.0\), got 2.0: leave"),
        (lambda: Mpgp(expansion=0.0), r"expansion of Mpgp, ᾱ‖A‖, must be in \(0, 2.0\), got 0.0"),
        (lambda: Mpgp(expansion=NAN), r"expansion of Mpgp, ᾱ‖A‖, must be in \(0, 2.0\), got nan"),
        (lambda: Mpgp(proportioning=0.0), r"proportioning of Mpgp, Γ, must be in \(0, ∞\), got 0.0"),
        (lambda: Smalse(balance=-1.0), r"balance of Smalse, M, must be in \(0, ∞\), got -1.0"),
        (lambda: Smalse(loosest=np.inf), r"loosest of Smalse, η, must be in \(0, ∞\), got inf"),
        (
            lambda: Smalse(balance_reduction=1.0),
            r"balance_reduction of Smalse, 1/β, must be in \(0, 1.0\), got 1.0: leave it out for the default",
        ),
    ],
)
def test_parameters_without_a_proof_of_convergence_are_refused(
    made: Callable[[], Smalse | Mpgp], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        made()


def test_parameters_within_their_ranges_are_taken() -> None:
    assert Smalse(mpgp=Mpgp(1e-3, 1e3), balance=1e-3, balance_reduction=0.999).mpgp.expansion == 1e-3


@pytest.mark.parametrize("seed", range(1, 5))
@pytest.mark.parametrize("most", [20, 40, 100])
def test_no_more_products_are_used_than_allowed(seed: int, most: int) -> None:
    """But the second one of a last gradient projection; it used to be up to 70 % more."""
    problem = random_problem(seed, n_contact=60)
    solver = Smalse(tolerance=1e-12, max_products=most, loosest=1e-13)
    with pytest.raises(ConvergenceError, match="raise max_products") as caught:
        solve(problem.dual, problem.slip_bound, solver)
    assert most <= caught.value.history[-1].products <= most + 1
