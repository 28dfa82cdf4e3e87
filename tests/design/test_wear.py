"""Objectives of wear: derivatives through depth, slip, areas, places and the history of what was lost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactProblem,
    Coulomb,
    LinearClosure,
    LoadStep,
    Scene,
    ShapeProblem,
    SlipTable,
    Status,
    Support,
    Wear,
    WearTable,
)
from fenics_contact.design import (
    LargestWornDepth,
    LoadPath,
    Objective,
    WearNonuniformity,
    WornDepthNorm,
    WornVolume,
)
from fenics_contact.design.adjoint import LaterSteps
from fenics_contact.design.wear_derivatives import WearBySlip
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.qp import FaceNewton
from tests.design.blocks import RUBBER, block_on_floor
from tests.design.load_paths import PLANE, SPACE, PathLine, loaded, moved
from tests.design.mortar_lines import by_mortar
from tests.design.plane_blocks import on_block, on_obstacle
from tests.design.quotients import Patch
from tests.scenes import partitions

Case = tuple[Scene, Sequence[LoadStep]]


def wearing(scene: Scene, wear: Wear, **more: Any) -> Scene:
    """The same scene with wear."""
    return replace(scene, contacts=[replace(pair, wear=wear, **more) for pair in scene.contacts])


def place(points: np.ndarray) -> np.ndarray:
    """How far points slide as prescribed."""
    return np.asarray(2.0 + np.sin(points[:, 0]) + 3.0 * points[:, 1])


def pushed(scene: Scene, steps: int = 3) -> Case:
    """A plane scene under the loads of a path."""
    return scene, loaded("block", "y1", PLANE[:steps], scene)


def guided(scene: Scene, ways: Sequence[float]) -> Case:
    """A block without friction whose top moves to and fro."""
    moves = [
        LoadStep(f"{number}: to {way}", supports=[*scene.supports, Support("block", "y1", (way, -0.03))])
        for number, way in enumerate(ways)
    ]
    return replace(scene, loads=[], supports=moves[0].supports), moves


def revolution() -> Case:
    """A ring on a ring, pressed and pushed outwards."""
    scene = on_block(Coulomb(0.3), "quadrilateral")
    rings = {
        name: Body(body.mesh.moved(body.mesh.points + np.array([0.5, 0.0])), RUBBER, axisymmetric=True)
        for name, body in scene.bodies.items()
    }
    return pushed(wearing(replace(scene, bodies=rings), Wear(0.1, cycles=3.0)), 2)


CASES: dict[str, Callable[[], Case]] = {
    "prescribed": lambda: guided(
        wearing(on_obstacle(None, "quadrilateral"), Wear(lambda x: 1e-3 * (2.0 + x[:, 0]), sliding=place)),
        (0.0, 0.0),
    ),
    "to and fro": lambda: pushed(wearing(on_block(Coulomb(0.3), "quadrilateral"), Wear(0.02, cycles=20.0))),
    "mortar": lambda: pushed(wearing(by_mortar(on_block(Coulomb(0.3), "triangle")), Wear(0.4))),
    "revolution": revolution,
    "frictionless": lambda: guided(
        wearing(on_block(None, "quadrilateral"), Wear(0.01, least_slip=0.001)), (0.02, -0.03)
    ),
    "frictionless, mortar": lambda: guided(
        wearing(by_mortar(on_block(None, "quadrilateral")), Wear(0.01)), (0.02, -0.03)
    ),
    "power, closure": lambda: pushed(
        wearing(
            on_obstacle(Coulomb(0.3, stick_stiffness=200.0), "quadrilateral"),
            Wear(0.2, exponent=1.6, share=0.5), closure=LinearClosure(500.0),
        )
    ),
    "table": lambda: pushed(
        wearing(
            on_obstacle(Coulomb(0.3), "quadrilateral"),
            Wear(WearTable((0.0, 4.0), (0.2, 0.6))), closure=LinearClosure(800.0),
        )
    ),
    "friction by slip": lambda: (
        wearing(on_obstacle(Coulomb(SlipTable((0.0, 0.02), (0.3, 0.38))), "quadrilateral"), Wear(0.2)),
        [LoadStep("push")],
    ),
    "space": lambda: (
        scene := wearing(block_on_floor(Coulomb(0.3), load=(0.0, 0.0, -2.0)), Wear(0.2)),
        loaded("block", "z1", SPACE, scene),
    ),
}  # fmt: skip
QUICK = ["prescribed", "frictionless"]
LONG = [
    pytest.param(name, marks=[pytest.mark.slow, pytest.mark.claim]) for name in CASES if name not in QUICK
]
OBJECTIVE: Objective = WornVolume() + 5.0 * WornDepthNorm(p=6.0)


@cache
def line(name: str) -> PathLine:
    """Designs of a case, judged after its last step."""
    scene, steps = CASES[name]()
    contact = ContactProblem(
        scene, MPI.COMM_SELF, partitions=partitions(scene), solver=FaceNewton(tolerance=1e-12)
    )
    path = LoadPath(ShapeProblem(contact, moved(scene), OBJECTIVE), steps, {steps[-1].name: OBJECTIVE})
    alpha = 0.003 * np.random.default_rng(1).standard_normal(path.size)
    return PathLine(path, alpha, np.random.default_rng(6).standard_normal(path.size), 1e-5)


def miss(here: PathLine) -> float:
    """Relative difference of derivative and central differences of fourth order."""
    near, far = here.quotient(), replace(here, step=2.0 * here.step).quotient()
    return abs(here.slope() / (4.0 * near / 3.0 - far / 3.0) - 1.0)


@pytest.mark.parametrize("name", [*QUICK, *LONG])
def test_the_adjoint_of_wear_agrees_with_central_differences(name: str) -> None:
    here = line(name)
    states = [list(here.problem.states_of(here.at(multiple)).values()) for multiple in (-1.0, 1.0, 0.0)]
    for before, after in zip(*states[:2], strict=True):
        np.testing.assert_array_equal(before.contact.status, after.contact.status)
    last = states[-1][-1].contact
    assert last.worn_depth.max() > 1e-4
    assert last.count(Status.SLIP) > 0
    assert abs(here.slope()) > 0.01 * np.linalg.norm(here.problem(here.alpha)[1])
    assert miss(here) < 1e-6


def without(part: str) -> Callable[[Patch], None]:
    """Return what leaves a part of the derivative out."""

    parts: dict[str, tuple[type, str, Callable[..., Any]]] = {
        "depth by forces and areas": (WearBySlip, "begun", lambda wear, own: own),
        "slips": (WearBySlip, "following", lambda wear, own, y: own),
        "places": (WearBySlip, "ended", lambda wear, own, adjoint: own),
        "history": (LaterSteps, "added", lambda later, state, own: own),
        "lost before": (
            LaterSteps, "added",
            lambda later, state, own, whole=LaterSteps.added: whole(
                replace(later, by_worn=0.0 * later.by_worn), state, own
            ),
        ),
        "slips before": (
            LaterSteps, "added",
            lambda later, state, own, whole=LaterSteps.added: whole(
                replace(later, by_position=0.0 * later.by_position), state, own
            ),
        ),
    }  # fmt: skip
    kind, name, other = parts[part]
    return lambda patch: patch.setattr(kind, name, other)


@pytest.mark.parametrize(
    ("part", "name"),
    [
        ("depth by forces and areas", "prescribed"), ("places", "prescribed"), ("lost before", "prescribed"),
        ("slips", "frictionless"), ("history", "frictionless"), ("slips before", "frictionless"),
    ],
)  # fmt: skip
def test_every_part_of_the_derivative_counts(part: str, name: str, monkeypatch: Patch) -> None:
    without(part)(monkeypatch)
    assert miss(line(name)) > 1e-4


@pytest.mark.parametrize("objective", [LargestWornDepth(0), WearNonuniformity()])
def test_other_objectives_of_wear_agree_with_central_differences(objective: Objective) -> None:
    here = line("prescribed")
    other = replace(here, problem=here.problem.function({list(here.problem.problems)[-1]: objective}))
    assert abs(other.slope()) > 0.0
    assert miss(other) < 1e-6


def test_what_objectives_of_wear_cannot_judge_is_refused() -> None:
    scene = on_obstacle(Coulomb(0.3), "quadrilateral")
    contact = ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene))
    with pytest.raises(InvalidInputError, match=r"WornVolume needs a pair that wears, got .* 0 of 1 do"):
        ShapeProblem(contact, moved(scene), WornVolume()).value_of(np.zeros(5))
    idle = wearing(scene, Wear(1e-3, least_pressure=1e6))
    contact = ContactProblem(idle, MPI.COMM_SELF, partitions=partitions(scene))
    assert ShapeProblem(contact, moved(idle), WornVolume()).value_of(np.zeros(5)) == 0.0
    with pytest.raises(InvalidDesignError, match="WearNonuniformity needs surfaces that wear"):
        ShapeProblem(contact, moved(idle), WearNonuniformity()).value_of(np.zeros(5))
    with pytest.raises(InvalidInputError, match=r"WornDepthNorm\.p must be from 2 to 100, got 1"):
        WornDepthNorm(p=1.0)
