"""The bound of the solver's error is sharp where springs and foundations hold bodies, however soft."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    ExponentialClosure,
    LinearClosure,
    RigidSphere,
    RigidTool,
    Scene,
    Spring,
    Support,
    Surface,
    ToolMotion,
    TotalForce,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.results.linear_state import LinearState, as_linear

STEEL = IsotropicElasticity(2.1e5, 0.3)


def cube(**held) -> Scene:
    mesh = block((0, 0, 0), (1, 1, 1), (6, 6, 6))
    return Scene({"cube": Body(mesh, STEEL)}, [], [Traction("cube", "z1", (20.0, 0.0, -50.0))], **held)


def on_bed(stiffness: float) -> Scene:
    return cube(foundations=[ElasticFoundation("cube", "z0", (stiffness,) * 3)])


def on_springs(stiffness: float) -> Scene:
    ends = (("x0", (-1, 0.5, 0.5)), ("y0", (0.5, -1, 0.5)), ("z0", (0.5, 0.5, -1)))
    return cube(springs=[Spring(Surface("cube", side), far, (stiffness,) * 3) for side, far in ends])


def pressed(stiffness: float, *law: Tresca) -> Scene:
    """A block on another, held sideways by springs alone."""
    lower, upper = block((0, 0, 0), (2, 2, 1), (4, 4, 2)), block((0, 0, 1), (1.5, 2, 2), (3, 4, 2))
    springs = [
        Spring(Surface("upper", "x0"), (-1, 1, 1.5), (stiffness, stiffness / 4, stiffness / 4000)),
        Spring(Surface("upper", "y1"), (0.7, 4, 1.5), (stiffness / 40, stiffness / 2, 0.0)),
    ]
    return Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        [Support("lower", "z0")],
        [TotalForce("upper", "z1", (80.0, 20.0, -1000.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), *law)],
        springs=springs,
    )


def solved(scene: Scene, tolerance: float) -> LinearState:
    cut = {name: body.mesh for name, body in scene.bodies.items() if body.mesh.grid is not None}
    parts = {name: box_partition(mesh, (2, 2, 1)) for name, mesh in cut.items()}
    return as_linear(solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=tolerance), "bounds")


def strain(state: LinearState, change: np.ndarray) -> float:
    """Twice the strain energy of a torn displacement, foundations in it."""
    parts = zip(state.torn.subdomains, state.torn.decomposition.parts, strict=True)
    return sum(change[where] @ (part.stiffness @ change[where]) for part, where in parts)


def lengths(state: LinearState) -> np.ndarray:
    """By how much springs are longer under their forces."""
    given = state.dual.problem.compliant
    return given.compliance * state.dual_solution.multiplier[given.rows]


def distance(state: LinearState, exact: LinearState) -> float:
    """That of what the solver found, or of what fields show: the larger one, with the energy of springs."""
    found = state.torn_displacement, state.conforming_displacement
    strained = max(strain(state, each - exact.torn_displacement) for each in found)
    longer = lengths(state) - lengths(exact)
    return float(np.sqrt(strained + longer @ (longer / state.dual.problem.compliant.compliance)))


def blocks(*supports: Support, pair: dict, upper: BodyMesh | None = None, **held) -> Scene:
    """A block that is pressed and dragged on another, with the law of a pair."""
    bodies = {
        "lower": Body(block((0, 0, 0), (2, 2, 1), (4, 4, 2)), STEEL),
        "upper": Body(block((0, 0, 1), (1.5, 2, 2), (3, 4, 2)) if upper is None else upper, STEEL),
    }
    return Scene(
        bodies,
        [Support("lower", "z0"), *supports],
        [TotalForce("upper", "z1", (80.0, 20.0, -1000.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), **pair)],
        **held,
    )


GUIDES = Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))


def against_a_bed(stiffness: float) -> Scene:
    """The upper block is held sideways by a foundation, and by friction."""
    bed = ElasticFoundation("upper", "x0", (stiffness, stiffness / 10, stiffness / 100))
    return blocks(pair={"friction": Tresca(30.0)}, foundations=[bed])


def closing(stiffness: float) -> Scene:
    return blocks(*GUIDES, pair={"closure": LinearClosure(stiffness)})


def rough(stiffness: float) -> Scene:
    return blocks(*GUIDES, pair={"closure": ExponentialClosure(100.0, 100.0 / stiffness)})


def creeping(stiffness: float) -> Scene:
    """Surfaces that do not match give way along both directions."""
    law = {"friction": Coulomb(0.3, stick_stiffness=stiffness / 10), "closure": LinearClosure(stiffness)}
    shifted = block((0.2, 0.1, 1), (1.5, 1.7, 2), (3, 5, 2))
    return blocks(*GUIDES, pair={**law, "discretisation": "mortar"}, upper=shifted)


def under_a_tool(stiffness: float) -> Scene:
    """A ball on springs, on a block."""
    ball = RigidTool("ball", RigidSphere((1.0, 1.0, 31.0), 30.0), (1.0, 1.0, 1.0))
    motion = ToolMotion(
        "ball",
        (None, 0.0, None),
        (0.0, 0.0, 0.0),
        (10.0, 0.0, -800.0),
        stiffness=(stiffness, 0.0, 0.0),
    )
    lower = Body(block((0, 0, 0), (2, 2, 1), (5, 5, 3)), STEEL)
    pair = ContactPair(Surface("lower", "z1"), ball, Tresca(3.0))
    return Scene({"lower": lower}, [Support("lower", "z0"), motion], [], [pair])


def dragged(stiffness: float) -> Scene:
    return pressed(stiffness, Tresca(30.0))


@pytest.mark.parametrize("stiffness", [1e7, 1e4, 400.0])
@pytest.mark.parametrize(
    "scene",
    [on_bed, on_springs, pressed, dragged, against_a_bed, closing, rough, creeping, under_a_tool],
)
def test_the_bound_holds_and_is_sharp(scene: Callable[[float], Scene], stiffness: float) -> None:
    """It was up to 1200 times the error where springs, foundations or closures are soft."""
    given = scene(stiffness)
    exact = solved(given, 1e-12)
    for tolerance, most in ((1e-1, 8.0), (1e-2, 6.0), (1e-4, 5.0)):
        state = solved(given, tolerance)
        errors = state.estimate_errors(geometry=False)
        true = distance(state, exact)
        assert true <= errors.algebraic * errors.norm <= most * true
