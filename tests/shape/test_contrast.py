"""A design between bodies of very different stiffness: right derivatives at an even cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import Coulomb
from fenics_contact.materials import IsotropicElasticity
from tests.shape.blocks import block_on_block, problem

LOAD = (0.6, 0.12, -2.0)


@pytest.mark.parametrize("stiffness", [1e3, 1e5])
def test_subgradients_are_right_and_take_few_products_on_a_stiff_foundation(stiffness: float) -> None:
    scene = block_on_block(Coulomb(0.38), load=LOAD)
    even = problem(scene)
    bodies = {
        **scene.bodies,
        "lower": replace(scene.bodies["lower"], material=IsotropicElasticity(stiffness, 0.3)),
    }
    uneven = problem(replace(scene, bodies=bodies))
    alpha = 0.005 * np.random.default_rng(1).standard_normal(uneven.size)
    direction, h = np.random.default_rng(2).standard_normal(uneven.size), 1e-5
    point = uneven.evaluate(alpha)
    assert point.state.dual.problem.scaling is not None
    ahead, behind = (uneven.value_of(alpha + sign * h * direction) for sign in (1, -1))
    slope = (ahead - behind) / (2 * h)
    assert abs(slope) > 1e-3
    assert point.gradient @ direction == pytest.approx(slope, rel=1e-5)
    assert point.adjoint_iterations < 1.5 * even.evaluate(alpha).adjoint_iterations + 5
