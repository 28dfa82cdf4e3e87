"""Designs of bodies on springs, and of bodies that preloads draw together or press apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    ContactProblem,
    Coulomb,
    ElasticFoundation,
    Preload,
    Section,
    ShapeProblem,
    Spring,
    Surface,
)
from fenics_contact.design import PressureNorm
from fenics_contact.errors import InvalidInputError
from tests.design.blocks import block_on_floor, designs_of

LEVEL = Section((1.0, 0.5, 0.6), (0.0, 0.0, 1.0))
SPRUNG = [ElasticFoundation("block", "z1", (3.0, 2.0, 9.0))]
CASES: dict[str, dict[str, Any]] = {
    "springs": {"foundations": SPRUNG},
    "a length": {"preloads": [Preload("block", LEVEL, shortening=0.02)]},
    "a spring": {"springs": [Spring(Surface("block", "z1"), (1.3, 0.6, 3.0), (3.0, 2.0, 9.0))]},
    "a line": {"springs": [Spring(Surface("block", "z1"), (1.0, 0.5, 3.0), 9.0, tension=-0.5)]},
    "a force": {"foundations": SPRUNG, "preloads": [Preload("block", LEVEL, force=-0.4)]},
}


@pytest.mark.parametrize("case", CASES)
def test_gradients_are_those_of_differences(case: str) -> None:
    scene = replace(block_on_floor(Coulomb(0.4), load=(0.4, 0.1, -2.0)), **CASES[case])
    shape = ShapeProblem(
        ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-11), designs_of(scene), PressureNorm()
    )
    at, step = 0.01 * np.sin(np.arange(shape.size)), 1e-5
    way = np.cos(1.3 * np.arange(shape.size)) / np.sqrt(shape.size)
    slope = shape.evaluate(at).gradient @ way
    ahead, behind = (shape.evaluate(at + sign * step * way).value for sign in (1.0, -1.0))
    assert slope == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-5)
    assert abs(slope) > 0.1


def test_springs_and_sections_stay_where_they_are() -> None:
    scene = block_on_floor(Coulomb(0.4), load=(0.4, 0.1, -2.0))
    every: tuple[dict[str, Any], ...] = (
        {"foundations": [ElasticFoundation("block", "x0", 1.0)]},
        {"preloads": [Preload("block", Section((1.0, 0.5, 0.5), (1.0, 0.0, 0.0)))]},
    )
    for parts in every:
        other = replace(scene, **parts)
        with pytest.raises(InvalidInputError, match="must keep away from supports"):
            ShapeProblem(ContactProblem(other, MPI.COMM_SELF), designs_of(other), PressureNorm())
