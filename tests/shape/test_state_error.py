"""What an inexact state does to an objective is known to second order, also where points slip and turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, ContactProblem, Coulomb, Scene, Status, Support, Surface, Tresca
from fenics_contact.design import DesignPoint, TotalPotential
from fenics_contact.design.adjoint import linearise_face
from fenics_contact.gallery import block
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from tests.contact.gallery import FLOOR, Friction, crowned, partitions
from tests.shape.blocks import RUBBER, block_on_block, block_on_floor, designs_of
from tests.shape.objectives import objectives
from tests.shape.quotients import Remembering

LOOSE, EXACT = (1e-2, 1e-3, 1e-4), 1e-11
SEEDS = range(2)
JUDGES = tuple(objectives("block"))


def dragged(friction: Friction, way: float) -> Scene:
    """A block whose top is turned while it is dragged: every point slips in a direction of its own."""
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (7, 3, 3)), 0.03)
    top = Support("block", "z1", (way, lambda x: 0.3 * way * (x[:, 0] - 1.0), -0.03))
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    return Scene({"block": Body(mesh, RUBBER)}, [top], contacts=[pair])


@dataclass(frozen=True)
class Case:
    """A scene, and how its loose states are found; exact ones are found by faces."""

    build: Callable[[], Scene]
    body: str = "block"
    solver: DualSolver = field(default_factory=FaceNewton)


CASES = {
    "dragged a little": Case(lambda: dragged(Coulomb(0.3), 0.01)),
    "dragged far": Case(lambda: dragged(Coulomb(0.3), 0.2)),
    "dragged far, Tresca": Case(lambda: dragged(Tresca(0.6), 0.2)),
    "floor": Case(lambda: block_on_floor(Coulomb(0.3), load=(0.35, 0.1, -2.0))),
    "blocks": Case(lambda: block_on_block(Coulomb(0.38), load=(0.6, 0.12, -2.0)), "upper"),
    # Its states are out of balance, too.
    "floor, SMALSE": Case(lambda: block_on_floor(Tresca(0.6), load=(0.35, 0.1, -2.0)), solver=Smalse()),
}


@cache
def problem(name: str, tolerance: float) -> Remembering:
    case = CASES[name]
    scene = case.build()
    solver = FaceNewton() if tolerance == EXACT else case.solver
    contact = ContactProblem(
        scene, MPI.COMM_SELF, partitions=partitions(scene), solver=solver, tolerance=tolerance
    )
    return Remembering(contact, designs_of(scene), TotalPotential())


@cache
def point(name: str, judge: str, seed: int, tolerance: float) -> DesignPoint:
    here, rng = problem(name, tolerance), np.random.default_rng(seed)
    judges = objectives(CASES[name].body)
    return here.evaluate_by(judges[judge], 0.003 * rng.standard_normal(here.size))


@dataclass(frozen=True)
class Miss:
    """What the value of a loose state misses, before and after its correction, and what was claimed."""

    before: float
    after: float
    claimed: float

    @property
    def left(self) -> float:
        return abs(self.after / self.before)


@cache
def misses(name: str) -> list[Miss]:
    """All that is not rounding; forces that friction bounds alone may be exact at once."""
    found = []
    for judge in JUDGES:
        for seed in SEEDS:
            exact = point(name, judge, seed, EXACT).value
            for tolerance in LOOSE:
                loose = point(name, judge, seed, tolerance)
                before = exact - loose.value
                if abs(before) > 1e-11 * abs(exact):
                    found.append(Miss(before, before - loose.correction, loose.error))
    assert len(found) > 20
    return found


@pytest.mark.parametrize("name", CASES)
def test_many_points_slip_and_turn(name: str) -> None:
    state = point(name, "energy", 0, EXACT).state
    assert state.contact.count(Status.SLIP) > 3
    face = linearise_face(state, problem(name, EXACT).choice).face
    assert face.overshoot[face.slip].max() > 2.0


@pytest.mark.parametrize("name", CASES)
def test_what_remains_after_the_correction_is_of_second_order(name: str) -> None:
    left = np.array([miss.left for miss in misses(name)])
    assert np.median(left) < 0.005
    assert np.mean(left > 0.1) < 0.2
    assert left.max() < 1.0


@pytest.mark.parametrize("name", CASES)
def test_the_claimed_error_holds_after_the_correction(name: str) -> None:
    assert all(abs(miss.after) < miss.claimed for miss in misses(name))
    # It is an estimate of what is there, too.
    assert np.median([miss.claimed / abs(miss.before) for miss in misses(name)]) < 10.0
