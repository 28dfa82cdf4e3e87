"""Newton's method on contact of moved bodies converges quadratically with all derivatives, else linearly."""

from __future__ import annotations

import numpy as np
import pytest

from tests.pairing.sliding_newton import WAY, Dragged, Terms
from tests.pairing.sliding_scenes import on_arch


def residuals(coefficient: float, terms: Terms) -> tuple[list[float], Dragged]:
    """Drag the block by most of its length over several facets; residuals of the last load step."""
    dragged = Dragged(on_arch("hexahedron", master_cells=10), coefficient, terms)
    facets = dragged.points.points.facet
    steps = [dragged.advance(way) for way in WAY]
    assert (dragged.points.points.facet != facets).mean() > 0.5
    assert np.count_nonzero(dragged.force) >= 8
    return steps[-1], dragged


@pytest.mark.parametrize("coefficient", [0.0, 0.3])
def test_newton_converges_quadratically(coefficient: float) -> None:
    found, _ = residuals(coefficient, Terms())
    assert found[-1] < 1e-10
    assert len(found) <= 8
    assert found[-2] < 20.0 * found[-3] ** 2 + 1e-11


def test_without_the_turning_of_normal_forces_it_converges_linearly() -> None:
    whole, _ = residuals(0.0, Terms())
    found, _ = residuals(0.0, Terms(normal=False))
    assert len(found) >= len(whole) + 4


def test_without_the_turning_of_friction_forces_it_needs_more_steps() -> None:
    whole, exact = residuals(0.3, Terms())
    found, other = residuals(0.3, Terms(friction=False))
    assert found[-1] < 1e-10
    assert len(found) > len(whole)
    assert other.u == pytest.approx(exact.u, abs=1e-8)
