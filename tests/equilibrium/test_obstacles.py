"""Rigid obstacles, beds and press fits."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DistanceObstacle,
    LoadStep,
    MovingObstacle,
    Pressure,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TotalForce,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, hemisphere, rectangle
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, Material, PlaneStrain
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.qp import FaceNewton
from fenics_contact.shapes import Triangulation
from tests.equilibrium.bedded import FORCE, Bedded, pushed
from tests.equilibrium.checks import assert_solved
from tests.equilibrium.press_fits import (
    INTERFERENCE,
    SEAT,
    Disc,
    clamped_pressure,
    lame,
    mean_pressure,
    press_fit,
    thick_press_fit,
)
from tests.scenes import RigidObstacle
from tests.shapes.bodies import ball

RUBBER = IsotropicElasticity(100.0, 0.3)
TOLERANCE = 1e-9
BUMP = 3.0
#: Obstacles that touch the block from below at (1, 0.5, 0), in the plane at (1, 0).
BELOW: dict[str, RigidObstacle] = {
    "ball": RigidSphere((1.0, 0.5, -BUMP), BUMP),
    "bar": RigidCylinder((1.0, 0.5, -BUMP), (0.0, 1.0, 0.0), BUMP),
    "plane": RigidPlane((1.0, 0.5, 0.0), (0.0, 0.0, 1.0)),
    "disc": RigidSphere((1.0, -BUMP), BUMP),
    "line": RigidPlane((1.0, 0.0), (0.0, 1.0)),
}


def pressed(obstacle: RigidObstacle, dim: int, push: float = 0.02) -> State:
    """Press a block by a twentieth of its height and drag it along x."""
    if dim == 2:
        mesh, top, law = rectangle((0, 0), (2, 1), (12, 6)), "y1", PlaneStrain(100.0, 0.3)
        body, way, base = Body(mesh, law), (push, -0.05), Surface("block", "y0")
    else:
        mesh, top = block((0, 0, 0), (2, 1, 1), (8, 4, 3)), "z1"
        body, way, base = Body(mesh, RUBBER), (push, 0.1 * push, -0.05), Surface("block", "z0")
    scene = Scene(
        {"block": body}, [Support("block", top, way)], contacts=[ContactPair(base, obstacle, Coulomb(0.3))]
    )
    return solved(scene, (2, 1, 1)[:dim])


def solved(scene: Scene, boxes: tuple[int, ...]) -> State:
    cut = {name: box_partition(body.mesh, boxes) for name, body in scene.bodies.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE))


@pytest.mark.parametrize("with_gradient", [True, False])
@pytest.mark.parametrize("name", BELOW)
def test_a_distance_function_holds_up_a_block_as_the_shape_itself_does(
    name: str, with_gradient: bool
) -> None:
    shape, dim = BELOW[name], 2 if name in ("disc", "line") else 3
    given = pressed(shape, dim)
    other = pressed(DistanceObstacle(shape.distance, shape.normals if with_gradient else None), dim)
    assert_solved(given, TOLERANCE)
    contact = given.contact
    assert contact.count(Status.STICK) > 0
    assert contact.count(Status.SLIP) > 0
    assert contact.count(Status.OPEN) > 0 or name in ("plane", "line")
    np.testing.assert_array_equal(other.contact.status, contact.status)
    size = np.abs(contact.force).max()
    np.testing.assert_allclose(other.contact.force, contact.force, atol=1e-6 * size)
    u = given.gather_displacement("block")
    np.testing.assert_allclose(other.gather_displacement("block"), u, atol=1e-7 * np.abs(u).max())


def test_a_tool_of_triangles_presses_as_the_ball_that_it_approximates() -> None:
    """Its facets miss the ball by their height over the indentation, and so does the force."""
    true, errors = pressed(BELOW["ball"], 3), []
    size = np.linalg.norm(true.contact.force.sum(axis=0))
    for count in (2000, 8000):
        points, triangles = ball(count, BUMP)
        state = pressed(Triangulation(points + np.array([1.0, 0.5, -BUMP]), triangles), 3)
        assert_solved(state, TOLERANCE)
        errors.append(np.linalg.norm((state.contact.force - true.contact.force).sum(axis=0)) / size)
        deep = np.abs(state.contact.points.gap - true.contact.points.gap).max()
        # Middle of an equilateral facet: a third of its squared edge over twice the radius.
        assert deep < 1.5 * (4.0 * np.pi * BUMP**2 / count) * 2.0 / np.sqrt(3.0) / (6.0 * BUMP)
    assert errors[1] < 0.4 * errors[0] < 0.04


@pytest.mark.parametrize("name", ["ball", "bar", "disc"])
def test_nodes_lie_outside_of_the_round_obstacle_after_pressing(name: str) -> None:
    """Gaps are those of the tangent planes: nodes that slide leave them by the square of their slip only."""
    shape, dim = BELOW[name], 2 if name == "disc" else 3
    state = pressed(shape, dim)
    slaves = state.contact.points.slave
    moved = state.scene.bodies["block"].mesh.points[slaves] + state.gather_displacement("block")[slaves]
    slip = np.linalg.norm(state.gather_displacement("block")[slaves], axis=1)
    assert (shape.distance(moved) > -1e-9).all()
    np.testing.assert_allclose(shape.distance(moved), state.contact.gap, atol=slip.max() ** 2 / BUMP)
    closed = state.contact.normal_force > 0
    assert 3 < closed.sum() < len(closed)


def test_a_long_block_on_a_bar_is_a_plane_block_on_a_disc() -> None:
    """Walls keep the ends from moving along the bar: plane strain, force by force."""
    depth = 0.7
    mesh = block((0, 0, 0), (2, depth, 1), (12, 2, 6))
    walls = [Support("block", side, (None, 0.0, None)) for side in ("y0", "y1")]
    top = Support("block", "z1", (0.02, 0.0, -0.05))
    pair = ContactPair(Surface("block", "z0"), BELOW["bar"], Coulomb(0.3))
    space = solved(Scene({"block": Body(mesh, RUBBER)}, [*walls, top], contacts=[pair]), (2, 1, 1))
    plane = pressed(BELOW["disc"], 2)
    flat = plane.scene.bodies["block"].mesh
    forces = np.zeros((flat.n_nodes, 3))
    place = np.rint(12 * mesh.points[space.contact.points.slave, 0] / 2).astype(int)
    along = np.rint(12 * flat.points[plane.contact.points.slave, 0] / 2).astype(int)
    np.add.at(forces, place, space.contact.force)
    size = np.abs(plane.contact.force).max()
    np.testing.assert_allclose(
        forces[along][:, [0, 2]], depth * plane.contact.force, atol=1e-6 * depth * size
    )
    assert plane.contact.count(Status.SLIP) > 0
    assert plane.contact.count(Status.STICK) > 0
    sides = mesh.points[:, 1] == 0.0
    order = np.lexsort(mesh.points[sides][:, [2, 0]].T), np.lexsort(flat.points[:, [1, 0]].T)
    u, v = space.gather_displacement("block")[sides][order[0]], plane.gather_displacement("block")[order[1]]
    np.testing.assert_allclose(u[:, [0, 2]], v, atol=1e-7 * np.abs(v).max())


def ball_on(obstacle: RigidObstacle) -> Scene:
    """The lower half of a ball of radius 1, pressed down and aside on an obstacle with little friction."""
    load = TotalForce("ball", "top", (0.4, 0.2, -1.0))
    pair = ContactPair(Surface("ball", "contact"), obstacle, Coulomb(0.1))
    return Scene({"ball": Body(hemisphere(1.0, 4, symmetry="", grading=0.0), RUBBER)}, [], [load], [pair])


def test_a_socket_holds_a_ball_that_rolls_off_a_floor() -> None:
    radius = 1.02
    scene = ball_on(RigidSphere((0.0, 0.0, radius), radius, hollow=True))
    cut = {"ball": bisection_partition(scene.bodies["ball"].mesh, 4)}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-8))
    contact = state.contact
    np.testing.assert_allclose(contact.force.sum(axis=0), (-0.4, -0.2, 1.0), atol=1e-6)
    closed = contact.normal_force > 1e-6
    assert 3 < closed.sum() < len(closed)
    lean = contact.normal_force @ contact.points.normal
    assert lean[0] / lean[2] == pytest.approx(-0.4, rel=0.15), "walls, not friction, bear the push"
    floor = replace(scene, contacts=ball_on(BELOW["plane"]).contacts)
    with pytest.raises(InfeasibleError, match="body 'ball' can move away under the load"):
        solve_scene(floor, MPI.COMM_SELF, partitions=cut)


@pytest.mark.parametrize("material", [RUBBER, J2Plasticity(100.0, 0.3, 1.0)], ids=["linear", "metal"])
def test_with_small_displacements_an_obstacle_must_not_move(material: Material) -> None:
    body = Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), material)

    def pressing(depth: float) -> ContactProblem:
        floor = MovingObstacle(RigidPlane((0, 0, 0), (0, 0, 1)), lambda time: (None, (0, 0, depth * time)))
        pair = ContactPair(Surface("block", "z0"), floor)
        return ContactProblem(
            Scene({"block": body}, [Support("block", "z1")], contacts=[pair]), MPI.COMM_SELF
        )

    with pytest.raises(InvalidInputError, match=r"has by time 0\.5: move the bodies against"):
        pressing(0.1).solve(step=LoadStep("push", time=0.5))
    assert pressing(0.1).solve(step=LoadStep("push", time=0.0)).contact.count(Status.OPEN) == 9
    assert pressing(0.0).solve(step=LoadStep("push", time=0.5)).contact.count(Status.OPEN) == 9


# Bodies whose material resists every motion, as on an elastic bed: no kernel, no coarse space.
@pytest.mark.parametrize("on_floor", [True, False])
@pytest.mark.parametrize("parts", [(1, 1, 1), (1, 1, 3)])
def test_a_bed_balances_a_load_that_nothing_else_resists(parts: tuple[int, int, int], on_floor: bool) -> None:
    state = pushed(Bedded(1e3, 0.3), parts, on_floor=on_floor)
    assert state.dual.problem.coarse.m == 0
    subdomains = state.torn.subdomains
    forces = [
        part.stiffness @ u
        for part, u in zip(subdomains, np.split(state.torn_displacement, len(subdomains)), strict=True)
    ]
    reaction = np.concatenate(forces).reshape(-1, 3).sum(axis=0)  # strains have no resultant
    np.testing.assert_allclose(reaction, np.add(FORCE, state.contact.force.sum(axis=0)), atol=1e-6)
    assert reaction[0] == pytest.approx(FORCE[0])
    pressed = state.contact.normal_force.sum()
    assert 100.0 < pressed < 3200.0 if on_floor else pressed == 0.0


ON_RANKS = """
    from mpi4py import MPI
    from tests.equilibrium.bedded import Bedded, pushed

    state = pushed(Bedded(1e3, 0.3), (1, 1, 3))
    lowest = float(state.gather_displacement("block").min())
    if MPI.COMM_WORLD.rank == 0:
        print(lowest)
"""


def test_a_bed_is_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    alone = float(pushed(Bedded(1e3, 0.3), (1, 1, 3)).gather_displacement("block").min())
    assert alone < -0.1
    assert float(mpirun(ON_RANKS, 2)) == pytest.approx(alone, rel=1e-8)


def test_a_bed_that_acts_upwards_alone_does_not_hold_sideways() -> None:
    with pytest.raises(InfeasibleError, match=r"translation \(1, 0, 0\) meets no resistance"):
        pushed(Bedded(1e3, 0.3, sideways=False), (1, 1, 1))


# Press fits with a given or a declared interference have Lamé's pressure, whatever the number of facets.

#: Cells around, cells through each ring, and the largest error of the mean pressure.
MESHES = [(24, 8, 0.01), (96, 16, 0.002), (400, 24, 0.001)]
DISCS: list[Disc] = ["node", "mortar"]


def solved_fit(scene: Scene) -> State:
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)


def error(state: State, **where: float) -> float:
    return abs(mean_pressure(state, **where) / lame() - 1)


@pytest.mark.parametrize("disc", DISCS)
@pytest.mark.parametrize(("around", "through", "bound"), MESHES)
def test_a_given_interference_has_lames_pressure(around: int, through: int, bound: float, disc: Disc) -> None:
    state = solved_fit(press_fit(around, through, discretisation=disc, interference=INTERFERENCE))
    np.testing.assert_array_equal(state.contact.points.gap, -INTERFERENCE)
    assert error(state) < bound
    assert np.ptp(state.contact.pressure) < 1e-4 * lame()


@pytest.mark.parametrize("disc", DISCS)
@pytest.mark.parametrize(("around", "through", "bound"), MESHES)
def test_meshes_that_do_not_match_have_it_too(around: int, through: int, bound: float, disc: Disc) -> None:
    for measured in (False, True):
        given: Any = {"interference": "measured", "overlap": INTERFERENCE}
        given = given if measured else {"interference": INTERFERENCE}
        scene = press_fit(around, through, outside=around * 5 // 4, discretisation=disc, **given)
        state = solved_fit(scene)
        assert error(state) < bound
        assert np.ptp(state.contact.pressure) < (0.004 if disc == "mortar" else 0.15) * lame()


def test_surfaces_reconstructed_from_96_nodes_have_it_too() -> None:
    given: Any = {"interference": "measured", "overlap": INTERFERENCE, "shapes": False}
    assert error(solved_fit(press_fit(96, 16, outside=120, **given))) < 0.002


def test_quadratic_cells_need_few_facets() -> None:
    scene = press_fit(24, 4, interference=INTERFERENCE)
    bodies = {name: Body(quadratic(body.mesh), body.material) for name, body in scene.bodies.items()}
    assert error(solved_fit(replace(scene, bodies=bodies))) < 0.0005


@pytest.mark.parametrize("disc", DISCS)
def test_a_quarter_between_planes_of_symmetry_has_it_too(disc: Disc) -> None:
    state = solved_fit(press_fit(96, 16, part=0.25, discretisation=disc, interference=INTERFERENCE))
    assert error(state, part=0.25) < 0.002


@pytest.mark.parametrize("disc", DISCS)
def test_a_thin_ring_in_space_has_it_too(disc: Disc) -> None:
    state = solved_fit(thick_press_fit(48, 12, 2.0, discretisation=disc, interference=INTERFERENCE))
    assert error(state, part=0.25, thickness=2.0) < 0.003


def test_the_pressure_follows_an_interference_that_varies() -> None:
    def waves(points: np.ndarray) -> np.ndarray:
        angle = np.arctan2(points[:, 1], points[:, 0])
        return np.asarray(INTERFERENCE * (1.0 + 0.2 * np.cos(4 * angle)))

    state = solved_fit(press_fit(96, 16, discretisation="mortar", interference=waves))
    contact = state.contact
    even = solved_fit(press_fit(96, 16, discretisation="mortar", interference=INTERFERENCE)).contact
    assert error(state) < 0.002
    point = state.scene.bodies["hub"].mesh.points[contact.points.slave - contact.points.slave.min()]
    more, less = np.abs(point).max(axis=1) > 0.999 * SEAT, np.abs(point[:, 0] - point[:, 1]) < 1e-9
    assert more.sum() == 4
    assert (contact.pressure[more] > 1.2 * even.pressure[more]).all()
    assert (contact.pressure[less] < 0.8 * even.pressure[less]).all()


def test_a_clearance_takes_what_closes_it() -> None:
    scene = replace(press_fit(96, 16, part=0.25, gap=0.01), loads=[Pressure("hub", "outer", 20.0)])
    open_, alone = solved_fit(scene), solved_fit(replace(scene, loads=[Pressure("hub", "outer", 40.0)]))
    assert open_.contact.normal_force.max() == 0.0
    closing = 0.01 - open_.contact.gap
    assert np.ptp(closing) < 1e-6
    # The hub alone comes closer in proportion; what is left of twice the pressure presses on the shaft.
    touched = 20.0 * 0.01 / closing.mean()
    assert 20.0 < touched < 40.0
    share = mean_pressure(alone) / (40.0 - touched)
    more = solved_fit(replace(scene, loads=[Pressure("hub", "outer", 80.0)]))
    assert mean_pressure(more) / (80.0 - touched) == pytest.approx(share, rel=1e-3)


def test_an_interference_stays_over_load_steps() -> None:
    scene = press_fit(24, 8, interference=INTERFERENCE)
    steps = [LoadStep(f"{p:g}", loads=[Pressure("hub", "outer", p)]) for p in (0.0, 50.0, 0.0)]
    first, pressed, last = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), steps)
    assert mean_pressure(pressed) > mean_pressure(first) + 20.0
    assert mean_pressure(last) == pytest.approx(mean_pressure(first), rel=1e-6)


@pytest.mark.parametrize("around", [96, 400])
def test_overlap_without_a_word_is_refused_or_told(around: int, caplog: pytest.LogCaptureFixture) -> None:
    scene = press_fit(around, 8, overlap=INTERFERENCE)
    if around == 400:
        match = r"up to 0\.05 inside .*give the pair interference='measured'"
        with pytest.raises(InvalidInputError, match=match):
            solved_fit(scene)
        return
    with caplog.at_level(logging.WARNING):
        silent = solved_fit(scene)
    (told,) = [record.getMessage() for record in caplog.records]
    assert "surfaces of hub inner on shaft outer overlap by up to 0.05 before they are loaded" in told
    declared = solved_fit(press_fit(around, 8, overlap=INTERFERENCE, interference="measured"))
    np.testing.assert_array_equal(silent.contact.normal_force, declared.contact.normal_force)


@pytest.mark.parametrize("friction", [None, Coulomb(0.2)])
@pytest.mark.parametrize("disc", DISCS)
def test_an_interference_alone_loads_bodies_that_are_held(disc: Disc, friction: Coulomb | None) -> None:
    scene = press_fit(96, 16, discretisation=disc, interference=INTERFERENCE, friction=friction)
    held = [Support("shaft", "inner", (0.0, 0.0)), Support("hub", "outer", (0.0, 0.0))]
    for tolerance in (1e-6, 1e-10):
        state = solve_scene(replace(scene, supports=held), MPI.COMM_SELF, tolerance=tolerance)
        assert state.counts["f_products"] < 100
        assert mean_pressure(state) == pytest.approx(clamped_pressure(), rel=0.002)


@pytest.mark.parametrize("disc", DISCS)
def test_friction_holds_the_torque_of_the_pressure(disc: Disc) -> None:
    scene = press_fit(48, 12, discretisation=disc, interference=INTERFERENCE, friction=Coulomb(0.2))

    def turned(angle: float) -> list[Support]:
        way = (lambda x: -angle * x[:, 1], lambda x: angle * x[:, 0])
        return [Support("shaft", "inner", way), Support("hub", "outer", (0.0, 0.0))]

    steps = [LoadStep(f"{angle:g}", supports=turned(angle)) for angle in (0.0, 0.01, 0.02)]
    states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), steps)
    limits = [0.2 * state.contact.normal_force.sum() * SEAT for state in states]
    torques = [abs(float(state.resultants((0.0, 0.0)).contacts[0].moment)) for state in states]
    assert mean_pressure(states[0]) == pytest.approx(clamped_pressure(), rel=0.005)
    assert torques[0] < 1e-6 * limits[0]
    for torque, limit in zip(torques[1:], limits[1:], strict=True):
        assert torque == pytest.approx(limit, rel=0.005)
    assert limits[1] == pytest.approx(limits[0], rel=0.01)


@pytest.mark.parametrize("law", [None, Coulomb(0.3)])
def test_contacts_of_a_held_plate_are_found_from_where_it_moves_freely(law: Coulomb | None) -> None:
    """From gaps between torn pieces, whose jumps are open, it takes 163 products, and 213 with friction."""
    plate = block((0, 0, 0), (100, 100, 4), (24, 24, 2))
    ball = ContactPair(Surface("plate", "z0"), RigidSphere((50.0, 50.0, -20.0), 20.0), law)
    scene = Scene(
        {"plate": Body(plate, IsotropicElasticity(2e5, 0.3))},
        [Support("plate", "x0"), Support("plate", "x1")],
        [Pressure("plate", "z1", 0.5)],
        [ball],
    )
    parts = {"plate": box_partition(plate, (4, 4, 1))}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-6)
    assert state.contact.normal_force.sum() == pytest.approx(0.305144 * 5000.0, rel=1e-4)
    assert state.solution.products <= 60
