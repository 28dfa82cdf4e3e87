"""Dual functions are biorthogonal to the shape functions on whatever part of a facet is covered."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenics_contact._pairing.mortar.cells import Cells
from fenics_contact._pairing.mortar.coupling import CORNERS, dual_integrals
from fenics_contact._pairing.mortar.planes import measure, rule
from fenics_contact._surfaces.facets import facet_shape_values


def covered(corners: int, parts: np.ndarray, share_of_pairs: np.ndarray) -> Cells:
    """Cells on one facet in its own local coordinates, coupled with the facet's own shape functions."""
    barycentric, weights = rule(parts.shape[1])
    local = barycentric @ parts
    values = facet_shape_values(local, corners)
    size = np.abs(measure(parts))[:, None] * weights
    return Cells(np.zeros(len(parts), dtype=np.int64), share_of_pairs, size, local, local, values, values)


def without_field(cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of shape functions alone."""
    return dual_integrals(cells, np.zeros(cells.weight.shape))[:2]


def inside(corners: int, seed: int, count: int, width: float) -> np.ndarray:
    """Small simplices somewhere in a facet."""
    rng = np.random.default_rng(seed)
    dim = 2 if corners == 2 else 3
    low, high = CORNERS[corners].min(), (0.5 if corners == 3 else 0.9)
    middle = rng.uniform(low, high - width, dim - 1)
    return middle + width * rng.uniform(0, 1, (count, dim, dim - 1))


@given(
    st.sampled_from([2, 3, 4]), st.integers(0, 10**6), st.integers(1, 5), st.sampled_from([0.01, 0.1, 0.4])
)
def test_dual_functions_are_biorthogonal_on_the_covered_part(
    corners: int, seed: int, count: int, width: float
) -> None:
    cells = covered(corners, inside(corners, seed, count, width), np.arange(count))
    coverage, integrals = without_field(cells)
    scale = coverage.sum()
    np.testing.assert_allclose(coverage[0], np.einsum("nq,nqk->k", cells.weight, cells.slave), rtol=1e-12)
    # Thin triangles are slivers, in which only sums are kept.
    np.testing.assert_allclose(integrals.sum(axis=(0, 2)), coverage[0], atol=1e-9 * scale)
    np.testing.assert_allclose(integrals.sum(axis=(0, 1)), coverage[0], atol=1e-9 * scale)


@pytest.mark.parametrize("corners", [2, 3, 4])
@pytest.mark.parametrize("width", [1.0, 0.1, 0.01])
def test_integrals_with_the_shape_functions_are_diagonal(corners: int, width: float) -> None:
    corner = CORNERS[corners]
    part = corner[[0, 1]] if corners == 2 else corner[[0, 1, 2]]
    parts = (corner[0] + width * (part - corner[0]))[None]
    coverage, integrals = without_field(covered(corners, parts, np.array([0])))
    assert (coverage > 0).all()
    np.testing.assert_allclose(integrals[0], np.diag(coverage[0]), atol=1e-13 * coverage.sum() / width**2)


def test_slivers_are_not_extrapolated() -> None:
    strip = np.array([[[-1.0, -1], [1, -1], [1, -1 + 1e-7]], [[-1, -1], [1, -1 + 1e-7], [-1, -1 + 1e-7]]])
    cells = covered(4, strip, np.array([0, 0]))
    coverage, integrals = without_field(cells)
    values = integrals[0] / coverage[0][:, None]
    # Along the strip all is linear; across it the far corners take the values of the near ones.
    np.testing.assert_allclose(values[0], values[3], atol=1e-6)
    np.testing.assert_allclose(values[0], [1, 0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-12)


def test_facets_do_not_mix() -> None:
    rng = np.random.default_rng(8)
    parts = [inside(4, seed, 3, 0.4) for seed in (1, 2)]
    alone = [without_field(covered(4, part, np.array([0, 1, 1]))) for part in parts]
    both = covered(4, np.concatenate(parts), np.array([0, 1, 1, 2, 3, 3]))
    order = rng.permutation(6)
    cells = Cells(
        np.repeat([0, 1], 3)[order],
        both.pair[order],
        both.weight[order],
        both.local[order],
        both.opposite[order],
        both.slave[order],
        both.master[order],
    )
    coverage, integrals = without_field(cells)
    np.testing.assert_allclose(coverage, np.concatenate([a[0] for a in alone]), rtol=1e-12)
    np.testing.assert_allclose(integrals, np.concatenate([a[1] for a in alone]), atol=1e-10)


def test_a_field_is_integrated_as_a_shape_function_is() -> None:
    cells = covered(4, inside(4, 3, 4, 0.4), np.array([0, 0, 1, 2]))
    _, integrals, of_field = dual_integrals(cells, cells.master @ [3.0, -1.0, 2.0, 0.5])
    np.testing.assert_allclose(of_field, integrals @ [3.0, -1.0, 2.0, 0.5], rtol=1e-10)
