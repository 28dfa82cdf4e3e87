"""Scenes that wear: a punch with a parabola as its gap, pressed on a plane and moved to and fro."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    TotalForce,
    Wear,
    solve_steps,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain

#: N/mm², mm, N/mm.
YOUNG, RADIUS, FORCE = 2000.0, 50.0, 20.0
FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))


def parabola(points: np.ndarray) -> np.ndarray:
    """Return the gap of a round body."""
    return np.asarray(points[:, 0] ** 2 / (2.0 * RADIUS))


def punch(wear: Wear | None, cells: tuple[int, int] = (32, 16), **pair: Any) -> Scene:
    """Return a frictionless punch under a force."""
    body = Body(rectangle((-4.0, 0.0), (4.0, 4.0), cells), PlaneStrain(YOUNG, 0.3))
    sides = [Support("punch", side, (0.0, None)) for side in ("x0", "x1")]
    touching = ContactPair(Surface("punch", "y0"), FLOOR, gap=parabola, wear=wear, **pair)
    return Scene({"punch": body}, sides, [TotalForce("punch", "y1", (0.0, -FORCE))], [touching])


def fretted(wear: Wear | None, friction: float | None = 0.3, ways: Sequence[float] = (0.02, -0.02)) -> Any:
    """Return a punch that is pressed and moved sideways, and its load steps."""
    body = Body(rectangle((-4.0, 0.0), (4.0, 4.0), (32, 16)), PlaneStrain(YOUNG, 0.3))
    law = None if friction is None else Coulomb(friction)
    touching = ContactPair(Surface("punch", "y0"), FLOOR, law, gap=parabola, wear=wear)
    scene = Scene({"punch": body}, [Support("punch", "y1", (0.0, -0.05))], contacts=[touching])
    moves = [LoadStep(f"to {way}", supports=[Support("punch", "y1", (way, -0.05))]) for way in ways]
    return scene, [LoadStep("press"), *moves]


def worn(scene: Scene, steps: Sequence[LoadStep], tolerance: float = 1e-8) -> tuple[State, ...]:
    """Return the states after all steps."""
    return solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=tolerance), steps)
