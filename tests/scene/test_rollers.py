"""Rollers: planes of symmetry in any direction, curved sides held along their normals, given directions."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    Pressure,
    Roller,
    Scene,
    ShapeProblem,
    Status,
    Support,
    Surface,
    SurfaceDesign,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.design import TotalPotential
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import NeoHooke, PlaneStrain
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.qp import FaceNewton
from tests.design.blocks import side
from tests.equilibrium.press_fits import BORE, NU, RIM, YOUNG, ring
from tests.scene.roller_cases import SCENES, SOFT, TURN, fit, found, solved, stack, turned, wedge

SCRIPT = Path(__file__).with_name("roller_cases.py")
IN_PLANE = PlaneStrain(1000.0, 0.3)


def test_normals_lie_in_an_oblique_plane_however_the_face_falls_away_from_it() -> None:
    straight, oblique = (solved(stack(turn=turn, slope=0.1)) for turn in (False, True))
    points, normal = oblique.contact.points, oblique.contact.points.normal
    on_plane = points.oblique_normals.any(axis=(1, 2))
    assert np.count_nonzero(on_plane) == 5
    np.testing.assert_allclose(normal[on_plane] @ TURN[:, 1], 0.0, atol=1e-14)
    assert np.abs(normal[~on_plane] @ TURN[:, 1]).min() > 0.05
    np.testing.assert_allclose(normal, straight.contact.points.normal @ TURN.T, atol=1e-12)
    expected = straight.gather_displacement("upper") @ TURN.T
    assert np.abs(oblique.gather_displacement("upper") - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_a_turned_half_model_is_the_straight_one(discretisation: str) -> None:
    straight, oblique = (solved(stack(turn=turn, discretisation=discretisation)) for turn in (False, True))
    for name in ("lower", "upper"):
        expected = straight.gather_displacement(name) @ TURN.T
        assert np.abs(oblique.gather_displacement(name) - expected).max() < 1e-9 * np.abs(expected).max()
    assert straight.contact.count(Status.SLIP) > 3
    np.testing.assert_array_equal(oblique.contact.status, straight.contact.status)
    for one, other in zip(straight.reactions(), oblique.reactions(), strict=True):
        np.testing.assert_allclose(other.force, TURN @ one.force, atol=1e-7)
    assert oblique.balance().imbalance < 1e-12
    errors = [state.estimate_errors().discretisation for state in (straight, oblique)]
    assert errors[1] == pytest.approx(errors[0], rel=1e-6)
    assert oblique.counts["f_products"] <= 1.15 * straight.counts["f_products"] + 3


def test_a_sector_of_15_degrees_is_its_part_of_the_ring() -> None:
    """A press fit with friction under a pressure that varies around; planes of symmetry at no axis."""
    part, whole = solved(fit(96, 1 / 24, turn=0.4), 3), solved(fit(96, 1.0, turn=0.4), 4)
    for name in ("shaft", "hub"):
        mine, every = (state.scene.bodies[name].mesh.points for state in (part, whole))
        place = [int(np.argmin(np.linalg.norm(every - point, axis=1))) for point in mine]
        expected = whole.gather_displacement(name)[place]
        assert np.abs(part.gather_displacement(name) - expected).max() < 1e-8 * np.abs(expected).max()
    assert part.contact.count(Status.SLIP) == 3
    assert part.contact.count(Status.STICK) == 2, "no slip across planes of symmetry"


@pytest.mark.parametrize("cuts", [1, 3])
def test_a_wedge_with_its_edge_on_the_axis_passes_the_patch_test(cuts: int) -> None:
    """Its two rollers hold the node on the axis along directions that are not perpendicular."""
    mesh = wedge(np.radians(15.0), 4)
    rollers = [Roller("wedge", "start"), Roller("wedge", "end")]
    scene = Scene({"wedge": Body(mesh, IN_PLANE)}, rollers, [Pressure("wedge", "out", 2.0)])
    cells = bisection_partition(mesh, cuts) if cuts > 1 else np.zeros(mesh.n_cells, dtype=np.int64)
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"wedge": cells}, tolerance=1e-11)
    exact = -2.0 * 1.3 * 0.4 / 1000.0 * mesh.points
    np.testing.assert_allclose(state.gather_displacement("wedge"), exact, atol=1e-12)
    across = np.array([(0.0, 1.0), (np.sin(np.radians(15.0)), -np.cos(np.radians(15.0)))])
    for reaction, normal in zip(state.reactions(), across, strict=True):
        np.testing.assert_allclose(reaction.force, 2.0 * normal, atol=1e-9)


def test_rollers_on_three_faces_hold_a_turned_block_as_supports_hold_a_straight_one() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (3, 2, 2))
    held = [(side, tuple(0.01 * k if k == axis else None for k in range(3))) for axis, side in
            enumerate(("x0", "y0", "z0"))]  # fmt: skip
    push = (3.0, 1.0, -2.0)
    straight = Scene(
        {"b": Body(mesh, SOFT)}, [Support("b", *each) for each in held], [Traction("b", "x1", push)]
    )
    slides = [Roller("b", name, -0.01 * axis) for axis, name in enumerate(("x0", "y0", "z0"))]
    load = Traction("b", "x1", tuple((TURN @ push).tolist()))
    oblique = Scene({"b": Body(turned(mesh), SOFT)}, slides, [load])
    for cut in (1, 2):
        one, other = solved(straight, cut), solved(oblique, cut)
        expected = one.gather_displacement("b") @ TURN.T
        np.testing.assert_allclose(other.gather_displacement("b"), expected, atol=1e-11)
        for left, right in zip(one.reactions(), other.reactions(), strict=True):
            np.testing.assert_allclose(right.force, TURN @ left.force, atol=1e-8)
    direct = solve_scene(oblique, MPI.COMM_SELF)
    assert direct.counts["f_products"] == 0
    np.testing.assert_allclose(direct.gather_displacement("b"), expected, atol=1e-11)
    np.testing.assert_allclose(direct.reactions()[2].force, TURN @ one.reactions()[2].force, atol=1e-8)


def test_a_roller_along_an_axis_is_the_support_of_that_component() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    clamped, load = Support("b", "z0"), [Traction("b", "x1", (0.0, 1.0, -2.0))]
    supports = [Roller("b", "x0", 0.02), Support("b", "x0", (-0.02, None, None))]
    states = [solved(Scene({"b": Body(mesh, SOFT)}, [replace(clamped, value=(None, None, 0.0)), each,
              Support("b", "y0", (None, 0.0, None))], load)) for each in supports]  # fmt: skip
    assert not states[0].torn.decomposition.axes
    one, other = (state.torn.B for state in states)
    assert (one != other).nnz == 0
    np.testing.assert_array_equal(*(state.gather_displacement("b") for state in states))


@pytest.mark.parametrize("quadratic_cells", [False, True])
def test_a_curved_roller_shrinks_a_ring_as_lame_says(quadratic_cells: bool) -> None:
    """Each node is held along its own normal alone: nothing acts around, and the ring slides freely."""
    near = 1e-3 if quadratic_cells else 0.02
    shrink, mesh = 0.03, ring(BORE, RIM, 48, 6, part=0.25)
    mesh = quadratic(mesh) if quadratic_cells else mesh
    scene = Scene(
        {"ring": Body(mesh, PlaneStrain(YOUNG, NU))},
        [Roller("ring", "outer", -shrink), Roller("ring", "start"), Roller("ring", "end")],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    u, x = state.gather_displacement("ring"), mesh.points
    radius = np.linalg.norm(x, axis=1)
    radial = np.einsum("nd,nd->n", u, x) / radius
    np.testing.assert_allclose(radial[np.isclose(radius, RIM)], -shrink, rtol=1e-12)
    young, nu = YOUNG / (1 - NU**2), NU / (1 - NU)
    ratio = 2.0 * BORE * RIM / ((1 - nu) * RIM**2 + (1 + nu) * BORE**2)
    np.testing.assert_allclose(radial[np.isclose(radius, BORE)], -shrink * ratio, rtol=near)
    # The reaction is the pressure of Lamé on a quarter, on each axis p b.
    pressure = young * shrink / RIM * (RIM**2 - BORE**2) / ((1 - nu) * RIM**2 + (1 + nu) * BORE**2)
    np.testing.assert_allclose(state.reactions()[0].force, -pressure * RIM * np.ones(2), rtol=near)
    around = x @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert np.abs(np.einsum("nd,nd->n", u, around)).max() < 2e-3 * shrink * RIM


def test_a_roller_holds_both_sides_of_an_edge_of_its_surface() -> None:
    """Two sides under one name: the normal at their common edge is not the mean of both."""
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    sides = np.vstack([mesh.surfaces["x0"], mesh.surfaces["y0"]])
    mesh = replace(mesh, surfaces={**mesh.surfaces, "both": sides})
    load = [Traction("b", "x1", (1.0, 1.0, 0.0))]
    given = [Support("b", "x0", (0.0, None, None)), Support("b", "y0", (None, 0.0, None))]
    floor = Support("b", "z0", (None, None, 0.0))
    one = solved(Scene({"b": Body(mesh, SOFT)}, [*given, floor], load))
    other = solved(Scene({"b": Body(mesh, SOFT)}, [Roller("b", "both"), floor], load))
    np.testing.assert_allclose(other.gather_displacement("b"), one.gather_displacement("b"), atol=1e-13)


def test_a_given_direction_holds_that_component_alone() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    along = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
    scene = Scene(
        {"b": Body(mesh, SOFT)},
        [Support("b", "x0"), Roller("b", "x1", lambda x: 0.01 + 0.0 * x[:, 0], (1.0, 2.0, -1.0))],
        [Traction("b", "z1", (0.0, 0.0, -3.0))],
    )
    state = solved(scene)
    u = state.gather_displacement("b")
    np.testing.assert_allclose(u[np.isclose(mesh.points[:, 0], 2.0)] @ along, 0.01, rtol=1e-10)
    force = state.reactions()[1].force
    np.testing.assert_allclose(np.cross(force, along), 0.0, atol=1e-9 * np.linalg.norm(force))
    assert np.linalg.norm(force) > 0.5
    names = [effect.name.value for effect in scene.effects()]
    assert names == ["elasticity", "prescribed displacement", "roller", "surface load"]


def test_load_steps_move_rollers_and_remember_slip() -> None:
    scene = stack(turn=True)
    lower = [each for each in scene.supports if each.body == "lower"]
    steps = [
        LoadStep(f"{way}", supports=[*lower, Roller("upper", "y0", way)]) for way in (0.0, 0.004, -0.004)
    ]
    cut = {name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-9))
    states = solve_steps(problem, steps)
    across = [float(TURN[:, 1] @ state.reactions()[2].force) for state in states]
    assert across[1] < across[0] < across[2], "pushed along its normal, which points to −y, then back"
    for state, way in zip(states, (0.0, 0.004, -0.004), strict=True):
        on_plane = np.unique(scene.bodies["upper"].mesh.surfaces["y0"])
        moved = state.gather_displacement("upper")[on_plane] @ -TURN[:, 1]
        np.testing.assert_allclose(moved, way, atol=1e-12)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_large_deformations_slide_in_a_plane_of_symmetry(discretisation: str) -> None:
    """With sliding contact, friction and a pressure that follows."""
    rubber = NeoHooke(10.0, 0.3)

    def scene(*, turn: bool) -> Scene:
        way = np.array([0.25, 0.0, -0.2])
        base = stack(turn=turn, discretisation=discretisation, cells=(2, 2, 1))
        top = Support("upper", "z1", tuple((TURN @ way if turn else way).tolist()))
        bodies = {name: Body(body.mesh, rubber) for name, body in base.bodies.items()}
        return replace(
            base, bodies=bodies, supports=[*base.supports, top], loads=[Pressure("upper", "x1", 1.0)]
        )

    def state(*, turn: bool) -> np.ndarray:
        given = scene(turn=turn)
        cut = {name: box_partition(body.mesh, (2, 1, 1)) for name, body in given.bodies.items()}
        found = solve_scene(given, MPI.COMM_SELF, partitions=cut, tolerance=1e-10)
        assert found.contact.count(Status.SLIP) > 0
        return np.concatenate([found.gather_displacement(name) for name in given.bodies])

    expected = state(turn=False) @ TURN.T
    assert np.abs(expected).max() > 0.2
    np.testing.assert_allclose(state(turn=True), expected, atol=1e-8)


def test_the_nodes_of_a_design_slide_in_a_plane_of_symmetry() -> None:
    """Designs of both surfaces of a contact with friction end at the plane; the gradient is that of J."""
    meshes = {
        "lower": block((0, 0, -1.0), (2.0, 1.0, 0.0), (5, 3, 2)),
        "upper": block((0.13, 0.0, 0.0), (1.87, 1.0, 0.8), (6, 4, 2)),
    }
    x = meshes["upper"].points.copy()
    x[:, 2] += 0.04 * ((x[:, 0] - 1.0) ** 2 + x[:, 1] ** 2) * (0.8 - x[:, 2])
    meshes["upper"] = meshes["upper"].moved(x)
    places = {name: side(meshes[name], of) for name, of in (("lower", "z1"), ("upper", "z0"))}
    designs = tuple(
        SurfaceDesign(name, replace(at, directions=at.directions @ TURN.T), (3, 2))
        for name, at in places.items()
    )
    scene = Scene(
        {name: Body(turned(mesh), SOFT) for name, mesh in meshes.items()},
        [Support("lower", "z0"), Roller("lower", "y0"), Roller("upper", "y0")],
        [Traction("upper", "z1", tuple((TURN @ (0.5, 0.0, -5.0)).tolist()))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.3), "node")],
    )
    cut = {name: box_partition(mesh, (2, 1, 1)) for name, mesh in meshes.items()}
    contact = ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-11))
    problem = ShapeProblem(contact, designs, TotalPotential())
    random = np.random.default_rng(1)
    alpha, way = 0.01 * random.standard_normal((2, problem.size))
    after = problem.scene_of(alpha)
    for name, mesh in meshes.items():
        plane = np.unique(mesh.surfaces["y0"])
        moved = after.bodies[name].mesh.points[plane] - scene.bodies[name].mesh.points[plane]
        assert np.abs(moved).max() > 1e-3
        np.testing.assert_allclose(moved @ TURN[:, 1], 0.0, atol=1e-14)
    step = 1e-3
    slope = (problem(alpha + step * way)[0] - problem(alpha - step * way)[0]) / (2.0 * step)
    assert problem(alpha)[1] @ way == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("name", SCENES)
def test_the_cut_does_not_matter(name: str) -> None:
    cuts = (3, 4) if name == "sector" else (2, 3)
    one, other = (found(name, cut, MPI.COMM_SELF) for cut in cuts)
    scale = np.abs(one["u"]).max()
    np.testing.assert_allclose(one["u"], other["u"], atol=1e-8 * scale)
    np.testing.assert_allclose(one["reactions"], other["reactions"], atol=1e-6)


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_ranks_find_the_same(ranks: int, mpirun: Callable[..., str]) -> None:
    names = ["stack", "mortar", "floor"]
    everywhere = json.loads(mpirun(SCRIPT, ranks, *names))
    assert len(everywhere) == ranks
    for name in names:
        alone = found(name, 4, MPI.COMM_SELF)
        scale = np.abs(alone["u"]).max()
        for results in everywhere:
            np.testing.assert_allclose(results[name]["u"], alone["u"], atol=1e-8 * scale)
            np.testing.assert_allclose(results[name]["reactions"], alone["reactions"], atol=1e-6)


def test_rollers_and_supports_must_agree_where_they_meet() -> None:
    mesh = turned(block((0, 0, 0), (1, 1, 1), (2, 2, 2)))
    body = {"b": Body(mesh, SOFT)}
    message = r"supports must agree where they meet: 3 nodes of surface 'x0' .* would move by 0\.5 along"
    with pytest.raises(InvalidInputError, match=message):
        solved(Scene(body, [Support("b", "z0"), Roller("b", "x0", 0.5)]))
    twice = [Roller("b", "x0"), Roller("b", "x0", 0.1), Support("b", "x1")]
    with pytest.raises(InvalidInputError, match="where others prescribe 0"):
        solved(Scene(body, twice))


def test_directions_and_displacements_of_rollers_are_checked() -> None:
    with pytest.raises(InvalidInputError, match=r"Roller\.direction of surface 'x0' .* not all zero"):
        Roller("b", "x0", direction=(0.0, 0.0, 0.0))
    with pytest.raises(InvalidInputError, match=r"Roller\.displacement .* must be a finite number"):
        Roller("b", "x0", float("nan"))
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    with pytest.raises(InvalidInputError, match=r"Roller\.direction of .* must have 3 components"):
        Scene({"b": Body(mesh, SOFT)}, [Roller("b", "x0", direction=(1.0, 0.0))])
    with pytest.raises(InvalidInputError, match="Roller names surface 'w0' of body 'b'"):
        Scene({"b": Body(mesh, SOFT)}, [Roller("b", "w0")])


def test_a_curved_roller_is_refused_where_bodies_deform_much() -> None:
    bodies = {"ring": Body(ring(BORE, RIM, 24, 2, part=0.25), NeoHooke(10.0, 0.3))}
    message = "needs one direction, that of 'outer' .* turns by up to 37.5 degrees, as it is curved: give a"
    with pytest.raises(InvalidInputError, match=message):
        Scene(bodies, [Roller("ring", "outer")])
    Scene(bodies, [Roller("ring", "outer", direction=(1.0, 1.0)), Roller("ring", "start")])


def test_another_direction_is_taken_by_the_same_problem() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    scene = Scene({"b": Body(mesh, SOFT)}, [Support("b", "x0"), Roller("b", "x1", direction=(1.0, 1.0, 0.0))])
    problem = ContactProblem(scene, MPI.COMM_SELF)
    problem.solve(scene)
    other = replace(scene, supports=[Support("b", "x0"), Roller("b", "x1", direction=(1.0, 2.0, 0.0))])
    along = np.array([1.0, 2.0, 0.0])
    moved = problem.solve(other).gather_displacement("b")
    np.testing.assert_allclose(moved[mesh.points[:, 0] == 2.0] @ along, 0.0, atol=1e-9)
    np.testing.assert_allclose(moved, solve_scene(other, MPI.COMM_SELF).gather_displacement("b"), atol=1e-9)
