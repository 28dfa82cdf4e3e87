"""States with rigid obstacles that move and turn."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    LoadStep,
    MovingObstacle,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Scene,
    State,
    Support,
    Surface,
    solve_steps,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke


def _turning(time: float) -> tuple[np.ndarray, tuple[float, float, float]]:
    """A turn about the y axis, on the way up."""
    c, s = np.cos(0.05 * time), np.sin(0.05 * time)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]), (0.0, 0.02 * time, 0.05 * time)


def _among_movers(material: Material) -> Scene:
    obstacles = {
        "z0": RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        "x1": RigidSphere((2.9, 0.5, 0.5), 0.5),
        "x0": RigidCylinder((-0.9, 0.0, 0.5), (0.0, 1.0, 0.0), 0.5),
    }
    return Scene(
        {"block": Body(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (3, 2, 2)), material)},
        [Support("block", "z1")],
        contacts=[
            ContactPair(Surface("block", side), MovingObstacle(obstacle, _turning))
            for side, obstacle in obstacles.items()
        ],
    )


@lru_cache(maxsize=1)
def block_among_movers() -> tuple[State, State, State]:
    """A block between a floor, a ball and a bar that move: linear, at rest; of rubber, at two times."""
    steps = [LoadStep(f"{time}", time=time) for time in (0.5, 1.0)]
    half, whole = solve_steps(ContactProblem(_among_movers(NeoHooke(1.0, 0.3)), MPI.COMM_SELF), steps)
    linear = ContactProblem(_among_movers(IsotropicElasticity(1.0, 0.3)), MPI.COMM_SELF, tolerance=1e-6)
    at_rest = linear.solve(step=LoadStep("rest", time=0.0))
    return at_rest, half, whole


@lru_cache(maxsize=1)
def pressed_by_a_lid() -> State:
    """A plane block of rubber on which a lid has come down by a tenth of its height."""
    lid = MovingObstacle(RigidPlane((0.0, 1.0), (0.0, -1.0)), lambda time: (None, (0.0, -0.1 * time)))
    scene = Scene(
        {"block": Body(rectangle((0.0, 0.0), (2.0, 1.0), (6, 3)), NeoHooke(1.0, 0.3))},
        [Support("block", "y0")],
        contacts=[ContactPair(Surface("block", "y1"), lid)],
    )
    (state,) = solve_steps(ContactProblem(scene, MPI.COMM_SELF), [LoadStep("down", time=1.0)])
    return state
