"""Rigid tools and rigid surfaces at large deformations that forces, moments and springs move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LinearClosure,
    LoadSequence,
    LoadStep,
    RigidPlane,
    RigidSphere,
    RigidSurface,
    RigidTool,
    Scene,
    State,
    Support,
    Surface,
    ToolMotion,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact._large_deformations.rigid_surfaces import TurnedSurface
from fenics_contact.design.sensitivity import require_differentiable
from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, PlaneStrain
from fenics_contact.results.deformed_state import NewtonSteps
from tests.large_deformations.driven import BASE, DISC, FLAT, SOFT, hub, roller, under_disc, under_plate

COMM = MPI.COMM_SELF
PRESSED = ToolMotion("disc", (0.0, None), 0.0, (0.0, -20.0))
TILTED = ToolMotion("disc", None, None, (3.0, -20.0), 2.4)


@pytest.mark.parametrize("motion", [(0.3, -0.2, 0.9), (0.3, -0.2, 0.5, 0.4, -0.3, 0.2), (0, 0, 0, 1, -2, 3)])
def test_the_stiffness_of_a_rigid_surface_is_the_derivative_of_its_loads(motion: tuple[float, ...]) -> None:
    """Of those that fixed forces on its nodes exert, of a moment, and of turns of any size."""
    rng, dim = np.random.default_rng(0), 2 if len(motion) == 3 else 3
    points, forces = rng.standard_normal((2, 5, dim))
    surface = RigidSurface("body", "side", tuple(rng.standard_normal(dim)))
    load = rng.standard_normal(len(motion))
    start = TurnedSurface(
        surface, np.array(motion, dtype=float), load, 0.0 * load, np.arange(5), points, far=True, whole=False
    )

    def loads(at: TurnedSurface) -> np.ndarray:
        return at.driving + np.einsum("ndk,nd->k", at.rates, forces)

    found = start.stiffness(start.arms[:, :dim].T @ forces)
    size, moved = 1e-6, np.empty_like(found)
    for k, unit in enumerate(np.eye(len(motion))):
        ends = [replace(start, motion=start.motion + side * size * unit) for side in (1.0, -1.0)]
        moved[:, k] = -(loads(ends[0]) - loads(ends[1])) / (2.0 * size)
        rate = (ends[0].displacement - ends[1].displacement) / (2.0 * size)
        np.testing.assert_allclose(start.rates[:, :, k], rate, atol=1e-8)
    np.testing.assert_allclose(found, moved, atol=1e-7)
    assert np.abs(found).max() > 1.0
    more = rng.standard_normal(len(motion))
    np.testing.assert_allclose(start.driven_by(more).driving, start.driving + more, atol=1e-12)


def test_turns_about_several_axes_stay_below_a_full_one() -> None:
    """There their rates depend on each other; about one axis a surface may turn on."""
    points, nothing = np.random.default_rng(0).standard_normal((5, 3)), np.zeros(6)
    turned = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 2.0 * np.pi])
    for free, rotation in ((False, (0.0, 0.0, None)), (True, None)):
        surface = RigidSurface("body", "side", (0.0, 0.0, 0.0), rotation=rotation)
        start = TurnedSurface(surface, turned, nothing, nothing, np.arange(5), points, far=True, whole=False)
        if free:
            with pytest.raises(ConvergenceError, match="about several axes must stay below a full turn"):
                _ = start.basis
        else:
            assert np.abs(np.diag(start.basis[1])).min() > 0.1


def test_a_tool_that_nothing_can_turn_stays_upright_and_is_refused_under_a_moment() -> None:
    """A smooth disc about its centre."""
    disc = RigidTool("disc", RigidSphere((1.0, 4.0), 3.0), at=(1.0, 4.0))
    smooth = ToolMotion("disc", (0.0, None), None, (0.0, -20.0))
    state = solve_scene(under_disc(smooth, tool=disc, friction=0.0), COMM)
    assert abs(state.tools()["disc"].rotation) < 1e-4
    assert_balanced(state)
    with pytest.raises(InfeasibleError, match=r"body 'disc' can move away under the load: rotation \(1\)"):
        solve_scene(under_disc(replace(smooth, moment=0.5), tool=disc, friction=0.0), COMM)


def assert_balanced(state: State, accuracy: float = 1e-8) -> None:
    assert state.balance().imbalance < accuracy
    assert isinstance(state, DeformedState)
    assert state.fractions == (1.0,)


@pytest.fixture(scope="module")
def tilted() -> State:
    return solve_scene(under_disc(TILTED), COMM)


def test_a_tool_moves_and_tilts_until_force_and_moment_are_balanced(tilted: State) -> None:
    """By quadratic steps; what holds the block is what drives the tool."""
    tool = tilted.tools()["disc"]
    np.testing.assert_allclose(tool.force, (-3.0, 20.0), rtol=1e-7)
    assert tool.moment == pytest.approx(-2.4, rel=1e-7)
    assert abs(tool.rotation) > 0.02
    assert_balanced(tilted)
    assert NewtonSteps.of([tilted]).reduction[0] < 1e-3
    np.testing.assert_allclose(tilted.reactions()["block y0"].force, (-3.0, 20.0), rtol=1e-7)
    np.testing.assert_allclose(tilted.reactions()["disc tool"].force, 0.0, atol=1e-7)
    parts = tilted.balance()
    np.testing.assert_allclose(parts.loads.force, (3.0, -20.0))
    np.testing.assert_allclose(parts.obstacles.force, 0.0, atol=1e-12)


def test_the_motion_that_forces_cause_needs_these_forces(tilted: State) -> None:
    """The same contact where the motion is prescribed; its reactions are the loads."""
    tool = tilted.tools()["disc"]
    way = ToolMotion("disc", tuple(tool.displacement), float(tool.rotation))
    given = solve_scene(under_disc(way), COMM, tolerance=1e-9)
    size = np.abs(tilted.contact.force).max()
    np.testing.assert_allclose(given.contact.force, tilted.contact.force, atol=1e-6 * size)
    np.testing.assert_allclose(given.tools()["disc"].force, tool.force, rtol=1e-6)
    reaction = given.reactions()["disc tool"]
    np.testing.assert_allclose(reaction.force, (3.0, -20.0), rtol=1e-6)
    assert reaction.moment_about(np.array(DISC.at) + tool.displacement) == pytest.approx(2.4, rel=1e-6)
    parts = given.balance()
    np.testing.assert_allclose(parts.obstacles.force, 0.0, atol=1e-12)
    np.testing.assert_allclose(parts.reactions.force, 0.0, atol=1e-6)


def test_small_loads_move_tools_as_with_small_displacements() -> None:
    """To the thousandth part of the loads, in the plane and in space."""
    small = 1e-3
    forces, springs = ((1.5 * small, -10.0 * small), 1.2 * small), ((0.0, 2.0), 3.0)
    plane = ToolMotion("disc", None, None, *forces, *springs)
    down, tip = (0.3 * small, 0.1 * small, -40.0 * small), (2.0 * small, 3.0 * small, small)
    space = ToolMotion("plate", None, None, down, tip)
    cases = [
        (partial(under_disc, plane, tool=FLAT), PlaneStrain(100.0, 0.3)),
        (partial(under_plate, space), IsotropicElasticity(100.0, 0.3)),
    ]
    for scene, soft in cases:
        states = (solve_scene(each, COMM, tolerance=1e-9) for each in (scene(), scene(material=soft)))
        much, little = (next(iter(state.tools().values())) for state in states)
        for attribute in ("displacement", "rotation"):
            known, found = (np.atleast_1d(getattr(each, attribute)) for each in (little, much))
            assert np.abs(known).max() > 1e-6
            np.testing.assert_allclose(found, known, atol=1e-3 * np.abs(known).max())


def test_a_plate_turns_about_all_axes_under_a_moment() -> None:
    """Free in all six components, held by friction; force and moment keep their directions in space."""
    force, moment = (1.0, 0.5, -40.0), (2.0, 3.0, 1.0)
    state = solve_scene(under_plate(ToolMotion("plate", None, None, force, moment)), COMM)
    tool = state.tools()["plate"]
    np.testing.assert_allclose(tool.force, -np.array(force), rtol=1e-6)
    np.testing.assert_allclose(tool.moment, -np.array(moment), rtol=1e-6)
    assert np.abs(tool.rotation).min() > 0.01
    assert_balanced(state)
    assert NewtonSteps.of([state]).reduction[0] < 1e-2


def test_surfaces_that_give_way_and_springs_of_friction_drive_a_tool_as_exact_contact() -> None:
    """Forces and moments on the tool are those that drive it, also across a distance."""
    scene = under_disc(TILTED)
    soft = replace(scene.contacts[0], closure=LinearClosure(3000.0))
    elastic = replace(scene.contacts[0], friction=Coulomb(0.5, stick_stiffness=2000.0))
    back = replace(TILTED, force=(-3.0, -20.0))
    steps = [LoadStep(f"{k}", supports=[BASE, motion]) for k, motion in enumerate((TILTED, back))]
    for pair in (soft, elastic):
        problem = ContactProblem(replace(scene, contacts=[pair]), COMM)
        for state, side in zip(solve_steps(problem, steps), (1.0, -1.0), strict=True):
            tool = state.tools()["disc"]
            np.testing.assert_allclose(tool.force, (-3.0 * side, 20.0), rtol=1e-6)
            assert tool.moment == pytest.approx(-2.4, rel=1e-6)
            assert state.balance().imbalance < 1e-8


def test_springs_take_what_rubber_leaves() -> None:
    """Along and around; also before anything touches, where nothing else holds the tool."""
    motion = ToolMotion(
        "disc", None, None, (0.0, -25.0), 1.0, stiffness=(5.0, 30.0), rotational_stiffness=4.0
    )
    state = solve_scene(under_disc(motion), COMM)
    tool = state.tools()["disc"]
    x, y = tool.displacement
    np.testing.assert_allclose(tool.force, (5.0 * x, 25.0 + 30.0 * y), atol=1e-6)
    assert tool.moment == pytest.approx(-1.0 + 4.0 * tool.rotation, abs=1e-6)
    assert_balanced(state)
    np.testing.assert_allclose(state.balance().beds.force, (-5.0 * x, -30.0 * y), atol=1e-8)
    np.testing.assert_allclose(state.reactions()["disc tool"].force, 0.0, atol=1e-6)
    high = RigidTool("disc", RigidSphere((1.0, 4.5), 3.0), at=(1.0, 1.0))
    hanging = replace(motion, force=(1.0, -6.0))
    apart = solve_scene(under_disc(hanging, tool=high), COMM)
    np.testing.assert_allclose(apart.tools()["disc"].displacement, (0.2, -0.2), rtol=1e-9)
    assert apart.tools()["disc"].rotation == pytest.approx(0.25)
    assert apart.contact.normal_force.max() == 0.0
    stored = 0.5 * (5.0 * 0.2**2 + 30.0 * 0.2**2 + 4.0 * 0.25**2)
    assert apart.energies.strain == pytest.approx(stored, rel=1e-9)


def test_a_tool_that_starts_apart_comes_down_by_its_force() -> None:
    high = RigidTool("disc", RigidSphere((1.0, 4.5), 3.0), at=(1.0, 1.0))
    apart, near = (solve_scene(under_disc(PRESSED, tool=tool, friction=0.0), COMM) for tool in (high, DISC))
    way = [state.tools()["disc"].displacement[1] for state in (apart, near)]
    assert way[0] == pytest.approx(way[1] - 0.5, rel=1e-6)
    with pytest.raises(
        InfeasibleError, match=r"body 'disc' can move away under the load: translation \(0, 1\)"
    ):
        solve_scene(under_disc(replace(PRESSED, force=(0.0, 2.0))), COMM)


def test_load_steps_drive_a_tool_in_turn_by_motions_forces_and_springs() -> None:
    """What was prescribed begins with the force it transmitted; a step without change moves nothing."""
    held = ToolMotion("disc", (0.02, -0.1), 0.01)
    first = solve_scene(under_disc(held), COMM)
    force, moment = -first.tools()["disc"].force, -float(first.tools()["disc"].moment)
    motions = [
        held,
        ToolMotion("disc", None, None, tuple(force), moment),
        ToolMotion("disc", (0.0, None), 0.05, (0.0, -25.0), stiffness=(0.0, 30.0)),
        ToolMotion("disc", (0.0, -0.05), 0.05),
    ]
    problem = ContactProblem(under_disc(held), COMM)
    steps = [LoadStep(f"{k}", supports=[BASE, motion]) for k, motion in enumerate(motions)]
    _, same, sprung, back = solve_steps(problem, steps)
    np.testing.assert_allclose(same.tools()["disc"].displacement, (0.02, -0.1), atol=1e-7)
    assert same.tools()["disc"].rotation == pytest.approx(0.01, abs=1e-7)
    assert isinstance(same, DeformedState)
    assert len(same.solution.history) <= 2
    y = sprung.tools()["disc"].displacement[1]
    assert sprung.tools()["disc"].force[1] == pytest.approx(25.0 + 30.0 * y, rel=1e-7)
    np.testing.assert_allclose(back.tools()["disc"].displacement, (0.0, -0.05), atol=1e-12)


def test_a_rigid_hub_under_a_force_sinks_as_the_prescribed_one() -> None:
    """And work of the force and stored energy are those of one ring."""
    pressed = solve_scene(roller(hub(displacement=(0.0, None), rotation=0.0, force=(0.0, -0.3))), COMM)
    depth = float(pressed.rigid_motions()[0].displacement[1])
    assert depth < -0.1
    given = solve_scene(roller(hub(displacement=(0.0, depth), rotation=0.0)), COMM)
    np.testing.assert_allclose(given.reactions()["ring inner"].force, (0.0, -0.3), atol=1e-7)
    np.testing.assert_allclose(pressed.reactions()["ring inner"].force, 0.0, atol=1e-8)
    assert pressed.energies.strain == pytest.approx(given.energies.strain, rel=1e-7)
    assert pressed.energies.load == pytest.approx(0.3 * -depth, rel=1e-12)
    assert_balanced(pressed)


def rolled(turn: np.ndarray, problem: Callable[[Scene], ContactProblem]) -> list[State]:
    """Pressed by a force, then rolled by a turn, pulled back by another force."""
    down, pull = turn @ (0.0, -0.3), turn @ (0.02, 0.0)
    driven = [hub(rotation=0.0, force=tuple(down))]
    driven += [hub(rotation=-0.15 * k, force=tuple(down + pull)) for k in (1, 2)]
    scene = roller(driven[0], friction=0.4, turn=turn)
    steps = [LoadStep(f"{k}", supports=[each]) for k, each in enumerate(driven)]
    return list(solve_steps(problem(scene), steps))


def test_a_roller_rolls_and_a_scene_that_is_turned_has_the_turned_answer() -> None:
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    upright, lying = (rolled(each, lambda scene: ContactProblem(scene, COMM)) for each in (np.eye(2), turn))
    for one, other in zip(upright, lying, strict=True):
        way, found = (state.rigid_motions()[0].displacement for state in (one, other))
        np.testing.assert_allclose(found, turn @ way, atol=1e-7)
        size = np.abs(one.contact.force).max()
        np.testing.assert_allclose(other.contact.force, one.contact.force @ turn.T, atol=1e-6 * size)
        assert one.balance().imbalance < 1e-7
    # It rolls by a little more than the turned arc of its squeezed radius would.
    assert 0.3 * 1.7 < upright[2].rigid_motions()[0].displacement[0] < 0.3 * 2.2


def test_tools_of_revolution_and_surfaces_of_metal_are_driven_by_forces() -> None:
    """On bodies of revolution along the axis; where displacements are small with plastic strain, too."""
    ball = RigidTool("ball", RigidSphere((0.0, 2.0), 2.0), at=(0.0, 2.0))
    rubber = Body(rectangle((0, -1), (1, 0), (6, 6)), SOFT, axisymmetric=True)
    pair = ContactPair(Surface("block", "y1"), ball)
    driven = ToolMotion("ball", force=(0, -20.0), stiffness=(0, 40.0))
    state = solve_scene(Scene({"block": rubber}, [BASE, driven], contacts=[pair]), COMM)
    tool = state.tools()["ball"]
    assert tool.force[1] - 40.0 * tool.displacement[1] == pytest.approx(20.0, rel=1e-7)
    assert_balanced(state)
    bar = Body(rectangle((0, 0), (2, 1), (6, 3)), J2Plasticity(1000.0, 0.3, 5.0, 100.0))
    bent = RigidSurface("bar", "x1", (2.0, 0.5), force=(0.0, -0.6), moment=0.2)
    scene = Scene({"bar": bar}, [Support("bar", "x0"), bent])
    found = solve_scene(scene, COMM)
    motion = found.rigid_motions()[0]
    given = RigidSurface("bar", "x1", (2.0, 0.5), tuple(motion.displacement), motion.rotation)
    reaction = solve_scene(replace(scene, supports=[Support("bar", "x0"), given]), COMM).reactions()[1]
    np.testing.assert_allclose(reaction.force, (0.0, -0.6), atol=1e-6)
    assert reaction.moment == pytest.approx(0.2, rel=1e-6)


def test_a_ball_under_a_force_is_the_ball_that_is_pressed_as_deep() -> None:
    """Force in is force out, also with friction, and costs hardly more steps."""

    def scene(motion: ToolMotion) -> Scene:
        body = Body(block((-1, -1, -1), (1, 1, 0), (5, 5, 2)), SOFT)
        ball = RigidTool("ball", RigidSphere((0.1, 0.0, 2.0), 2.0), at=(0.1, 0.0, 2.0))
        pair = ContactPair(Surface("block", "z1"), ball, Coulomb(0.3))
        return Scene({"block": body}, [Support("block", "z0"), motion], contacts=[pair])

    down = ToolMotion("ball", (0.0, 0.0, -0.2), (0.0, 0.0, 0.0))
    moved = solve_scene(scene(down), COMM)
    force = (0.0, 0.0, -moved.tools()["ball"].force[2])
    loaded = solve_scene(scene(ToolMotion("ball", (0.0, 0.0, None), (0.0, 0.0, 0.0), force)), COMM)
    tools = [state.tools()["ball"] for state in (moved, loaded)]
    np.testing.assert_allclose(tools[1].displacement, tools[0].displacement, atol=1e-8)
    np.testing.assert_allclose(tools[1].force, tools[0].force, rtol=1e-6, atol=1e-6)
    counts = [len(state.solution.history) for state in (moved, loaded)]
    assert counts[1] <= counts[0] + 2
    assert_balanced(loaded)


def test_histories_with_free_tools_go_on_from_a_checkpoint(tmp_path: Path) -> None:
    motions = [TILTED, replace(TILTED, force=(-2.0, -25.0), stiffness=(1.0, 0.0))]
    steps = [LoadStep(f"{k}", supports=[BASE, motion]) for k, motion in enumerate(motions)]
    ends = []
    for count in (2, 1):  # the second time the first step is read
        problem = ContactProblem(under_disc(motions[0]), COMM)
        sequence = LoadSequence(problem, checkpoint=Checkpoint(tmp_path / f"{count}.npz"))
        for step in steps[:count]:
            end = sequence.advance(step)
        ends.append(end)
    problem = ContactProblem(under_disc(motions[0]), COMM)
    resumed = LoadSequence(problem, checkpoint=Checkpoint(tmp_path / "1.npz"))
    first = resumed.advance(steps[0])
    assert first.solution.reason == "read from a checkpoint"
    again = resumed.advance(steps[1])
    for state, other in ((first, ends[1]), (again, ends[0])):
        one, two = (each.tools()["disc"] for each in (state, other))
        np.testing.assert_allclose(one.displacement, two.displacement, atol=1e-9)
        np.testing.assert_allclose(one.force, two.force, rtol=1e-6)


def test_derivatives_need_prescribed_motions(tilted: State) -> None:
    assert isinstance(tilted, DeformedState)
    with pytest.raises(InvalidInputError, match=r"is prescribed, but that of \[.disc.\] has free"):
        require_differentiable(tilted)


def test_a_plane_that_is_free_to_move_presses_a_ring_from_above() -> None:
    """A tool, a hub and a fixed plane in one scene."""
    scene = roller(hub(displacement=(0.0, None), rotation=0.0))
    lid = RigidTool("lid", RigidPlane((0.0, 2.0), (0.0, -1.0)), at=(0.0, 2.0))
    pairs = [replace(scene.contacts[0], slave=Surface("ring", "y0")), ContactPair(Surface("ring", "y1"), lid)]
    lowered = ToolMotion("lid", (0.0, None), 0.0, (0.0, -0.3))
    state = solve_scene(replace(scene, supports=[*scene.supports, lowered], contacts=pairs), COMM)
    middle, top = (motion.displacement[1] for motion in state.rigid_motions())
    assert top == pytest.approx(2.0 * middle, rel=1e-6)
    np.testing.assert_allclose(state.tools()["lid"].force, (0.0, 0.3), atol=1e-8)


CASE = """
from mpi4py import MPI
from fenics_contact import ToolMotion, box_partition, solve_scene
from tests.large_deformations.driven import under_disc
scene = under_disc(ToolMotion("disc", None, None, (3.0, -20.0), 2.4))
cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1))}
tool = solve_scene(scene, MPI.COMM_WORLD, partitions=cut).tools()["disc"]
if MPI.COMM_WORLD.rank == 0:
    print(*tool.displacement, tool.rotation)
"""


def test_ranks_and_subdomains_change_nothing(mpirun: Callable[..., str], tilted: State) -> None:
    cut = {"block": box_partition(tilted.scene.bodies["block"].mesh, (3, 2))}
    pieces = solve_scene(under_disc(TILTED), COMM, partitions=cut)
    tools = (state.tools()["disc"] for state in (tilted, pieces))
    alone, cut_up = ([*tool.displacement, tool.rotation] for tool in tools)
    np.testing.assert_allclose(cut_up, alone, atol=1e-8)
    np.testing.assert_allclose(np.array(mpirun(CASE, 2).split(), dtype=float), alone, atol=1e-8)


def test_smaller_parts_end_at_the_same_place(tilted: State) -> None:
    """Forces grow with the load."""
    parts = solve_scene(under_disc(TILTED), COMM, steps=AutomaticSteps(first=0.25))
    assert isinstance(parts, DeformedState)
    assert len(parts.fractions) > 1
    np.testing.assert_allclose(
        parts.tools()["disc"].displacement, tilted.tools()["disc"].displacement, atol=1e-7
    )
