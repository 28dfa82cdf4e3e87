"""Loads, supports, obstacles and log handlers that fail on the last rank alone."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    BodyForce,
    ContactPair,
    ContactProblem,
    Coulomb,
    DistanceObstacle,
    LoadStep,
    MovingObstacle,
    Pressure,
    RigidSphere,
    Support,
    Surface,
    ThermalStrain,
    Traction,
    Ufl,
    solve_steps,
)
from fenics_contact._base.progress import LOGGER_NAME
from fenics_contact.materials import NeoHooke
from tests.ranks.given import (
    FLOOR,
    STEEL,
    Function,
    case,
    differs_on_last,
    fails_on_last,
    is_last,
    scene,
    solve,
)


def downward(x: np.ndarray) -> np.ndarray:
    return np.tile((0.0, 0.0, -1.0), (len(x), 1))


def nothing(x: np.ndarray) -> np.ndarray:
    return np.zeros(len(x))


@case
def support_raises(comm: MPI.Comm) -> None:
    solve(comm, scene(supports=[Support("block", "x0", (fails_on_last(comm, nothing), 0.0, 0.0))]))


@case
def support_is_nan(comm: MPI.Comm) -> None:
    value = differs_on_last(comm, nothing, lambda x: np.full(len(x), np.nan))
    solve(comm, scene(supports=[Support("block", "x0", (value, 0.0, 0.0))]))


@case
def support_differs(comm: MPI.Comm) -> None:
    value = differs_on_last(comm, nothing, lambda x: np.full(len(x), 1e-4))
    solve(comm, scene(supports=[Support("block", "x0", (value, 0.0, 0.0))]))


@case
def traction_raises(comm: MPI.Comm) -> None:
    solve(comm, scene(loads=[Traction("block", "z1", fails_on_last(comm, downward))]))


@case
def traction_exits(comm: MPI.Comm) -> None:
    value = fails_on_last(comm, downward, SystemExit)
    solve(comm, scene(loads=[Traction("block", "z1", value)]))


@case
def traction_is_interrupted(comm: MPI.Comm) -> None:
    value = fails_on_last(comm, downward, KeyboardInterrupt)
    solve(comm, scene(loads=[Traction("block", "z1", value)]))


@case
def traction_has_another_shape(comm: MPI.Comm) -> None:
    value = differs_on_last(comm, downward, nothing)
    solve(comm, scene(loads=[Traction("block", "z1", value)]))


@case
def traction_differs_as_a_function(comm: MPI.Comm) -> None:
    value = differs_on_last(comm, downward, lambda x: 2.0 * downward(x))
    solve(comm, scene(loads=[Traction("block", "z1", value)]))


@case
def body_force_raises(comm: MPI.Comm) -> None:
    solve(comm, scene(loads=[BodyForce("block", fails_on_last(comm, downward))]))


@case
def temperature_raises(comm: MPI.Comm) -> None:
    warm = replace(STEEL, thermal_expansion=1e-5)
    change = ThermalStrain("block", fails_on_last(comm, nothing))
    solve(comm, scene(material=warm, loads=[change]))


@case
def ufl_raises(comm: MPI.Comm) -> None:
    solve(comm, scene(loads=[Pressure("block", "z1", Ufl(fails_on_last(comm, lambda x: x[0])))]))


@case
def ufl_exits(comm: MPI.Comm) -> None:
    value = fails_on_last(comm, lambda x: x[0], SystemExit)
    solve(comm, scene(loads=[Pressure("block", "z1", Ufl(value))]))


@case
def ufl_differs(comm: MPI.Comm) -> None:
    value = differs_on_last(comm, lambda x: 1.0 + x[0], lambda x: 1.0 + x[1] ** 2)
    solve(comm, scene(loads=[Pressure("block", "z1", Ufl(value))]))


def rubbed(comm: MPI.Comm, friction: Function) -> None:
    solve(comm, scene(contacts=[ContactPair(Surface("block", "z0"), FLOOR, Coulomb(friction))]))


def rough(x: np.ndarray) -> np.ndarray:
    return np.full(len(x), 0.3)


@case
def friction_raises(comm: MPI.Comm) -> None:
    rubbed(comm, fails_on_last(comm, rough))


@case
def friction_differs_as_a_function(comm: MPI.Comm) -> None:
    rubbed(comm, differs_on_last(comm, rough, lambda x: 0.1 + rough(x)))


def still(time: float) -> tuple[None, tuple[float, ...]]:
    return None, (0.0, 0.0, 0.0)


@case
def path_raises(comm: MPI.Comm) -> None:
    on_obstacle(comm, MovingObstacle(FLOOR, fails_on_last(comm, still)))


@case
def path_raises_where_a_step_is_cut(comm: MPI.Comm) -> None:
    path = fails_on_last(comm, still)
    ball = RigidSphere((0.6, 0.5, -5.0), 5.0)
    moving = MovingObstacle(ball, lambda time: path(time) if time else still(time))
    top = Support("block", "z1", (0.0, 0.0, -1e-3))
    pressed = scene(
        material=NeoHooke(1.0, 0.3), supports=[top], contacts=[ContactPair(Surface("block", "z0"), moving)]
    )
    steps = [LoadStep("first", time=0.0), LoadStep("then", time=1.0)]
    solve_steps(ContactProblem(pressed, comm), steps)


def on_obstacle(comm: MPI.Comm, obstacle: Any) -> None:
    solve(comm, scene(contacts=[ContactPair(Surface("block", "z0"), obstacle)]))


def height(x: np.ndarray) -> np.ndarray:
    return np.array(x[:, 2])


def upward(x: np.ndarray) -> np.ndarray:
    return np.tile((0.0, 0.0, 1.0), (len(x), 1))


@case
def distance_raises(comm: MPI.Comm) -> None:
    on_obstacle(comm, DistanceObstacle(fails_on_last(comm, height)))


@case
def distance_is_nan(comm: MPI.Comm) -> None:
    on_obstacle(comm, DistanceObstacle(differs_on_last(comm, height, lambda x: np.nan * x[:, 2])))


@case
def distance_differs(comm: MPI.Comm) -> None:
    on_obstacle(comm, DistanceObstacle(differs_on_last(comm, height, lambda x: x[:, 2] + 0.01)))


@case
def gradient_raises(comm: MPI.Comm) -> None:
    on_obstacle(comm, DistanceObstacle(height, fails_on_last(comm, upward)))


@case
def gradient_is_nan(comm: MPI.Comm) -> None:
    on_obstacle(comm, DistanceObstacle(height, differs_on_last(comm, upward, lambda x: np.nan * x)))


@case
def gradient_has_another_shape(comm: MPI.Comm) -> None:
    on_obstacle(comm, DistanceObstacle(height, differs_on_last(comm, upward, height)))


def flat(x: np.ndarray) -> np.ndarray:
    return np.zeros((*x.shape, 3))


@dataclass(frozen=True)
class OwnFloor:
    """An obstacle of the user's own, without checks."""

    fails: Function
    bends: Function = flat

    def distance(self, points: np.ndarray) -> np.ndarray:
        return height(points)

    def normals(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(self.fails(points))

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(self.bends(points))


@case
def own_obstacle_raises(comm: MPI.Comm) -> None:
    on_obstacle(comm, OwnFloor(fails_on_last(comm, upward)))


@case
def own_obstacle_is_nan(comm: MPI.Comm) -> None:
    on_obstacle(comm, OwnFloor(differs_on_last(comm, upward, lambda x: np.nan * x)))


class OnLast(logging.Handler):
    """Fails at the first report on the last rank."""

    def __init__(self, comm: MPI.Comm) -> None:
        super().__init__()
        self._comm, self._failed = comm, False

    def emit(self, record: logging.LogRecord) -> None:
        if is_last(self._comm) and not self._failed:
            self._failed = True
            raise RuntimeError("a bug on one rank")


@case
def log_handler_raises(comm: MPI.Comm) -> bool:
    """Reports must not decide on results."""
    logger, handler = logging.getLogger(LOGGER_NAME), OnLast(comm)
    before = logger.level
    logger.setLevel(logging.DEBUG)
    logger.addHandler(handler)
    try:
        return bool(solve(comm, scene()).contact.normal_force.sum() > 0.0)
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)
