"""A punch with a flat edge presses hardest at its corners: each objective takes away what it is about."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    Traction,
    minimize,
)
from fenics_contact.design import (
    BundleTrust,
    DesignPoint,
    FrictionWork,
    LargestPressure,
    LargestStress,
    Maximum,
    Objective,
    PressureNorm,
)
from fenics_contact.design.forms import ShapeForms
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain

RUBBER, MEAN = PlaneStrain(100.0, 0.3), 2.0


def punch() -> Scene:
    return Scene(
        {
            "punch": Body(rectangle((1.03, 0.0), (2.97, 1.0), (16, 8)), RUBBER),
            "layer": Body(rectangle((0.0, -1.0), (4.0, 0.0), (24, 6)), RUBBER),
        },
        [Support("layer", "y0")],
        [Traction("punch", "y1", (0.0, -MEAN))],
        [ContactPair(Surface("punch", "y0"), Surface("layer", "y1"), Coulomb(0.2), discretisation="node")],
    )


def designs(objective: Objective, scale: float = 1.0) -> tuple[DesignPoint, DesignPoint]:
    """The first and the best design."""
    contact = ContactProblem(punch(), MPI.COMM_SELF, tolerance=1e-8)
    problem = ShapeProblem(contact, SurfaceDesign("punch", "y0", net=5), objective)
    method = BundleTrust(tolerance=1e-3, value_scale=scale)
    result = minimize(problem, np.zeros(5), method, bounds=(-0.05, 0.05))
    assert result.reason.success
    assert problem.first is not None
    assert problem.best is not None
    return problem.first, problem.best


@pytest.mark.parametrize("objective", [LargestPressure(), PressureNorm(p=12.0)])
def test_the_peak_falls_almost_to_the_mean_pressure(objective: Objective) -> None:
    first, best = (point.state.contact.pressure.max() for point in designs(objective))
    assert first > 1.9 * MEAN
    assert MEAN < best < 1.1 * MEAN


def test_the_larger_of_two_stresses_falls_until_both_are_equal() -> None:
    both = (LargestStress("punch", p=12.0), 1.5 * LargestStress("layer", p=12.0))
    first, best = designs(Maximum(both))
    assert best.value < 0.9 * first.value
    forms = ShapeForms(MPI.COMM_SELF)
    before, after = ([judge.value(point.state, forms) for judge in both] for point in (first, best))
    assert before[0] > 1.1 * before[1]
    assert after[0] == pytest.approx(after[1], rel=0.02)


def test_nothing_slips_any_more() -> None:
    first, best = designs(FrictionWork(), 1e-4)
    assert first.value > 3e-4
    assert best.value < 1e-2 * first.value
