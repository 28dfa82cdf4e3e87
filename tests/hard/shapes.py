"""Small design problems that are hard: designs without equilibrium or mesh, optima on a kink or on bounds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
)
from fenics_contact.design import AdaptiveTolerance, ContactForces, TotalPotential, WeakChoice
from fenics_contact.gallery import block
from fenics_contact.qp import FaceNewton
from fenics_contact.results import ContactResult
from tests.design.blocks import PLASTIC, RUBBER, designs_of, side
from tests.design.objectives import normal_forces
from tests.design.pressed import DESIGN, SWITCHES
from tests.scenes import FLOOR, crowned, partitions

Array = np.ndarray


def on_a_ramp(
    aim: float, tolerance: float | AdaptiveTolerance = 1e-8, *, friction: float = 0.3
) -> ShapeProblem:
    """A block that nothing but friction holds on another one, whose top may be tilted along x.

    The objective is zero where the sum of the squared friction forces is what ``aim`` of the weight makes
    when ten points share it. Beyond a slope of the friction coefficient there is no equilibrium.
    """
    lower = block((0.0, 0.0, -1.0), (2.0, 1.2, 0.0), (5, 4, 2))
    upper = crowned(block((0.13, 0.07, 0.0), (1.87, 1.09, 0.8), (6, 4, 2)), 0.04)
    scene = Scene(
        {"lower": Body(lower, PLASTIC), "upper": Body(upper, RUBBER)},
        [Support("lower", "z0")],
        [BodyForce("upper", (0.0, 0.0, -1.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(friction), "node")],
    )
    wanted = (aim * 1.74 * 1.02 * 0.8) ** 2 / 10.0

    def misfit(contact: ContactResult) -> tuple[float, Array, Array]:
        tau = contact.friction_force
        miss = float((tau**2).sum()) / wanted - 1.0
        return miss**2, np.zeros(len(tau)), 4.0 * miss * tau / wanted

    design = SurfaceDesign("lower", side(lower, "z1"), (2, 1))
    # Near the limit of friction a state can cost any number of products: such designs are given up soon.
    return ShapeProblem(
        ContactProblem(
            scene, MPI.COMM_SELF, partitions=partitions(scene), solver=FaceNewton(max_products=1500)
        ),
        design,
        ContactForces(misfit),
        tolerance=tolerance,
    )


def carved(tolerance: float | AdaptiveTolerance = 1e-8) -> ShapeProblem:
    """A block pushed down on a floor, judged by its contact forces: none is best."""
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3)), 0.03)
    scene = Scene(
        {"block": Body(mesh, RUBBER)},
        [Support("block", "z1", (0.0, 0.0, -0.02))],
        contacts=[ContactPair(Surface("block", "z0"), FLOOR, Coulomb(0.3))],
    )
    judge = ContactForces(normal_forces)
    return ShapeProblem(
        ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene)),
        designs_of(scene),
        judge,
        tolerance=tolerance,
    )


def thick() -> ShapeProblem:
    """The block of `carved`, judged by its energy: bulging as far as cells allow."""
    problem = carved()
    problem.objective = TotalPotential()
    return problem


@dataclass(frozen=True, eq=False)
class Kink:
    """A function whose minimum is a kink: where one point closes, the slope jumps from −c to c.

    Sum of the squared normal forces, turned so that its kink is a valley, plus a plane and a parabola that
    put the minimum there.
    """

    problem: ShapeProblem
    held: Array
    released: Array
    value: float

    @property
    def size(self) -> float:
        """Length of the jump of the gradient."""
        return float(np.linalg.norm(self.held - self.released))

    def __call__(self, alpha: Array) -> tuple[float, Array]:
        value, gradient = self.problem(alpha)
        mean, away = -0.5 * (self.held + self.released), alpha - DESIGN
        kinked = (-value + self.value - mean @ away) / self.size
        return kinked + 2000.0 * float(away @ away), (-gradient - mean) / self.size + 4000.0 * away


@cache
def kink(switch: str) -> Kink:
    """Return the function whose minimum is the design at which one more point touches."""
    pressed = SWITCHES[switch]()
    gradients = {}
    for choice in WeakChoice:
        problem = _at_kink(pressed.problem().scene, choice)
        point = problem.evaluate(DESIGN)
        assert point.weak.contacts == 1
        gradients[choice] = point.gradient
    scene = pressed.problem().scene
    value = point.value
    return Kink(
        _at_kink(scene, WeakChoice.RELEASED),
        gradients[WeakChoice.HELD],
        gradients[WeakChoice.RELEASED],
        value,
    )


def _at_kink(scene: Scene, choice: WeakChoice) -> ShapeProblem:
    judge = ContactForces(normal_forces)
    return ShapeProblem(
        ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-11),
        designs_of(scene),
        judge,
        choice=choice,
    )
