"""Contradicting rows move forces until the first of their contacts changes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fenics_contact.qp.newton_steps import _until_open, _until_slip, contradiction


def test_a_falling_force_opens_where_it_vanishes() -> None:
    assert _until_open(np.array([3.0, 3.0, -1.0]), np.array([-2.0, 2.0, -1.0])).tolist() == [1.5, np.inf, 0.0]


@pytest.mark.parametrize("pressing", [0.0, 0.4, -0.4, 3.0, -3.0])
def test_a_disc_slips_where_it_first_meets_its_bound(pressing: float) -> None:
    rng = np.random.default_rng(0)
    trial, moved = rng.uniform(-0.6, 0.6, (50, 2)), rng.normal(size=(50, 2))
    found = _until_slip(trial, moved, np.ones(50), np.full(50, pressing))
    times = np.linspace(0.0, 50.0, 200_001)
    length = np.linalg.norm(trial[:, None] + times[:, None] * moved[:, None], axis=2)
    outside = length > 1.0 + times * pressing
    first = np.where(outside.any(axis=1), times[outside.argmax(axis=1)], np.inf)
    np.testing.assert_allclose(found, first, atol=3e-4)
    assert np.isfinite(found).any() == (pressing < 2.0)


def test_a_disc_that_slips_already_needs_no_more() -> None:
    assert _until_slip(np.array([[2.0, 0.0]]), np.array([[1.0, 0.0]]), np.ones(1), np.zeros(1)) == 0.0


class _AllDependent:
    """Rows of a face that all contradict each other."""

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        return residual

    def contradiction(self, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        return residual, -residual, np.zeros(len(residual), dtype=np.int64), 1


@pytest.mark.parametrize(("pushed", "contradicts"), [(0.0, True), (1e-9, True), (1e-3, False)])
def test_forces_that_push_a_free_rigid_surface_are_no_contradiction(pushed: float, contradicts: bool) -> None:
    """They deform nothing, but do not preserve equilibrium, so they must not grow."""
    norm = np.linalg.norm
    coarse = SimpleNamespace(apply=lambda force: pushed * force, norm=norm)
    face = SimpleNamespace(prolong=lambda vector: vector, restrict=lambda vector: vector)
    problem, system = SimpleNamespace(coarse=coarse, norm=norm), SimpleNamespace(face=face)
    system.preconditioner = _AllDependent()
    found = contradiction(cast("Any", problem), cast("Any", system), np.array([1.0, -2.0]))
    assert (found is not None) == contradicts
    assert found is None or found.direction.tolist() == [-1.0, 2.0]
