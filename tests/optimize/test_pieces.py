"""Maxima of which several functions are known at a point: fewer evaluations, the same minimum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenics_contact import minimize
from fenics_contact.design import BundleTrust, NonlinearConstraint
from fenics_contact.errors import InvalidInputError

METHOD = BundleTrust(tolerance=1e-7)


class LargestQuadratic:
    """The largest of some convex quadratics, of which it tells all or one."""

    def __init__(self, told: bool, count: int = 12, n: int = 8) -> None:
        rng = np.random.default_rng(7)
        roots = rng.standard_normal((count, n, n))
        self.matrices = np.einsum("kij,klj->kil", roots, roots) / n + np.eye(n)
        self.centres, self.told, self.calls = rng.standard_normal((count, n)), told, 0

    def all(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned = np.einsum("kij,kj->ki", self.matrices, x - self.centres)
        return 0.5 * np.einsum("ki,ki->k", turned, x - self.centres), turned

    def __call__(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        self.calls += 1
        values, slopes = self.all(x)
        return float(values.max()), slopes[values.argmax()]

    def pieces(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = self.all(x)
        rest = np.delete(np.arange(len(values)), values.argmax()) if self.told else []
        return values[rest], slopes[rest].reshape(-1, len(x))


@pytest.mark.parametrize("start", [0.0, 3.0])
def test_all_planes_find_the_minimum_in_fewer_evaluations(start: float) -> None:
    one, all_told = LargestQuadratic(False), LargestQuadratic(True)
    x0 = np.full(8, start)
    slow, fast = minimize(one, x0, METHOD), minimize(all_told, x0, METHOD)
    assert fast.reason.success
    assert fast.value == pytest.approx(slow.value, rel=1e-6)
    assert fast.evaluations == all_told.calls
    assert fast.evaluations < 0.6 * slow.evaluations


def test_small_bundles_and_constraints_go_with_them() -> None:
    fun, plain = LargestQuadratic(True), LargestQuadratic(False)
    ball = NonlinearConstraint(lambda x: (float(x @ x), 2.0 * x), upper=0.01, name="ball")
    known = minimize(plain, np.zeros(8), METHOD, constraints=ball)
    small = minimize(fun, np.zeros(8), BundleTrust(tolerance=1e-7, max_bundle=5), constraints=ball)
    assert small.value == pytest.approx(known.value, rel=1e-5)
    assert small.x @ small.x <= 0.01 * (1 + 1e-6)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((np.zeros(2), np.zeros((2, 3))), r"pieces must return values \(k,\) and subgradients \(k, 8\), got"),
        ((np.array([np.nan]), np.zeros((1, 8))), "pieces must return finite values"),
    ],
)
def test_pieces_of_another_shape_are_refused(given: Any, words: str) -> None:
    fun = LargestQuadratic(True)
    fun.pieces = lambda x: given  # type: ignore[method-assign]
    with pytest.raises(InvalidInputError, match=words):
        minimize(fun, np.zeros(8), METHOD)
