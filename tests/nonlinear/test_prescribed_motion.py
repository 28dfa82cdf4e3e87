"""Surfaces that turn as rigid pieces by any angle, and supports and loads that are functions of time."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    ContactProblem,
    DeformedState,
    LoadSequence,
    LoadStep,
    MovingObstacle,
    RigidPlane,
    RigidSurface,
    Scene,
    Support,
    Surface,
    TangentNewton,
    Traction,
    read_scene_file,
    solve_scene,
    solve_steps,
)
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.qp import Smalse
from tests.nonlinear.scenes import RUBBER, cut

CUBE = block((0, 0, 0), (1, 1, 1), (3, 3, 3))
ROD = block((-0.5, -0.5, 0), (0.5, 0.5, 2), (3, 3, 6))


def turn(angle: float, surface: str = "z0") -> RigidSurface:
    """A turn about an axis through a point beside the cube."""
    return RigidSurface("block", surface, (2.0, 0.0, 0.0), (0.0, 0.0, 0.1), (0.0, 0.0, angle))


def following(supports: list[RigidSurface | Support], step: LoadStep, **how: float) -> DeformedState:
    scene = Scene({"block": Body(CUBE, RUBBER)}, supports)
    steps = AutomaticSteps(TangentNewton(1e-9), **how)
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut(CUBE, 1), steps=steps)
    (state,) = solve_steps(problem, [step])
    assert isinstance(state, DeformedState)
    return state


@pytest.mark.parametrize("angle", [0.5 * np.pi, np.pi], ids=["90", "180"])
@pytest.mark.parametrize("first", [1.0, 0.5])
def test_a_turned_cube_has_no_stress(angle: float, first: float) -> None:
    """In one load step, and without a product."""
    state = following([turn(0.0)], LoadStep("turn", supports=[turn(angle)]), first=first)
    c, s = np.cos(angle), np.sin(angle)
    arms = CUBE.points - (2.0, 0.0, 0.0)
    exact = arms @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T - arms + (0, 0, 0.1)
    assert np.abs(state.gather_displacement("block") - exact).max() < 1e-12
    assert np.abs(state.stress["block"].x.array).max() < 1e-12
    assert state.solution.products == 0
    assert state.fractions[0] == first
    (motion,) = state.rigid_motions()
    assert motion.displacement == pytest.approx([0, 0, 0.1], abs=1e-12)
    assert motion.rotation == pytest.approx([0, 0, angle], abs=1e-12)


def spun(angle: float) -> Support:
    """Nodes of the cube's underside on their way about a vertical axis, by functions of space."""
    c, s = np.cos(angle), np.sin(angle)
    way = (lambda x: (c - 1) * x[:, 0] - s * x[:, 1], lambda x: s * x[:, 0] + (c - 1) * x[:, 1], 0.0)
    return Support("block", "z0", way)


def test_a_loaded_cube_is_turned_by_90_degrees_in_one_load_step() -> None:
    """It starts turned, strained as before, and is as bent as one turned first and loaded then."""
    load, none = Traction("block", "z1", (0.05, 0.02, -0.1)), Traction("block", "z1", (0.0, 0.0, 0.0))
    ways = [[(0.0, load), (0.5 * np.pi, load)], [(0.5 * np.pi, none), (0.5 * np.pi, load)]]
    found = []
    for way in ways:
        scene = Scene({"block": Body(CUBE, RUBBER)}, [spun(0.0)], loads=[none])
        problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut(CUBE, 1), tolerance=1e-10)
        steps = [LoadStep(str(angle), supports=[spun(angle)], loads=[load]) for angle, load in way]
        found.append(solve_steps(problem, steps))
    assert isinstance(found[0][-1], DeformedState)
    assert found[0][-1].fractions == (1.0,)
    one, other = (states[-1].gather_displacement("block") for states in found)
    assert np.abs(one - other).max() < 1e-9


def test_a_body_does_not_start_inside_of_an_obstacle() -> None:
    """Moved into its floor as a whole it would have to be pressed out again: it is not moved."""
    floor = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, -0.05), (0, 0, 1)))
    down = LoadStep("down", supports=[Support("block", "z1", (0.0, 0.0, -0.2))])
    scene = Scene({"block": Body(CUBE, RUBBER)}, [Support("block", "z1")], contacts=[floor])
    state = solve_steps(ContactProblem(scene, MPI.COMM_SELF), [down])[0]
    assert isinstance(state, DeformedState)
    assert state.contact.normal_force.sum() > 0.1
    assert len(state.solution.history) < 7
    assert state.fractions == (1.0,)


def test_on_the_way_it_moves_along_an_arc() -> None:
    """Halfway the support is where half of the angle is, in the rows that hold it, too."""
    pressed = [turn(1.0), Support("block", "z1", (None, None, -0.2))]
    free = [turn(0.0), Support("block", "z1", (None, None, 0.0))]
    state = following(free, LoadStep("turn and press", supports=pressed), first=0.5)
    assert state.fractions[:1] == (0.5,)
    halfway = state.load.between(state.load.removed(), 0.5)
    bottom = np.unique(CUBE.surfaces["z0"])
    arms = CUBE.points[bottom, :2] - (2.0, 0.0)
    c, s = np.cos(0.5), np.sin(0.5)
    exact = arms @ np.array([[c, s], [-s, c]]) - arms
    assert np.abs(halfway.prescribed[bottom, :2] - exact).max() < 1e-12
    gluing = halfway.torn.decomposition.gluing
    held = gluing.right_side(halfway.prescribed)
    assert np.abs(held).max() > 0.1
    assert np.abs(halfway.torn.right[: len(held)] - held).max() < 1e-12


def ends(angle: float) -> list[RigidSurface]:
    return [
        RigidSurface("block", surface, (0, 0, z), (0, 0, 0), (0, 0, way * angle / 2))
        for surface, z, way in (("z0", 0, -1), ("z1", 2, 1))
    ]


def test_a_twisted_rod_has_a_moment_about_its_axis_alone() -> None:
    scene = Scene({"block": Body(ROD, RUBBER)}, ends(0.0))
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10)
    steps = [LoadStep(f"{angle:.2f}", supports=ends(angle)) for angle in (0.01, 0.5 * np.pi)]
    little, far = (state.reactions((0, 0, 1)) for state in solve_steps(problem, steps))
    for low, high in (little, far):
        assert low.moment + high.moment == pytest.approx(0.0, abs=1e-8)
        assert high.moment[:2] == pytest.approx(0.0, abs=1e-8)
        assert high.force[:2] == pytest.approx(0.0, abs=1e-8)
    stiffness = little[1].moment[2] / 0.01
    assert 0.0 < far[1].moment[2] < 1.1 * stiffness * 0.5 * np.pi
    assert far[1].force[2] < -1e-3, "twisted rubber wants to be longer: it pushes its ends apart"


def test_functions_of_time_have_their_values_on_the_way() -> None:
    """Half a step ends where the function is, not between its ends."""

    def moved(time: float) -> list[Support]:
        return [Support("block", "z0"), Support("block", "z1", (0.3 * np.sin(np.pi * time), 0.0, 0.0))]

    def pull(time: float) -> list[Traction]:
        return [Traction("block", "x1", (0.0, 0.02 * time**2, 0.0))]

    scene = Scene({"block": Body(CUBE, RUBBER)}, moved(0.0))
    seen: list[float] = []

    def watched(time: float) -> list[Support]:
        seen.append(time)
        return moved(time)

    steps = [LoadStep(f"{t}", loads=pull, supports=watched, time=t) for t in (1.0, 1.5)]
    problem = ContactProblem(
        scene, MPI.COMM_SELF, partitions=cut(CUBE, 1), steps=AutomaticSteps(first=0.5, smallest=0.5)
    )
    sequence = LoadSequence(problem)
    at_one = sequence.advance(steps[0])
    top = np.unique(CUBE.surfaces["z1"])
    assert isinstance(at_one, DeformedState)
    assert at_one.fractions == (0.5, 1.0)
    assert seen == [1.0, 0.5]
    # Half way the top was pushed by 0.3, and the part after it drew it back.
    first = at_one.load.between(at_one.load.removed(), 0.5)
    assert np.nanmax(first.prescribed) == pytest.approx(0.3)
    force = first.torn.load.reshape(-1, 3).sum(axis=0)
    assert force == pytest.approx([0.0, 0.02 * 0.25, 0.0])
    last = sequence.advance(steps[1])
    assert last.gather_displacement("block")[top, 0] == pytest.approx(-0.3, abs=1e-9)
    assert last.balance().loads.force == pytest.approx([0.0, 0.02 * 2.25, 0.0])


def test_functions_of_time_in_the_plane_and_with_linear_materials() -> None:
    plate = rectangle((0, 0), (1, 1), (3, 3))

    def supports(time: float) -> list[RigidSurface]:
        return [RigidSurface("plate", "y0", (0.0, 0.0), (0.0, 0.0), 0.1 * time)]

    steps = [LoadStep("t", supports=supports, time=2.0)]
    small = Scene({"plate": Body(plate, PlaneStrain(1.0, 0.3))}, supports(0.0))
    large = Scene({"plate": Body(plate, RUBBER)}, supports(0.0))
    (a,), (b,) = (solve_steps(ContactProblem(each, MPI.COMM_SELF), steps) for each in (small, large))
    corner = int(np.argmin(np.linalg.norm(plate.points - (1.0, 0.0), axis=1)))
    assert a.gather_displacement("plate")[corner] == pytest.approx([0.0, 0.2])
    assert b.gather_displacement("plate")[corner] == pytest.approx([np.cos(0.2) - 1, np.sin(0.2)])


def test_what_functions_of_time_must_not_do() -> None:
    with pytest.raises(InvalidInputError, match=r"LoadStep 'a' must have the time at its end.*: give time"):
        LoadStep("a", loads=lambda time: [])
    scene = Scene({"block": Body(CUBE, RUBBER)}, [turn(0.0)])
    sequence = LoadSequence(ContactProblem(scene, MPI.COMM_SELF))
    with pytest.raises(UserCodeError, match=r"the supports of LoadStep 'b' at time 2 failed with ZeroDiv"):
        sequence.advance(LoadStep("b", supports=lambda time: [turn(1 / 0)], time=2.0))


FILE = {
    "meshes": {"m": {"shape": "block", "lower": [0, 0, 0], "upper": [1, 1, 1], "counts": [2, 2, 2]}},
    "materials": {"rubber": {"model": "neo_hooke", "young_modulus": 1.0, "poisson_ratio": 0.3}},
    "bodies": {"block": {"mesh": "m", "material": "rubber"}},
}
TURN = {"kind": "rigid", "name": "turn", "body": "block", "surface": "z0", "at": [2.0, 0.0, 0.0]}


@pytest.mark.parametrize("value", [[0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, "0.75 * t"]], ids=["ramp", "formula"])
def test_scene_files_turn_surfaces(value: list[object]) -> None:
    steps = [{"name": "turn", "count": 2}]
    if value[-1] == 0:
        steps[0]["supports"] = {"turn": [0, 0, 0, 0, 0, 1.5]}
    file = read_scene_file({**FILE, "supports": [{**TURN, "value": value}], "steps": steps}, MPI.COMM_SELF)
    assert callable(file.steps[0].supports) == (value[-1] != 0)
    sequence = file.sequence()
    for step, angle in zip(file.steps, (0.75, 1.5), strict=True):
        state = sequence.advance(step)
        points = file.scene.bodies["block"].mesh.points
        c, s = np.cos(angle), np.sin(angle)
        exact = (points - (2.0, 0, 0)) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + (2.0, 0, 0)
        assert np.abs(points + state.gather_displacement("block") - exact).max() < 1e-6
    assert isinstance(state, DeformedState)
    halfway = state.load.between(state.load.removed(), 0.5)
    c, s = np.cos(0.75), np.sin(0.75)
    bottom = np.unique(file.scene.bodies["block"].mesh.surfaces["z0"])
    arms = points[bottom] - (2.0, 0, 0)
    exact = arms @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) - arms
    assert np.abs(halfway.prescribed[bottom] - exact).max() < 1e-12


def test_bodies_come_back_to_rest() -> None:
    """Residuals are relative to what there was: at rest there is nothing to be relative to."""
    scene = Scene({"block": Body(CUBE, RUBBER)}, [turn(0.0), Support("block", "z1")])
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut(CUBE, 1))
    away, back, still = (
        [Support("block", "z0"), Support("block", "z1", (x, 0.0, 0.0))] for x in (0.3, 0.0, 0.0)
    )
    steps = [LoadStep(name, supports=each) for name, each in (("a", away), ("b", back), ("c", still))]
    states = solve_steps(problem, steps)
    assert states[0].contact.points.count == 0
    assert all(np.abs(state.gather_displacement("block")).max() < 1e-8 for state in states[1:])
    assert len(states[1].solution.history) <= 6


SPHERE = {"obstacle": "sphere", "centre": [0.5, 0.5, 2.0], "radius": 1.0}


def pressed_file(**sphere: object) -> SceneFile:
    pair = {"slave": {"body": "block", "surface": "z1"}, "master": {**SPHERE, **sphere}}
    base = {"body": "block", "surface": "z0", "name": "base"}
    data = {**FILE, "supports": [base], "contacts": [pair], "steps": [{"name": "press", "duration": 2.0}]}
    return read_scene_file(data, MPI.COMM_SELF)


def test_obstacles_of_scene_files_move() -> None:
    """Half a turn about a point beside the ball and a way back press it as far as a plain way does."""
    down = [0.0, 0.0, "-0.05 * t", 0.0, 0.0, 0.0]
    around = [0.0, -2.0, "-0.05 * t", 0.0, 0.0, "0.5 * pi * t"]
    plain, turned = (pressed_file(motion=motion, about=[0.5, 1.5, 0.0]) for motion in (down, around))
    for file in (plain, turned):
        (pair,) = file.scene.contacts
        assert isinstance(pair.master, MovingObstacle)
    place = np.array([[0.5, 0.5, 0.9]])
    assert turned.scene.contacts[0].master.at(2.0).distance(place) == pytest.approx(0.0)
    state = plain.solve()
    assert state.contact.force[:, 2].sum() < -1e-3
    assert state.gather_displacement("block")[:, 2].min() == pytest.approx(-0.1, abs=1e-3)


def test_scene_files_say_how_loads_are_followed() -> None:
    careful = {"first": 0.25, "smallest": 0.01, "snaps": True, "max_steps": 12, "max_products": 99}
    data = {**FILE, "solver": {"newton": careful}, "supports": [{**TURN, "value": [0] * 6}]}
    data["loads"] = [{"kind": "traction", "body": "block", "surface": "z1", "value": [0, 0, -0.1]}]
    file = read_scene_file(data, MPI.COMM_SELF)
    assert file.problem.steps == AutomaticSteps(
        TangentNewton(max_steps=12, max_products=99), 0.25, 0.01, snaps=True
    )
    state = file.solve()
    assert isinstance(state, DeformedState)
    assert state.fractions[0] == 0.25
    assert (
        read_scene_file({**data, "solver": {"newton": {}}}, MPI.COMM_SELF).problem.steps == AutomaticSteps()
    )
    contradicting = {**data, "solver": {"newton": {"first": 0.001}}}
    with pytest.raises(
        SceneFileError, match=r"solver\.newton: .*smallest and first part .* got 0.00390625 and 0.001"
    ):
        _ = read_scene_file(contradicting, MPI.COMM_SELF).problem
    linear = {**data, "materials": {"rubber": {"young_modulus": 1.0, "poisson_ratio": 0.3}}}
    with pytest.raises(SceneFileError, match=r"newton is for nonlinear materials.*got first, .*: leave it"):
        _ = read_scene_file(linear, MPI.COMM_SELF).problem


def test_wrong_motions_and_solvers_of_scene_files() -> None:
    with pytest.raises(
        SceneFileError, match=r"motion of an obstacle must be 6 numbers .* prescribe all of it"
    ):
        _ = pressed_file(motion=[0, 0, "free", 0, 0, 0]).scene
    file = read_scene_file(
        {**FILE, "supports": [{"body": "block", "surface": "z0"}], "solver": {"method": "smalse"}},
        MPI.COMM_SELF,
    )
    with pytest.raises(SceneFileError, match=r"method and max_products are for linear materials.*leave them"):
        file.solve()
    scene = Scene({"block": Body(CUBE, RUBBER)}, [turn(0.0)])
    with pytest.raises(InvalidInputError, match=r"dual solvers are for linear materials.*: give steps"):
        solve_scene(scene, MPI.COMM_SELF, solver=Smalse())
