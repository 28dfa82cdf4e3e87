"""The monolithic Newton method solves the same discrete problem as the package."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.cases import newton_block, sliding_block
from benchmarks.cases.monolithic.contact_law import contact_equations
from benchmarks.comparing import force_difference, potential_difference

COUNTS = (8, 4, 4)


def test_newton_and_the_package_find_the_same_forces_and_energy() -> None:
    newton = newton_block.measure(MPI.COMM_SELF, COUNTS, tolerance=1e-9)
    ours = sliding_block.measure(MPI.COMM_SELF, COUNTS, (2, 1, 1), tolerance=1e-9)
    for status in ("open", "stick", "slip"):
        assert newton["counts"][status] == ours["counts"][status] > 0
    assert potential_difference(ours, newton) < 1e-6
    assert force_difference(ours, newton) < 1e-6


def test_the_derivative_of_the_contact_equations_is_that_of_differences() -> None:
    generator = np.random.default_rng(1)
    n = 80
    force, displacement = generator.normal(size=(n, 3)), 0.3 * generator.normal(size=(n, 3))
    gap, stiffness = generator.uniform(0, 0.1, n), generator.uniform(1, 2, n)
    change = generator.normal(size=(2, n, 3))
    h = 1e-6

    def value(t: float) -> np.ndarray:
        moved = force + t * change[0], displacement + t * change[1]
        return contact_equations(*moved, gap, 0.8, stiffness).value

    at = contact_equations(force, displacement, gap, 0.8, stiffness)
    assert np.count_nonzero(~at.closed) > 3
    assert np.count_nonzero(at.stick) > 3
    assert np.count_nonzero(at.closed & ~at.stick) > 3
    predicted = np.einsum("nij,nj->ni", at.by_force, change[0])
    predicted += np.einsum("nij,nj->ni", at.by_displacement, change[1])
    assert (value(h) - value(-h)) / (2 * h) == pytest.approx(predicted, abs=1e-6)
