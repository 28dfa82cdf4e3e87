"""Rigid tools that forces, moments, springs and prescribed motions move, with small displacements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    MovingObstacle,
    RigidPlane,
    RigidSphere,
    RigidTool,
    Roller,
    Scene,
    State,
    Status,
    Support,
    Surface,
    ToolMotion,
    solve_scene,
    solve_steps,
    write_vtu,
)
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.output import write_xdmf
from fenics_contact.shapes import Cone
from fenics_contact.study.scenes.nested_box import mirrored, nested_box
from tests.equilibrium.checks import assert_solved
from tests.equilibrium.tooling import (
    BASE,
    DOWN,
    LEFT,
    PLATE,
    RIGHT,
    SOFT,
    STRAIGHT,
    TOLERANCE,
    pressed,
    sprung,
)


def solved(scene: Scene, comm: MPI.Comm = MPI.COMM_SELF) -> State:
    state = solve_scene(scene, comm, tolerance=TOLERANCE)
    assert_solved(state, TOLERANCE)
    return state


def test_a_tool_that_moves_as_prescribed_is_the_obstacle_at_its_place() -> None:
    """The ball comes 0.05 lower: the same as one that lies there, and its reaction is the force on it."""
    way = (0.0, 0.0, -0.05)
    driven = solved(pressed(ToolMotion("left", way, STRAIGHT), friction=0.0))
    lower = RigidSphere((-0.5, 0.0, 1.95), 2.0)
    scene = Scene(
        driven.scene.deforming, [BASE],
        contacts=[ContactPair(Surface("block", "z1"), lower, interference="measured")],
    )  # fmt: skip
    still = solved(scene)
    # Gaps are measured along normals at the place before the tool moves.
    size = np.abs(still.contact.force).max()
    np.testing.assert_allclose(driven.contact.force, still.contact.force, atol=3e-3 * size)
    tool = driven.tools()["left"]
    np.testing.assert_array_equal(tool.displacement, way)
    np.testing.assert_array_equal(tool.rotation, STRAIGHT)
    words = str(driven.tools())
    assert words.startswith("left: displacement (0, 0, -0.05) [length], rotation (0, 0, 0) rad;")
    assert words.endswith("[force·length] on it")
    with pytest.raises(InvalidInputError, match="tools of the scene are 'left', got 'right'"):
        driven.tools()["right"]
    np.testing.assert_allclose(tool.force, -driven.contact.force.sum(axis=0), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(driven.reactions()["left tool"].force, -tool.force, atol=1e-9 * size)
    assert driven.balance().imbalance < 1e-10


def test_the_force_that_a_prescribed_motion_needs_causes_that_motion() -> None:
    """Also where points slip; with two tools on one body, and of each other components free."""
    motion = (
        ToolMotion("left", (0.01, 0.0, -0.05), (0.0, 0.002, 0.0)),
        ToolMotion("right", (0, 0, -0.04), STRAIGHT),
    )
    given = solved(pressed(*motion, tools=(LEFT, RIGHT)))
    assert min(given.contact.counts_in_words.count(word) for word in ("stick", "slip", "open")) == 1
    forces = {name: given.reactions()[f"{name} tool"] for name in ("left", "right")}
    left, right = forces["left"], forces["right"]
    loaded = (
        ToolMotion(
            "left", (None, 0, None), (0, None, 0), (left.force[0], 0, left.force[2]), (0, left.moment[1], 0)
        ),
        ToolMotion("right", DOWN, STRAIGHT, (0, 0, right.force[2])),
    )
    found = solved(pressed(*loaded, tools=(LEFT, RIGHT)))
    np.testing.assert_allclose(found.tools()["left"].displacement, (0.01, 0, -0.05), atol=1e-8)
    np.testing.assert_allclose(found.tools()["left"].rotation, (0, 0.002, 0), atol=1e-8)
    np.testing.assert_allclose(found.tools()["right"].displacement, (0, 0, -0.04), atol=1e-8)
    u, v = (each.gather_displacement("block") for each in (given, found))
    np.testing.assert_allclose(v, u, atol=1e-7 * np.abs(u).max())
    assert found.balance().imbalance < 1e-9


def test_a_free_plate_tilts_until_its_contact_has_no_moment_about_the_force() -> None:
    state = solved(
        pressed(ToolMotion("plate", DOWN, (None, None, 0), (0, 0, -30)), tools=(PLATE,), friction=0.0)
    )
    plate = state.tools()["plate"]
    np.testing.assert_allclose(plate.force, (0, 0, 30.0), atol=1e-9)
    np.testing.assert_allclose(plate.moment, 0.0, atol=1e-8)
    assert plate.rotation[1] == pytest.approx(0.00422, rel=0.02)  # type: ignore[index]
    # All nodes under it lie in its plane.
    moved = state.gather_displacement("block")[state.contact.points.slave]
    arms = state.contact_places - np.array(PLATE.at)
    carried = plate.displacement[2] + np.cross(np.atleast_1d(plate.rotation), arms)[:, 2]
    closed = state.contact.normal_force > 1e-6
    assert closed.sum() > 70
    np.testing.assert_allclose(moved[closed, 2], carried[closed], atol=1e-8)


def test_a_spring_takes_what_the_block_leaves() -> None:
    state = solved(pressed(ToolMotion("left", DOWN, STRAIGHT, (0, 0, -6.0), stiffness=(0, 0, 100.0))))
    tool = state.tools()["left"]
    assert tool.displacement[2] < -0.01
    assert tool.force[2] - 100.0 * tool.displacement[2] == pytest.approx(6.0, rel=1e-9)
    assert state.balance().beds.force[2] == pytest.approx(-100.0 * tool.displacement[2], rel=1e-9)
    # It is the tool that a force less that of the spring drives.
    other = solved(pressed(ToolMotion("left", DOWN, STRAIGHT, (0, 0, -tool.force[2]))))
    assert other.tools()["left"].displacement[2] == pytest.approx(tool.displacement[2], rel=1e-6)


def test_contact_on_a_surface_with_the_name_of_a_tool_is_not_contact_on_the_tool() -> None:
    alone, name = pressed(ToolMotion("left", (0.0, 0.0, -0.02), STRAIGHT)), "left"
    lower, upper = block((8, 0, 0), (9, 1, 1), (2, 2, 2)), block((8, 0, 1), (9, 1, 2), (2, 2, 2))
    lower = replace(lower, surfaces={**lower.surfaces, name: lower.surfaces["z1"]})
    scene = replace(
        alone,
        bodies={
            **{each: alone.bodies[each] for each in alone.deforming},
            "lower": Body(lower, SOFT),
            "upper": Body(upper, SOFT),
        },
        supports=[*alone.supports, Support("lower", "z0"), Support("upper", "z1", (0, 0, -0.01))],
        contacts=[*alone.contacts, ContactPair(Surface("upper", "z0"), Surface("lower", name))],
    )
    one, both = solved(alone).tools()[name], solved(scene).tools()[name]
    assert abs(one.force[2]) > 1e-3
    np.testing.assert_allclose(both.force, one.force, rtol=1e-6, atol=1e-9)


def test_a_spring_holds_a_tool_that_nothing_touches() -> None:
    high = RigidTool("high", RigidSphere((0, 0, 3.0), 2.0), at=(0, 0, 3.0))
    springs = {"stiffness": (10.0, 20.0, 40.0), "rotational_stiffness": (5.0, 5.0, 5.0)}
    motion = ToolMotion("high", force=(1.0, 2.0, -4.0), moment=(0.5, 0, 0), **springs)  # type: ignore[arg-type]
    state = solved(pressed(motion, tools=(high,)))
    np.testing.assert_allclose(state.tools()["high"].displacement, (0.1, 0.1, -0.1), rtol=1e-9)
    np.testing.assert_allclose(state.tools()["high"].rotation, (0.1, 0, 0), atol=1e-9)
    assert state.contact.normal_force.max() < 1e-9


def test_load_steps_change_what_drives_a_tool() -> None:
    """Loaded, held where a step says, then on a spring; friction remembers."""
    problem = ContactProblem(
        pressed(ToolMotion("left", DOWN, STRAIGHT, (0, 0, -3.0))), MPI.COMM_SELF, tolerance=TOLERANCE
    )
    motions = [
        ToolMotion("left", DOWN, STRAIGHT, (0, 0, -3.0)),
        ToolMotion("left", (0.01, 0.0, -0.02), STRAIGHT),
        ToolMotion("left", (0.01, 0.0, None), STRAIGHT, (0, 0, -6.0), stiffness=(0, 0, 100.0)),
    ]
    steps = [LoadStep(f"{k}", supports=[BASE, motion]) for k, motion in enumerate(motions)]
    first, second, third = solve_steps(problem, steps)
    assert first.tools()["left"].force[2] == pytest.approx(3.0, rel=1e-9)
    np.testing.assert_allclose(second.tools()["left"].displacement, (0.01, 0, -0.02), atol=1e-12)
    assert second.contact.force[:, 0].sum() > 0.5
    z = third.tools()["left"].displacement[2]
    assert third.tools()["left"].force[2] == pytest.approx(6.0 + 100.0 * z, rel=1e-8)
    at_rest = solve_steps(problem, [LoadStep("away", supports=[BASE])])[0]
    np.testing.assert_array_equal(at_rest.tools()["left"].displacement, 0.0)


def test_tools_press_plane_bodies_and_quadratic_cells() -> None:
    """A disc on a rectangle, of triangles, and the same by quadratic cells."""
    disc = RigidTool("disc", RigidSphere((1.0, 4.0), 3.0), at=(1.0, 1.0))
    motion = ToolMotion("disc", (0.0, None), None, (0.0, -5.0), 0.4)
    found = []
    for mesh in (
        rectangle((0, 0), (2, 1), (24, 12), "triangle"),
        quadratic(rectangle((0, 0), (2, 1), (16, 8))),
    ):
        pair = ContactPair(Surface("block", "y1"), disc, Coulomb(0.5))
        scene = Scene(
            {"block": Body(mesh, PlaneStrain(100.0, 0.3))}, [Support("block", "y0"), motion], contacts=[pair]
        )
        tool = solved(scene).tools()["disc"]
        np.testing.assert_allclose(tool.force[1], 5.0, rtol=1e-9)
        assert tool.moment == pytest.approx(-0.4, abs=1e-8)
        found.append([*tool.displacement, tool.rotation])
    np.testing.assert_allclose(found[0], found[1], rtol=0.05, atol=1e-3)


def test_a_tool_of_revolution_moves_along_the_axis() -> None:
    """Force, spring and prescribed motion on bodies of revolution, and what is no motion of these."""
    ball = RigidTool("ball", RigidSphere((0.0, 2.0), 2.0), at=(0.0, 2.0))
    body = Body(rectangle((0, -1), (1, 0), (12, 12)), SOFT, axisymmetric=True)

    def under(motion: ToolMotion, tool: RigidTool = ball) -> Scene:
        pair = ContactPair(Surface("block", "y1"), tool)
        return Scene({"block": body}, [Support("block", "y0"), motion], contacts=[pair])

    loaded = solved(under(ToolMotion("ball", force=(0, -30.0))))
    way = loaded.tools()["ball"].displacement
    moved = solved(under(ToolMotion("ball", (0.0, float(way[1])), 0.0)))
    for state in (loaded, moved):
        np.testing.assert_allclose(state.tools()["ball"].force, (0, 30.0), rtol=1e-7)
        assert state.balance().imbalance < 1e-9
    sprung = solved(under(ToolMotion("ball", force=(0, -30.0), stiffness=(0, 100.0)))).tools()["ball"]
    assert sprung.force[1] - 100.0 * sprung.displacement[1] == pytest.approx(30.0, rel=1e-7)
    with pytest.raises(InvalidInputError, match="can move along the axis alone, got force"):
        under(ToolMotion("ball", None, 0.1))
    with pytest.raises(
        InvalidInputError, match=r"point of tool 'off' must lie on the axis .* got \(1.0, 2.0\)"
    ):
        under(ToolMotion("off"), RigidTool("off", ball.shape, (1.0, 2.0)))


def test_files_have_the_bodies_and_not_what_carries_tools(tmp_path: Path) -> None:
    state = solved(pressed(ToolMotion("left", (0.0, 0.0, -0.05), STRAIGHT), friction=0.0))
    assert list(write_xdmf(state, tmp_path / "pressed.xdmf")) == ["block"]
    write_vtu(state, tmp_path, "pressed")
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".h5", ".vtm", ".vtu", ".xdmf"]
    assert list(state.to_pyvista().keys()) == ["block"]


def test_planes_of_symmetry_and_the_axis_hold_slip_across_them_under_forces() -> None:
    """A ball rubs on a quarter of a block, straight and turned by 30°, and on a body of revolution."""
    body = block((0, 0, -1), (1, 1, 0), (5, 5, 3))
    turn = np.array([[np.sqrt(0.75), -0.5, 0.0], [0.5, np.sqrt(0.75), 0.0], [0.0, 0.0, 1.0]])
    driven = ToolMotion("left", DOWN, STRAIGHT, (0, 0, -3.0))
    ball, found = RigidTool("left", RigidSphere((0, 0, 2.0), 2.0), at=(0, 0, 2.0)), []
    for mesh in (body, body.moved(body.points @ turn.T)):
        pair = ContactPair(Surface("block", "z1"), ball, Coulomb(0.3))
        sides = [Roller("block", side) for side in ("x0", "y0")]
        state = solved(Scene({"block": Body(mesh, SOFT)}, [BASE, *sides, driven], contacts=[pair]))
        np.testing.assert_allclose(state.tools()["left"].force[2], 3.0, rtol=1e-9)
        found.append(state)
    np.testing.assert_allclose(found[0].contact.normal_force, found[1].contact.normal_force, rtol=1e-6)
    assert found[0].contact.count(Status.SLIP) > 0
    disc = Body(rectangle((0, -1), (1, 0), (9, 7)), SOFT, axisymmetric=True)
    ball = RigidTool("ball", RigidSphere((0, 2), 2.0), at=(0, 2))
    pair = ContactPair(Surface("disc", "y1"), ball, Coulomb(0.3))
    held = Support("disc", "y0")
    pushed = solved(Scene({"disc": disc}, [held, ToolMotion("ball", force=(0, -30.0))], contacts=[pair]))
    way = pushed.tools()["ball"].displacement
    moved = solved(Scene({"disc": disc}, [held, ToolMotion("ball", tuple(way), 0.0)], contacts=[pair]))
    np.testing.assert_allclose(pushed.contact.force, moved.contact.force, rtol=1e-5, atol=1e-7)
    assert pushed.contact.count(Status.STICK) > 0


def test_a_cone_of_revolution_under_a_force_is_the_one_in_space() -> None:
    """On the axis, at its tip, slip would open the contact; in space a node lies beside it."""
    slope, found = np.radians(75), []
    flat = RigidPlane((0, 0), (np.cos(slope), -np.sin(slope)))
    disc = Body(rectangle((0, -1), (2, 0), (13, 5)), SOFT, axisymmetric=True)
    wedge = block((0.01, 0, -1), (2, np.radians(10), 0), (13, 1, 5))
    r, angle, z = wedge.points.T
    wedge = wedge.moved(np.column_stack([r * np.cos(angle), r * np.sin(angle), z]))
    cone = RigidTool("cone", Cone((0, 0, 0), (0, 0, 1), slope), at=(0, 0, 0))
    rollers = [Support("wedge", "z0"), Roller("wedge", "y0"), Roller("wedge", "y1")]
    for scene in (
        Scene(
            {"disc": disc},
            [Support("disc", "y0"), ToolMotion("cone", force=(0, -50.0))],
            contacts=[ContactPair(Surface("disc", "y1"), RigidTool("cone", flat, (0, 0)), Coulomb(0.2))],
        ),
        Scene(
            {"wedge": Body(wedge, SOFT)},
            [*rollers, ToolMotion("cone", DOWN, STRAIGHT, (0, 0, -50.0 / 36))],
            contacts=[ContactPair(Surface("wedge", "z1"), cone, Coulomb(0.2))],
        ),
    ):
        found.append(solved(scene).tools()["cone"].displacement[-1])
    assert found[0] == pytest.approx(found[1], rel=0.02)


def test_what_nothing_holds_is_named() -> None:
    with pytest.raises(
        InfeasibleError, match=r"body 'left' can move away under the load: translation \(0, 0, 1\)"
    ):
        solved(pressed(ToolMotion("left", DOWN, STRAIGHT, (0, 0, 3.0))))
    with pytest.raises(
        InfeasibleError, match=r"body 'left' can move away .* rotation \(0, 0, 1\) meets too little"
    ):
        solved(pressed(ToolMotion("left", DOWN, (0, 0, None), (0, 0, -3.0), (0, 0, 9.0))))
    free = solved(pressed(ToolMotion("left", force=(0, 0, -3.0)), friction=0.0))
    assert len(free.unheld) == 3
    np.testing.assert_allclose(free.tools()["left"].rotation, 0.0, atol=1e-12)


def rubber(*supports: ToolMotion, obstacle: RigidTool | MovingObstacle = LEFT) -> Scene:
    body = Body(block((-1, -1, -1), (1, 1, 0), (6, 6, 3)), NeoHooke(1000.0, 0.3))
    pair = ContactPair(Surface("block", "z1"), obstacle, Coulomb(0.3))
    return Scene({"block": body}, [BASE, *supports], contacts=[pair])


def test_a_tool_on_rubber_moves_and_turns_as_an_obstacle_that_moves() -> None:
    """Pressed, then dragged and turned by 0.4 rad: friction is carried along."""

    def path(time: float) -> tuple[np.ndarray, np.ndarray]:
        later, about = max(time - 1.0, 0.0), np.array(LEFT.at)
        turn = Rotation.from_rotvec((0.0, 0.4 * later, 0.0)).as_matrix()
        return turn, about - turn @ about + np.array([0.3 * later, 0.0, -0.2 * min(time, 1.0)])

    steps = [LoadStep("press", time=1.0), LoadStep("drag", time=2.0)]
    moving = ContactProblem(rubber(obstacle=MovingObstacle(LEFT.shape, path)), MPI.COMM_SELF)
    motions = ToolMotion("left", (0, 0, -0.2), STRAIGHT), ToolMotion("left", (0.3, 0, -0.2), (0, 0.4, 0))
    driven = ContactProblem(rubber(ToolMotion("left", STRAIGHT, STRAIGHT)), MPI.COMM_SELF)
    given = [
        LoadStep(step.name, supports=[BASE, motion], time=step.time)
        for step, motion in zip(steps, motions, strict=True)
    ]
    for one, other in zip(solve_steps(moving, steps), solve_steps(driven, given), strict=True):
        size = np.abs(one.contact.force).max()
        np.testing.assert_allclose(other.contact.force, one.contact.force, atol=1e-6 * size)
    tool = other.tools()["left"]
    assert abs(tool.force[0]) > 0.1 * tool.force[2]
    np.testing.assert_allclose(tool.force, -other.contact.force.sum(axis=0), atol=1e-9 * size)
    np.testing.assert_allclose(other.reactions()["left tool"].force, -tool.force, rtol=1e-9)
    assert other.balance().imbalance < 1e-7


def test_tools_need_materials_that_are_linear_or_for_large_deformations() -> None:
    yielding = rubber(ToolMotion("left", (0, 0, -0.1), STRAIGHT))
    metal = Body(yielding.deforming["block"].mesh, J2Plasticity(1000.0, 0.3, 5.0))
    with pytest.raises(InvalidInputError, match="RigidTool needs linear materials or large deformations"):
        solve_scene(Scene({"block": metal}, yielding.supports, contacts=yielding.contacts), MPI.COMM_SELF)


def test_effects_and_plan_name_tools() -> None:
    scene = pressed(ToolMotion("left", DOWN, STRAIGHT, (0, 0, -3.0)))
    assert [effect.reason for effect in scene.effects()][:3] == [
        "1 elastic body", "1 support", "1 tool moves as one piece",
    ]  # fmt: skip
    plan = scene.plan()
    assert plan.contacts[0].master == "left (RigidSphere)"
    assert plan.contacts[0].approach is not None
    assert list(scene.partition(3)) == ["block"]
    assert [pair.place for pair in scene.contacts] == ["block z1 on left"]
    still = pressed()
    assert still.supports[-1].in_words == "left tool as rigid: displacement (0, 0, 0), rotation (0, 0, 0)"


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (lambda: pressed(ToolMotion("lft", DOWN)), r"tool 'lft', .* of the scene have \['left'\]"),
        (lambda: pressed(*[ToolMotion("left", DOWN)] * 2), "'left' must have one ToolMotion, got"),
        (lambda: pressed(tools=(LEFT, RigidTool("left", PLATE.shape, (0, 0, 0)))), "two different"),
        (lambda: pressed(tools=(RigidTool("block", PLATE.shape, (0, 0, 0)),)), r"names, got \['block'\]"),
        (lambda: pressed(tools=(RigidTool("l", RigidSphere((0, 0), 1.0), (0, 0)),)), "'block', got 2 dim"),
        (lambda: RigidTool("l", LEFT, (0, 0, 0)), "must not move"),
        (lambda: RigidTool("l", MovingObstacle(PLATE.shape, lambda t: (None, (0, 0, t))), (0, 0, 0)), "not"),
        (lambda: RigidTool("l", PLATE.shape, (0, 0)), "a point of 3 finite coordinates, as its"),
        (lambda: pressed(ToolMotion("left", stiffness=(0, 1))), "need 3 stiffnesses"),
        (lambda: pressed(ToolMotion("left", stiffness=(0, 0, -1.0))), "3 around axes, ≥ 0, got"),
        (lambda: pressed(ToolMotion("left", (0, 0, 0), stiffness=(0, 0, 1.0))), "must act on free"),
        (lambda: pressed(ToolMotion("left", (0, 0, 0), force=(0, 0, 1.0))), "on tool 'left' must act on"),
        (lambda: pressed(ToolMotion("left", (0, 0))), "ToolMotion.displacement of tool 'left' must be 3"),
        (lambda: pressed(ToolMotion("left", moment=3.0)), "ToolMotion.moment of tool 'left' must be 3"),
    ],
)  # fmt: skip
def test_tools_that_cannot_be_are_refused(scene: object, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        scene()  # type: ignore[operator]


CASE = """
from mpi4py import MPI
from fenics_contact import box_partition, solve_scene
from tests.equilibrium.tooling import sprung
scene = sprung()
cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 2, 1))}
tools = solve_scene(scene, MPI.COMM_WORLD, partitions=cut, tolerance=1e-10).tools()
if MPI.COMM_WORLD.rank == 0:
    print(*[*tools["left"].displacement, *tools["left"].rotation, *tools["right"].displacement])
"""


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=[pytest.mark.slow, pytest.mark.claim])])
def test_tools_move_alike_on_any_number_of_ranks(mpirun: Callable[..., str], ranks: int) -> None:
    found = np.array(mpirun(CASE, ranks).split(), dtype=float)
    left, right = (solved(sprung()).tools()[name] for name in ("left", "right"))
    alone = np.array([*left.displacement, *np.atleast_1d(left.rotation), *right.displacement])
    np.testing.assert_allclose(found, alone, atol=1e-9 * np.abs(alone).max())


def hertz(size: int) -> tuple[Scene, float]:
    """A quarter of a half space under a rigid ball, by a force; and the peak."""
    young, ratio, radius = 1000.0, 0.3, 1000.0
    modulus = young / (1.0 - ratio**2)
    force = 4.0 * modulus / (3.0 * radius)  # contact radius 1
    mesh = mirrored(nested_box(1.25, 40.0, size, "hexahedron"))
    ball = RigidTool("ball", RigidSphere((0, 0, radius), radius), at=(0, 0, 0))
    guides = [Support("block", side, (0.0, None, None)) for side in ("x0", "x1")]
    guides += [Support("block", side, (None, 0.0, None)) for side in ("y0", "y1")]
    guides.append(Support("block", "z0", (None, None, 0.0)))
    bodies = {"block": Body(mesh, IsotropicElasticity(young, ratio))}
    pair = ContactPair(Surface("block", "z1"), ball)
    by_force = ToolMotion("ball", DOWN, STRAIGHT, (0, 0, -force / 4.0))
    return Scene(bodies, [*guides, by_force], contacts=[pair]), 1.5 * force / np.pi


@pytest.mark.slow
@pytest.mark.claim
def test_a_ball_under_a_force_has_the_pressure_of_hertz_to_a_percent() -> None:
    """And takes at most 2.7 times the products of the ball that is moved by as much."""
    loaded, peak = hertz(8)
    state = solve_scene(loaded, MPI.COMM_SELF)
    assert state.contact.pressure.max() == pytest.approx(peak, rel=0.01)
    way = ToolMotion("ball", tuple(map(float, state.tools()["ball"].displacement)), STRAIGHT)
    moved = Scene(loaded.deforming, [*loaded.supports[:-1], way], contacts=loaded.contacts)
    assert state.solution.products < 2.7 * solve_scene(moved, MPI.COMM_SELF).solution.products
