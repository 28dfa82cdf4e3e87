"""Effectivity and rate of the estimate where the solution is smooth and known, for every type of cell.

The solution is prescribed on the boundary and its body force in the volume, both exactly; the true error is
integrated against its analytic gradient.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from fenics_contact._accuracy.discretisation import discretisation_error
from tests.accuracy.smooth import PLANE, Found, mesh_of, solved
from tests.models.elements import CELLS


def estimate(found: Found) -> float:
    return discretisation_error(found.state.torn, found.state.conforming_displacement).total


def series(
    cell: str, sizes: Sequence[int], shake: float, poisson: float = 0.3
) -> tuple[np.ndarray, np.ndarray]:
    """Print and return true errors and estimates."""
    states = [solved(mesh_of(cell, n, shake), poisson) for n in sizes]
    error, estimates = np.array([(found.total, estimate(found)) for found in states]).T
    rates = [np.nan, *(np.log(error[:-1] / error[1:]) / np.log(np.divide(sizes[1:], sizes[:-1])))]
    print(f"\n{cell}, inner nodes moved by {shake} cells, ν = {poisson}: cells | error, rate | effectivity")
    for n, e, rate, found in zip(sizes, error, rates, estimates, strict=True):
        print(f"  {n:3d} | {e:.5f} {rate:5.2f} | {found / e:.3f}")
    return error, estimates


@pytest.mark.parametrize("cell", CELLS)
def test_the_estimate_is_close_to_the_error_and_falls_at_its_rate(cell: str) -> None:
    sizes = (8, 16) if cell in PLANE else (4, 8)
    error, found = series(cell, sizes, 0.15)
    assert error[0] > 0.1, "too good to show anything"
    np.testing.assert_allclose(found / error, 1.0, atol=0.06)
    assert np.log2(found[0] / found[1]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("cell", ["triangle6", "quadrilateral9", "tetrahedron10", "hexahedron27"])
def test_the_estimate_of_quadratic_cells_falls_at_the_rate_of_their_error(cell: str) -> None:
    sizes = (4, 6) if cell in ("tetrahedron10", "hexahedron27") else (6, 12)
    error, found = series(cell, sizes, 0.15)
    np.testing.assert_allclose(found / error, 1.0, atol=0.15)
    assert np.log(error[0] / error[1]) / np.log(sizes[1] / sizes[0]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("cell", CELLS)
def test_cells_have_their_own_share_of_the_error(cell: str) -> None:
    found = solved(mesh_of(cell, 12 if cell in PLANE else 6, 0.15), parts=2)
    shares = discretisation_error(found.state.torn, found.state.conforming_displacement).by_cell("body")
    assert found.error.max() > 3 * found.error.min(), "cells are too alike to tell them apart"
    assert np.quantile(np.abs(np.log(shares / found.error)), 0.9) < np.log(1.35)
    assert np.corrcoef(shares, found.error)[0, 1] > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("shake", [0.0, 0.15])
@pytest.mark.parametrize("cell", CELLS)
def test_the_estimate_becomes_exact(cell: str, shake: float) -> None:
    sizes = (4, 8, 16, 32) if cell in PLANE else (3, 6, 12, 18)
    error, found = series(cell, sizes, shake)
    np.testing.assert_allclose(found / error, 1.0, atol=0.08)
    assert found[-1] / error[-1] == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("cell", CELLS)
def test_the_estimate_stays_close_near_incompressibility(cell: str) -> None:
    sizes = (4, 8, 16, 32) if cell in PLANE else (3, 6, 12)
    error, found = series(cell, sizes, 0.0, 0.499)
    np.testing.assert_allclose(found / error, 1.0, atol=0.08)
