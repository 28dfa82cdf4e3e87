"""Limits of large deformations: small loads have the answers of small strains, turned bodies no stress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadStep,
    RigidPlane,
    Scene,
    Status,
    Support,
    Surface,
    TangentNewton,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact._scene.pairs import Discretisation
from fenics_contact.errors import InfeasibleError, LoadStepError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    Elasticity,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    NeoHooke,
    PlaneStrain,
)
from tests.nonlinear.scenes import RUBBER, cut, pressed, rounded, tilted

SMALL = 1e-7


def lightly_pressed(mesh: BodyMesh, material: Elasticity) -> Scene:
    """A block whose underside is hardly round, pressed on a plane with friction and dragged very little."""
    dim, points = mesh.points.shape[1], mesh.points.copy()
    points[:, -1] += 2.0 * SMALL * ((points[:, :-1] - 0.5) ** 2).sum(axis=1) * (1.0 - points[:, -1])
    push = (0.3 * SMALL,) + (0.0,) * (dim - 2) + (-SMALL,)
    low, high = ("y0", "y1") if dim == 2 else ("z0", "z1")
    floor = RigidPlane((0.0,) * dim, (0.0,) * (dim - 1) + (1.0,))
    body = Body(replace(mesh, points=points), material)
    return Scene(
        {"block": body},
        [Support("block", high, push)],
        contacts=[ContactPair(Surface("block", low), floor, Coulomb(0.3))],
    )


@pytest.mark.parametrize(
    ("mesh", "linear"),
    [
        (block((0, 0, 0), (1, 1, 1), (6, 6, 6)), IsotropicElasticity(1.0, 0.3)),
        (rectangle((0, 0), (1, 1), (16, 16)), PlaneStrain(1.0, 0.3)),
    ],
    ids=["space", "plane"],
)
def test_contact_at_small_load_is_that_of_small_strains(mesh: BodyMesh, linear: Elasticity) -> None:
    given = {"block": box_partition(mesh, (2,) * mesh.points.shape[1])}
    state, small = (
        solve_scene(lightly_pressed(mesh, material), MPI.COMM_SELF, partitions=given, tolerance=1e-8)
        for material in (NeoHooke(1.0, 0.3), linear)
    )
    assert isinstance(state, DeformedState)
    assert all(small.contact.count(status) > 0 for status in Status), "open, sticking and slipping"
    assert [state.contact.count(s) for s in Status] == [small.contact.count(s) for s in Status]
    force, moved = small.contact.force, small.gather_displacement("block")
    assert np.abs(state.contact.force - force).max() < 1e-6 * np.abs(force).max()
    assert np.abs(state.gather_displacement("block") - moved).max() < 1e-6 * np.abs(moved).max()
    assert len(state.solution.history) <= 5, "nothing is nonlinear but contact"


def test_rounding_alone_hides_nothing_of_a_small_load() -> None:
    """Forces of 1e-12 of stiffness times cell are a thousand times what positions are rounded by."""
    mesh, load = rectangle((0, 0), (1, 1), (4, 4)), [Traction("block", "x1", (3e-12, 1e-11))]
    found, small = (
        solve_scene(Scene({"block": Body(mesh, material)}, [Support("block", "x0")], load), MPI.COMM_SELF)
        for material in (NeoHooke(1.0, 0.3), PlaneStrain(1.0, 0.3))
    )
    moved = small.gather_displacement("block")
    assert np.abs(found.gather_displacement("block") - moved).max() < 1e-3 * np.abs(moved).max()


def test_a_small_load_on_a_body_that_is_moved_far_is_balanced() -> None:
    """Forces are compared with a small part alone of what would strain the body by its displacement."""
    mesh, load = rectangle((0, 0), (1, 1), (4, 4)), [Traction("block", "x1", (3e-10, 1e-9))]
    held = [Support("block", "x0", (3.0, -2.0))]
    found, small = (
        solve_scene(Scene({"block": Body(mesh, material)}, held, load), MPI.COMM_SELF)
        for material in (NeoHooke(1.0, 0.3), PlaneStrain(1.0, 0.3))
    )
    moved = small.gather_displacement("block")
    off = found.gather_displacement("block") - moved
    assert np.abs(off).max() < 1e-3 * np.abs(moved - (3.0, -2.0)).max()


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    """Displacement of points that turn about an axis through the centre of the unit cube."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray((points - 0.5) @ [[c, 0, -s], [0, 1, 0], [s, 0, c]] + 0.5 - points)


def turning(angle: float, component: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda points: turned(points, angle)[:, component]


@pytest.mark.parametrize("count", [1, 4], ids=["at once", "in four steps"])
def test_a_body_that_turns_with_its_support_has_no_stress(count: int) -> None:
    """Supports reach their places along chords: on the way the block is squeezed, at the end it is not."""
    mesh = block((0, 0, 0), (1, 1, 1), (4, 4, 4))
    steps = []
    for number in range(1, count + 1):
        angle = 0.5 * np.pi * number / count
        support = Support("block", "z0", tuple(turning(angle, component) for component in range(3)))
        steps.append(LoadStep(str(number), supports=[support]))
    scene = Scene({"block": Body(mesh, RUBBER)}, steps[0].supports or ())
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut(mesh, 2), tolerance=1e-9)
    states = solve_steps(problem, steps)
    last = states[-1]
    assert isinstance(last, DeformedState)
    exact = turned(mesh.points, 0.5 * np.pi)
    assert np.abs(last.gather_displacement("block") - exact).max() < 1e-9
    assert np.abs(last.stress["block"].x.array).max() < 1e-8
    assert max(len(state.solution.history) for state in states) <= (12 if count == 1 else 8)


def two_blocks(rotation: np.ndarray, push: tuple[float, float, float]) -> Scene:
    """A small stiff block with a round underside on a large soft one."""
    low = block((0, 0, 0), (2, 2, 1), (4, 4, 2))
    high = block((0.53, 0.57, 1), (1.53, 1.57, 1.6), (3, 3, 2))
    x, y, z = high.points.T
    bulge = 0.2 * ((x - 1.03) ** 2 + (y - 1.07) ** 2) * (1.6 - z) / 0.6
    high = replace(high, points=np.column_stack([x, y, z + bulge]))
    low, high = (replace(mesh, points=mesh.points @ rotation.T) for mesh in (low, high))
    pair = ContactPair(Surface("high", "z0"), Surface("low", "z1"), Coulomb(0.3))
    return Scene(
        {"low": Body(low, NeoHooke(1.0, 0.3)), "high": Body(high, NeoHooke(5.0, 0.3))},
        [Support("low", "z0"), Support("high", "z1", tuple(rotation @ push))],
        contacts=[pair],
    )


def test_two_blocks_turned_in_space_give_the_turned_answer() -> None:
    answers = []
    for rotation in (np.eye(3), tilted(1.1)):
        scenes = [two_blocks(rotation, push) for push in ((0.0, 0.0, -0.15), (0.12, 0.05, -0.15))]
        steps = [LoadStep(str(number), supports=scene.supports) for number, scene in enumerate(scenes)]
        problem = ContactProblem(scenes[0], MPI.COMM_SELF, tolerance=1e-11)
        answers.append(solve_steps(problem, steps)[-1])
    upright, turn = answers
    assert turn.contact.count(Status.SLIP) > 3
    force = upright.contact.force @ tilted(1.1).T
    assert np.abs(turn.contact.force - force).max() < 1e-9 * np.abs(force).max()
    for name in ("low", "high"):
        moved = upright.gather_displacement(name) @ tilted(1.1).T
        assert np.abs(turn.gather_displacement(name) - moved).max() < 1e-9 * np.abs(moved).max()


def test_a_deformed_state_says_what_it_has_and_refuses_no_attribute() -> None:
    state = solve_scene(pressed(rounded(2), 0.05), MPI.COMM_SELF)
    words = str(state)
    assert "out of balance" in words
    assert "compare two meshes" in words
    assert "call state.estimate_errors()" not in words
    names = [name for name in dir(type(state)) if not name.startswith("_")]
    assert len([getattr(state, name) for name in names]) > 20
    assert not {"dual", "system", "estimate_errors"} & set(names)
    assert state.tolerance == TangentNewton().tolerance


@pytest.mark.parametrize("friction", [None, Coulomb(0.3)])
def test_a_body_that_may_slide_freely_is_told_to_be_held(friction: Coulomb | None) -> None:
    """A dead load holds no body on a plane without friction; smaller load steps would not either."""
    pair = ContactPair(Surface("block", "y0"), RigidPlane((0, 0), (0, 1)), friction)
    loads = [Traction("block", "y1", (0.0, -0.05))]
    scene = Scene({"block": Body(rectangle((0, 0), (1, 1), (4, 4)), RUBBER)}, [], loads, [pair])
    steps = AutomaticSteps(TangentNewton(max_steps=12), smallest=1.0)
    if friction is not None:
        assert solve_scene(scene, MPI.COMM_SELF, steps=steps).balance().imbalance < 1e-8
        return
    with pytest.raises(InfeasibleError, match=r"translation \(1, 0\): support it .* or give its contacts"):
        solve_scene(scene, MPI.COMM_SELF, steps=steps)


@pytest.mark.parametrize(
    ("material", "way", "told"),
    [(RUBBER, "node", True), (RUBBER, "mortar", False), (J2Plasticity(1.0, 0.3, 0.01), "node", False)],
)
def test_a_path_by_nodes_of_bodies_that_slide_is_told_of_mortar(
    material: Material, way: Discretisation, told: bool
) -> None:
    bodies = {"low": Body(rectangle((0, 0), (1, 1), (3, 3)), material)}
    bodies["high"] = Body(rectangle((0, 1), (1, 2), (4, 4)), material)
    supports = [Support("low", "y0"), Support("high", "y1", (0.0, -0.3))]
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), discretisation=way)
    steps = AutomaticSteps(TangentNewton(max_steps=1), smallest=1.0)
    with pytest.raises(LoadStepError) as ended:
        solve_scene(Scene(bodies, supports, contacts=[pair]), MPI.COMM_SELF, steps=steps)
    assert ("discretisation='mortar'" in str(ended.value)) == told
