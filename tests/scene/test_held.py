"""A scene in which a body can move away is refused before anything is factored, with the motion's name."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    Scene,
    Status,
    Support,
    Surface,
    TotalForce,
    Traction,
    Tresca,
    solve_scene,
)
from fenics_contact._equilibrium.static_admissibility import check_held
from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.qp import FaceNewton
from tests.scenes import (
    FLOOR,
    SOFT,
    block_on_plane,
    cornered_block,
    guided,
    partitions,
    pressed_block,
    stack,
    two_blocks,
)
from tools.hard_cases.transform import in_units

DOWN, ALONG = -4.0, 2.0  # the load of the block on the plane, with its push of 1
NUMBERS = r"\(([^)]*)\)"


def check(scene: Scene) -> None:
    check_held(build_torn_system(scene, decompose(scene, partitions(scene), MPI.COMM_SELF)))


def refused(scene: Scene) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the body named in the refusal, its translation and its rotation."""
    with pytest.raises(InfeasibleError, match=r"every body must be held .* can move away under") as caught:
        check(scene)
    message = str(caught.value)
    body = re.search(r"body '(\w+)'", message)
    assert body is not None
    motion = []
    for kind in ("translation", "rotation"):
        part = re.search(kind + " " + NUMBERS, message)
        motion.append(np.array([float(x) for x in part[1].split(",")]) if part else np.zeros(3))
    return body[1], motion[0], motion[1]


def pulled(scene: Scene, body: str, force: tuple[float, float, float]) -> Scene:
    return replace(scene, loads=[TotalForce(body, "z1", force)])


def test_a_body_pulled_off_its_floor_is_named_with_the_way_it_goes() -> None:
    body, translation, rotation = refused(pulled(block_on_plane(Coulomb(0.5)), "block", (0.0, 0.0, 1.0)))
    assert body == "block"
    assert translation == pytest.approx([0, 0, 1], abs=1e-3)
    assert np.abs(rotation).max() < 0.1


@pytest.mark.parametrize("direction", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.6, -0.8)])
def test_a_body_pushed_harder_than_friction_holds_slides_where_it_is_pushed(direction) -> None:
    x, y = direction
    body, translation, _ = refused(pulled(block_on_plane(Coulomb(0.3)), "block", (0.31 * x, 0.31 * y, -1.0)))
    assert body == "block"
    assert translation[:2] / np.linalg.norm(translation[:2]) == pytest.approx(direction, abs=0.02)
    assert translation[2] == 0.0


@pytest.mark.parametrize(("slope", "friction"), [(30, 0.3), (30, 0.57), (60, 1.5), (5, 0.0)])
def test_a_block_that_slides_down_a_slope_is_told_to_move_along_it(slope: float, friction: float) -> None:
    """The motion normal to the cone of friction would be at 47 degrees on a slope of 30."""
    mesh = block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (4, 2, 2))
    axes = Rotation.from_euler("y", slope, degrees=True).as_matrix()
    scene = Scene(
        {"block": Body(mesh.moved(mesh.points @ axes.T), SOFT)},
        loads=[BodyForce("block", (0.0, 0.0, -1.0))],
        contacts=[ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), axes[:, 2]), Coulomb(friction))],
    )
    _, translation, rotation = refused(scene)
    assert translation / np.linalg.norm(translation) == pytest.approx(axes[:, 0], abs=0.01)
    assert not rotation.any()


def test_a_block_between_floor_and_wall_leaves_neither_where_it_slides_along_both() -> None:
    scene = cornered_block(Coulomb(0.1))
    _, translation, rotation = refused(pulled(scene, "block", (1.0, 1.0, -1.0)))
    assert translation.tolist() == [0.0, 1.0, 0.0]
    assert not rotation.any()


def test_words_tell_friction_that_is_too_weak_from_a_motion_without_any() -> None:
    for friction in (Coulomb(0.3), Tresca(0.15)):
        words = r"translation \(1, 0, 0\) meets too little friction\. Support .* or raise the friction coeff"
        with pytest.raises(InfeasibleError, match=words):
            check(pulled(block_on_plane(friction), "block", (0.31, 0.0, -1.0)))
    for scene, force, advice in (
        (block_on_plane(None), (0.3, 0.0, -1.0), "Support it, .*, or give its contact friction"),
        (block_on_plane(Coulomb(0.3)), (0.31, 0.0, 1.0), "Support it, or let it .*"),
    ):
        with pytest.raises(InfeasibleError, match=rf"translation .* meets no resistance\. {advice}$"):
            check(pulled(scene, "block", force))


def test_what_tips_is_told_about_which_edge_and_not_to_raise_its_friction() -> None:
    place = r"the axis through \(2, 0\.5, 0\.02\) along \(0, 1, 0\), pressed by block z0 on rigid plane"
    words = rf"resistance\. It turns about {place}, and no friction would stop that: [^;]* of the load$"
    for friction in (Coulomb(5.0), Coulomb(1.2)):
        with pytest.raises(InfeasibleError, match=words):
            check(pulled(block_on_plane(friction), "block", (1.1, 0.0, -1.0)))
    slab = rectangle((2.0, 0.0), (6.0, 1.0), (4, 1))  # a metre of it lies on the bed
    bodies = {"bed": rectangle((0.0, -1.0), (3.0, 0.0), (3, 1)), "slab": slab}
    scene = Scene(
        {name: Body(mesh, PlaneStrain(100.0, 0.3)) for name, mesh in bodies.items()},
        [Support("bed", "y0")],
        [BodyForce("slab", (0.0, -1.0))],
        [ContactPair(Surface("slab", "y0"), Surface("bed", "y1"), Coulomb(0.5))],
    )
    with pytest.raises(InfeasibleError, match=r"'slab' .* about \(3, 0\), pressed by slab y0 on bed y1, and"):
        check(scene)


@pytest.mark.parametrize("friction", [Coulomb(0.3), Tresca(0.15)])
def test_friction_holds_just_as_much_as_it_can(friction: Coulomb | Tresca) -> None:
    limit = 0.3  # of a body pressed with 1: by Coulomb's law, and by Tresca's on an area just above 2
    scene = block_on_plane(friction)
    check(pulled(scene, "block", (0.998 * limit, 0.0, -1.0)))
    refused(pulled(scene, "block", (1.002 * limit, 0.0, -1.0)))


@pytest.mark.parametrize("friction", [Coulomb(0.3), Tresca(0.15)])
@pytest.mark.parametrize("part", [0.9999, 0.99999, 1.00001, 1.0001])
def test_the_limit_of_friction_is_sharp(friction: Coulomb | Tresca, part: float) -> None:
    flat = block_on_plane(friction)
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3))
    flat = replace(flat, bodies={"block": replace(flat.bodies["block"], mesh=mesh)})
    scene = pulled(flat, "block", (0.3 * part, 0.0, -1.0))
    if part < 1:
        check(scene)
    else:
        assert refused(scene)[0] == "block"


@pytest.mark.parametrize("friction", [Coulomb(0.3), Tresca(0.15)])
@pytest.mark.parametrize("force", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_the_limit_of_friction_does_not_depend_on_the_units(
    friction: Coulomb | Tresca, force: float, length: float
) -> None:
    scene = block_on_plane(friction)
    check(in_units(pulled(scene, "block", (0.998 * 0.3, 0.0, -1.0)), length, force))
    refused(in_units(pulled(scene, "block", (1.002 * 0.3, 0.0, -1.0)), length, force))


def test_a_load_that_is_nothing_beside_the_bound_of_friction_is_held() -> None:
    """Loads that are taken off by tenths leave 1e-16 of what they were."""
    lower, upper = rectangle((0.0, 0.0), (2.0, 1.0), (3, 1)), rectangle((0.0, 1.0), (2.0, 1.8), (2, 1))
    bodies = {"low": Body(lower, PlaneStrain(1.0, 0.3)), "up": Body(upper, PlaneStrain(1.0, 0.3))}
    pair = ContactPair(Surface("up", "y0"), Surface("low", "y1"), Tresca(0.05))
    load = 0.02 * 2.0**-53  # of 1 − Σ 0.1, which Python sums exactly from 3.12 on
    scene = Scene(bodies, [Support("low", "y0")], [TotalForce("up", "y1", (0.0, -load))], contacts=[pair])
    state = solve_scene(scene, MPI.COMM_SELF)
    assert 0.0 < load < 1e-17
    assert state.contact.force[:, 1].sum() == pytest.approx(load, rel=1e-9)


def test_a_body_at_the_very_limit_of_friction_is_refused_as_any_slide_is_an_answer() -> None:
    scene = pulled(block_on_plane(Coulomb(0.3)), "block", (0.3, 0.0, -1.0))
    with pytest.raises(InfeasibleError, match="'block' is held only just: the load uses up all friction"):
        check(scene)


def test_the_body_that_is_pushed_is_named_and_not_those_it_takes_along() -> None:
    scene = stack(Coulomb(0.5), Coulomb(0.3))
    loads = [TotalForce("upper", "z1", (0.0, 0.0, -1.0)), TotalForce("lower", "x0", (0.4, 0.0, 0.0))]
    assert refused(replace(scene, loads=loads))[0] == "lower"


def test_a_body_without_friction_slides_at_the_slightest_push() -> None:
    check(pulled(block_on_plane(None), "block", (0.0, 0.0, -1.0)))
    body, translation, _ = refused(pulled(block_on_plane(None), "block", (0.001, 0.0, -1.0)))
    assert body == "block"
    assert translation == pytest.approx([1, 0, 0], abs=1e-2)


def test_a_body_tips_when_the_push_passes_over_its_edge() -> None:
    scene = block_on_plane(Coulomb(5.0))
    limit = 1.0 / 0.98  # of a block 2 long, with its lower edge 0.02 above the floor and 0.98 below the push
    check(pulled(scene, "block", (0.998 * limit, 0.0, -1.0)))
    body, translation, rotation = refused(pulled(scene, "block", (1.002 * limit, 0.0, -1.0)))
    assert body == "block"
    assert rotation[1] > 0.3  # about +y: the top goes along +x
    assert translation[2] > 0.1  # and the middle rises


def test_of_two_bodies_the_one_that_is_not_held_is_named() -> None:
    check(two_blocks(Coulomb(0.4)))
    assert refused(two_blocks(Coulomb(0.2)))[0] == "upper"
    assert refused(pulled(two_blocks(Coulomb(0.4)), "upper", (0.0, 0.0, 0.1)))[0] == "upper"


def test_the_load_works_along_the_motion_of_a_whole_stack() -> None:
    check(stack(Coulomb(0.4), Coulomb(0.4)))
    _, translation, _ = refused(stack(Coulomb(2.0), Coulomb(0.2)))
    assert translation[0] > 0.5  # the push is along +x, and a little along +y
    assert translation[1] > 0


def test_supports_hold_what_contact_does_not() -> None:
    free = pulled(block_on_plane(None), "block", (0.5, 0.2, -1.0))
    refused(free)
    check(guided(free, "block"))
    lifted = pulled(guided(block_on_plane(None), "block"), "block", (0.0, 0.0, 1.0))
    assert refused(lifted)[1] == pytest.approx([0, 0, 1], abs=1e-2)
    check(replace(lifted, supports=[*lifted.supports, Support("block", "z1", (None, None, 0.0))]))


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("thickness", [1e-2, 1e-3, 1e-4])
def test_a_thin_plate_clamped_at_one_edge_is_held_in_all_units(thickness: float, unit: float) -> None:
    mesh = block((0.0, 0.0, 0.0), (8.0, 4.0, thickness), (8, 4, 1))
    plate = Body(mesh.moved(unit * mesh.points), SOFT)
    pair = ContactPair(Surface("block", "z0"), FLOOR, None)
    scene = Scene({"block": plate}, [Support("block", "x0")], contacts=[pair])
    check(pulled(scene, "block", (0.0, 0.0, 1.0)))
    hinged = replace(scene, supports=[Support("block", "x0", (0.0, 0.0, None))])
    assert refused(pulled(hinged, "block", (0.0, 0.0, 1.0)))[0] == "block"


def test_a_thin_plate_lifted_at_its_clamped_edge_is_solved() -> None:
    """Its clamp must bear thousands of times the load: levers are as long as the plate, arms as short."""
    mesh = block((0.0, 0.0, 0.01), (8.0, 4.0, 0.011), (8, 4, 1))
    pair = ContactPair(Surface("block", "z0"), FLOOR, None)
    scene = Scene(
        {"block": Body(mesh, IsotropicElasticity(1e9, 0.3))}, [Support("block", "x0")], contacts=[pair]
    )
    scene = pulled(scene, "block", (0.0, 0.0, 1e-3))
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions=partitions(scene, (1, 1, 1)), solver=FaceNewton(tolerance=1e-6)
    )
    assert state.contact.count(Status.OPEN) == state.contact.points.count
    assert state.gather_displacement("block")[:, 2].max() > 0.0


def test_a_scene_that_is_moved_without_any_load_needs_no_holding() -> None:
    check(pressed_block(None))


def test_a_body_that_is_just_held_is_solved() -> None:
    limit = np.hypot(1.0, 0.3) / 2.0  # push over weight
    scene = block_on_plane(Coulomb(1.0002 * limit))
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-6)
    assert state.contact.count(Status.STICK) == 0
    assert state.contact.count(Status.SLIP) > 0
    friction = np.linalg.norm(state.contact.force[:, :2].sum(axis=0))
    assert friction == pytest.approx(limit * state.contact.normal_force.sum(), rel=1e-5)


def test_solving_refuses_what_is_not_held() -> None:
    scene = block_on_plane(Coulomb(0.3))
    with pytest.raises(InfeasibleError, match="body 'block' can move away"):
        solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene))


@pytest.mark.parametrize("scale", [1e-5, 1e-6, 1e-7])
def test_a_brick_that_rolls_far_under_next_to_no_load_is_not_given_up(scale: float) -> None:
    """On the way the active set loses all contacts for some steps; a rescue finds them again."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3))
    x, _, z = mesh.points.T
    crowned = mesh.moved(mesh.points + np.outer(0.02 * (x - 1.0) ** 2 * (1.0 - z), (0.0, 0.0, 1.0)))
    scene = Scene(
        {"brick": Body(crowned, SOFT)},
        loads=[Traction("brick", "z1", (scale, 0.3 * scale, -2.0 * scale))],
        contacts=[ContactPair(Surface("brick", "z0"), FLOOR, Coulomb(0.7))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9)
    np.testing.assert_allclose(
        state.contact.force.sum(axis=0), np.array([-2.0, -0.6, 4.0]) * scale, rtol=1e-6
    )


def test_friction_of_a_gap_that_supports_keep_open_holds_nothing() -> None:
    """As rigid bodies they could meet; the top, which moves by a part of the gap, does not let them."""
    mesh = block((0.1, 0.0, 0.3), (3.0, 1.8, 1.2), (3, 3, 2))
    scene = Scene(
        {"block": Body(mesh, SOFT)},
        [Support("block", "z1", (None, None, -0.01))],
        [TotalForce("block", "z1", (0.3, 0.1, -1.0))],
        [ContactPair(Surface("block", "z0"), FLOOR, Coulomb(2.0))],
    )
    with pytest.raises(InfeasibleError, match=r"all contacts stay open, and \d+ % of the load drive motions"):
        solve_scene(scene, MPI.COMM_SELF)


@pytest.mark.parametrize("parts", [1, 3])
def test_displacements_are_right_where_loads_go_straight_into_supports(parts: int) -> None:
    """What such loads would do to the pieces is 10⁴ times what happens, and says nothing of an error."""
    mesh = block((0.0, 0.0, 0.0), (1.1, 1.3, 0.7), (3, 3, 5))
    lift = 1e-4

    def lifted(load: float) -> np.ndarray:
        scene = Scene(
            {"block": Body(mesh, SOFT)},
            [Support("block", "z0"), Support("block", "z1", (0.0, 0.0, lift))],
            [TotalForce("block", "z1", (0.0, 0.0, -load))],
            [ContactPair(Surface("block", "x1"), RigidPlane((1.2, 0.0, 0.0), (-1.0, 0.0, 0.0)))],
        )
        cut = {"block": graph_partition(mesh, parts)}
        return solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-6).gather_displacement("block")

    np.testing.assert_allclose(lifted(1e4), lifted(0.0), atol=1e-5 * lift)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_friction_between_surfaces_that_supports_hold_apart_holds_nothing(discretisation: str) -> None:
    """Both are guided on the face on which they touch: no force presses one against the other."""
    left = block((-1.1, 0.0, 0.0), (0.0, 0.9, 0.7), (3, 3, 3))
    right = block((0.0, 0.0, 0.0), (1.3, 0.9, 0.7), (3, 3, 3))
    faces = (("left", "x1"), ("right", "x0"))
    scene = Scene(
        {"left": Body(left, SOFT), "right": Body(right, SOFT)},
        [Support("left", "x0"), *(Support(*face, (0.0, None, None)) for face in faces)],
        [TotalForce("right", "x1", (-1.0, 0.0, -0.01))],
        [ContactPair(Surface("right", "x0"), Surface("left", "x1"), Coulomb(1.4), discretisation)],
    )
    with pytest.raises(InfeasibleError, match="body 'right' can move away"):
        solve_scene(scene, MPI.COMM_SELF)
    free = replace(scene, supports=[scene.supports[0]])
    state = solve_scene(free, MPI.COMM_SELF)
    np.testing.assert_allclose(state.contact.force.sum(axis=0), [1.0, 0.0, 0.01], atol=1e-3)


def test_friction_that_nothing_presses_bears_nothing() -> None:
    """The face that rubs is guided, and the load passes it by; which is found first, is up to rounding."""
    left = block((-1.1, 0.0, 0.0), (0.0, 0.9, 0.7), (3, 3, 3))
    right = block((0.0, 0.0, 0.0), (1.3, 0.9, 0.7), (3, 3, 3))
    scene = Scene(
        {"left": Body(left, SOFT), "right": Body(right, SOFT)},
        [Support("left", "x0"), Support("right", "x0", (0.0, None, None))],
        [TotalForce("right", "x1", (0.0, 0.0, -1.0))],
        [ContactPair(Surface("left", "x1"), Surface("right", "x0"), Coulomb(0.3))],
    )
    nothing = "friction (carries only 0 % of the load|needs surfaces that are pressed together)"
    with pytest.raises(InfeasibleError, match=nothing):
        solve_scene(scene, MPI.COMM_SELF)
    moved = {
        name: replace(body, mesh=body.mesh.moved(body.mesh.points + np.array([0.0, 0.37, 0.0])))
        for name, body in scene.bodies.items()
    }
    with pytest.raises(InfeasibleError, match=nothing):  # not 1e-29 %
        solve_scene(replace(scene, bodies=moved), MPI.COMM_SELF)
    free = replace(scene, supports=[scene.supports[0]], loads=[TotalForce("right", "x1", (-4.0, 0.0, -1.0))])
    state = solve_scene(free, MPI.COMM_SELF)
    np.testing.assert_allclose(state.contact.force.sum(axis=0), [-4.0, 0.0, -1.0], atol=1e-2)


def test_friction_that_is_pressed_too_little_is_refused_with_what_it_bears() -> None:
    """The load is ten times what friction bears where the guided face is pushed in."""
    left = block((-1.1, 0.0, 0.0), (0.0, 0.9, 0.7), (3, 3, 3))
    right = block((0.0, 0.0, 0.0), (1.3, 0.9, 0.7), (3, 3, 3))
    pushed = Scene(
        {"left": Body(left, SOFT), "right": Body(right, SOFT)},
        [Support("left", "x0"), Support("right", "x0", (-1e-3, None, None))],
        [],
        [ContactPair(Surface("left", "x1"), Surface("right", "x0"), Coulomb(0.3))],
    )
    press = abs(float(solve_scene(pushed, MPI.COMM_SELF).contact.force[:, 0].sum()))
    loads = {share: TotalForce("right", "x1", (0.0, 0.0, -share * 0.3 * press)) for share in (0.3, 10.0)}
    state = solve_scene(replace(pushed, loads=[loads[0.3]]), MPI.COMM_SELF)
    assert state.contact.force[:, 2].sum() == pytest.approx(-0.09 * press, rel=1e-4)
    words = r"makes slide 'right' by translation \(0, 0, -1\), and friction carries only (9\.9|10)"
    with pytest.raises(InfeasibleError, match=words):
        solve_scene(replace(pushed, loads=[loads[10.0]]), MPI.COMM_SELF)
    without = FaceNewton(doubts=False, max_products=300)
    with pytest.raises(ConvergenceError, match="needs residuals below"):
        solve_scene(replace(pushed, loads=[loads[10.0]]), MPI.COMM_SELF, solver=without)
    later = ContactProblem(pushed, MPI.COMM_SELF)
    later.solve(replace(pushed, loads=[loads[0.3]]))
    with pytest.raises(InfeasibleError, match=words):
        later.solve(replace(pushed, loads=[loads[10.0]]))
