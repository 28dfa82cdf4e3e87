"""Designs under nonlinear constraints whose optimum is known: a column under a force, of even width."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    RigidPlane,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    minimize,
)
from fenics_contact.design import (
    BundleTrust,
    LargestStress,
    NonlinearConstraint,
    Objective,
    Result,
    StrainEnergy,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStress

WIDTH, HEIGHT, FORCE, YOUNG = 1.0, 2.0, 3.0, 1000.0
STRESS = LargestStress("column", p=12.0)
NET = 4


def column(objective: Objective) -> ShapeProblem:
    """Half of a column on a smooth floor; the design moves its side, which may taper and bulge.

    By Jensen's inequality no other width of the same area has less of a norm of the stress, or of the strain
    energy, than an even one, in which stress is even, too.
    """
    mesh = rectangle((0.0, 0.0), (WIDTH, HEIGHT), (6, 10))
    scene = Scene(
        {"column": Body(mesh, PlaneStress(YOUNG, 0.3))},
        [Support("column", "x0", (0.0, None))],
        [TotalForce("column", "y1", (0.0, -FORCE))],
        [ContactPair(Surface("column", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)))],
    )
    # Floor and loaded edge stay straight: only nodes of the side move on the boundary.
    side = SurfaceDesign("column", "x1", net=NET, transition=0.01)
    return ShapeProblem(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10), side, objective)


def waisted() -> np.ndarray:
    """A start that is far from even."""
    return np.array([0.02, -0.05, 0.03, -0.02])


BOX = (-0.1, 0.1)


def lightest(share: float, start: np.ndarray, **more: bool) -> tuple[ShapeProblem, Result]:
    """Minimise the area under a limit of the stress, as a multiple of that of the reference shape."""
    problem = column(STRESS)
    limit = NonlinearConstraint(problem.function(STRESS, "stress"), share * FORCE / WIDTH, name="stress")
    method = BundleTrust(tolerance=1e-6)
    return problem, minimize(problem.volume, start, method, bounds=BOX, constraints=limit, **more)


@pytest.mark.parametrize(
    ("share", "start", "restored"), [(1.05, np.zeros(NET), False), (0.95, waisted(), True)]
)
def test_the_lightest_column_bears_the_stress_allowed_everywhere(
    share: float, start: np.ndarray, restored: bool
) -> None:
    problem, result = lightest(share, start, restore=restored)
    assert result.reason.success
    (stress,) = result.constraints
    assert stress.active
    assert stress.value == pytest.approx(share * FORCE / WIDTH, rel=1e-6)
    assert result.value == pytest.approx(WIDTH * HEIGHT / share, rel=1e-5)
    assert result.x == pytest.approx(WIDTH / share - WIDTH, abs=2e-3)
    assert STRESS.largest(problem.state_of(result.x)) == pytest.approx(share * FORCE / WIDTH, rel=3e-3)
    # The price: area = force · height / stress.
    assert stress.multiplier == pytest.approx(HEIGHT * WIDTH**2 / (FORCE * share**2), rel=1e-2)


@pytest.mark.parametrize(
    ("objective", "least"),
    [
        (STRESS, lambda area: FORCE * HEIGHT / area),
        (StrainEnergy(), lambda area: FORCE**2 * HEIGHT**2 / (2.0 * YOUNG * area)),
    ],
    ids=["stress", "strain energy"],
)
def test_the_best_column_of_a_given_area_is_even(
    objective: Objective, least: Callable[[float], float]
) -> None:
    problem, area = column(objective), 1.03 * WIDTH * HEIGHT
    keep = NonlinearConstraint(problem.volume, area, area, name="area")
    method = BundleTrust(tolerance=1e-6)
    result = minimize(problem, waisted(), method, bounds=BOX, constraints=keep, restore=True)
    assert result.reason.success
    assert problem.volume(result.x)[0] == pytest.approx(area, rel=1e-6)
    assert result.value == pytest.approx(least(area), rel=1e-5)
    assert result.x == pytest.approx(area / HEIGHT - WIDTH, abs=2e-3)
    assert problem.value_of(waisted()) > 1.01 * least(area)
