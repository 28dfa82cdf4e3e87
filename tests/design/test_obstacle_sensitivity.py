"""Derivatives of blocks on curved rigid obstacles: the normal turns as a node moves along the obstacle."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    DistanceObstacle,
    RigidCylinder,
    RigidSphere,
    Scene,
    Surface,
    Traction,
    Tresca,
)
from fenics_contact.gallery import block
from tests.design.blocks import RUBBER, problem
from tests.design.objectives import objectives
from tests.design.quotients import Line, check_adjoint, check_statuses
from tests.scenes import Friction, RigidObstacle, crowned

#: Many states: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]

BALL = RigidSphere((0.9, 0.55, -4.0), 4.0)
#: Obstacle under the block, by how much the block's lower face is crowned, and the law of friction.
CASES: dict[str, tuple[RigidObstacle, float, Friction]] = {
    "ball": (BALL, -0.06, Coulomb(0.3)),
    "ball, Tresca": (BALL, -0.06, Tresca(0.6)),
    "distance to a ball": (DistanceObstacle(BALL.distance), -0.06, Coulomb(0.3)),
    "socket": (RigidSphere((0.9, 0.55, 8.0), 8.0, hollow=True), 0.12, Coulomb(0.3)),
    "bar": (RigidCylinder((0.9, 0.0, -4.0), (0.1, 1.0, 0.0), 4.0), -0.06, Coulomb(0.3)),
}
OBJECTIVES = objectives("block")


def scene_on(obstacle: RigidObstacle, rise: float, friction: Friction) -> Scene:
    """A block that nothing but the obstacle holds, pressed and pushed; its lower face moves."""
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3)), rise)
    # Let it down until the first node touches.
    lowest = obstacle.distance(mesh.points[np.unique(mesh.surfaces["z0"])]).min()
    mesh = mesh.moved(mesh.points - (0.0, 0.0, lowest))
    return Scene(
        {"block": Body(mesh, RUBBER)},
        loads=[Traction("block", "z1", (0.35, 0.1, -2.0))],
        contacts=[ContactPair(Surface("block", "z0"), obstacle, friction)],
    )


@cache
def line(name: str) -> Line:
    blocks = problem(scene_on(*CASES[name]))
    alpha = 0.01 * np.random.default_rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, np.random.default_rng(6).standard_normal(blocks.size), 1e-5)


@pytest.mark.parametrize("name", CASES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    check_statuses(line(name))


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", CASES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    check_adjoint(line(name), OBJECTIVES[objective])


@pytest.mark.parametrize("name", ["ball", "socket", "bar"])
def test_the_curvature_of_the_obstacle_counts(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def flat(self: RigidObstacle, points: np.ndarray) -> np.ndarray:
        return np.zeros((*points.shape, points.shape[1]))

    whole, judge = line(name), OBJECTIVES["friction forces"]
    assert whole.miss(judge) < 1e-5
    monkeypatch.setattr(type(CASES[name][0]), "curvatures", flat)
    without = Line(problem(scene_on(*CASES[name])), whole.alpha, whole.direction, whole.step)
    assert abs(without.slope(judge) / whole.quotient(judge) - 1) > 1e-4
