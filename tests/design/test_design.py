"""Designs of surfaces, their motion and their states."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import cache

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
    RigidPlane,
    Scene,
    SceneResponse,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    TangentNewton,
    box_partition,
    minimize,
)
from fenics_contact.design import BundleTrust, LoadCases, Movement, Remeshed
from fenics_contact.design.design import bernstein, tensor_bernstein
from fenics_contact.design.motion import DesignGeometry, MeshMotion, motion_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import decompose
from fenics_contact.gallery import LinkShape, block, box_lattice, chain_link, rectangle, side_of
from fenics_contact.materials import Material, NeoHooke, PlaneStrain
from fenics_contact.mesh.quality import thickness
from fenics_contact.qp import FaceNewton
from fenics_contact.shapes import Plane
from tests.design.blocks import RUBBER, side
from tests.design.chains import chain_problem, crossed_links

PARAMETERS = np.random.default_rng(1).uniform(0.0, 1.0, (50, 2))


@pytest.mark.parametrize("count", [1, 2, 4, 7])
def test_bernstein_polynomials_are_a_partition_of_unity_and_not_negative(count: int) -> None:
    values = bernstein(PARAMETERS[:, 0], count)
    assert values.shape == (50, count)
    assert values.sum(axis=1) == pytest.approx(np.ones(50), rel=1e-13)
    assert values.min() >= 0.0
    # Not unity because one of them is: all take part.
    assert np.all(values.max(axis=0) > 0.1)


def test_bernstein_polynomials_reproduce_straight_lines() -> None:
    t = PARAMETERS[:, 0]
    assert bernstein(t, 5) @ np.linspace(0.0, 1.0, 5) == pytest.approx(t, rel=1e-13)


def test_only_the_end_polynomials_reach_the_ends() -> None:
    assert np.array_equal(bernstein(np.array([0.0, 1.0]), 4), np.eye(4)[[0, 3]])


def test_the_second_parameter_runs_fastest() -> None:
    values = tensor_bernstein(PARAMETERS, (3, 2)).reshape(50, 3, 2)
    assert values.sum(axis=2) == pytest.approx(bernstein(PARAMETERS[:, 0], 3))
    assert values.sum(axis=1) == pytest.approx(bernstein(PARAMETERS[:, 1], 2))


def crown(net: tuple[int, int] = (4, 3)) -> SurfaceDesign:
    return SurfaceDesign("link1", crossed_links().first.crown, net)


def test_equal_variables_move_the_surface_along_its_normals_by_as_much() -> None:
    design = crown()
    assert design.size == 12
    moved = design.displacement(np.full(12, 0.3))
    assert moved == pytest.approx(0.3 * design.lattice.directions)
    assert np.linalg.norm(moved, axis=1) == pytest.approx(np.full(len(moved), 0.3))


def test_positive_variables_add_material() -> None:
    link = crossed_links().first
    points = link.mesh.points.copy()
    points[link.crown.nodes] += crown().displacement(np.full(12, 0.1))
    assert link.mesh.moved(points).volume > link.mesh.volume + 1.0


def test_pulling_back_is_the_transpose_of_displacing() -> None:
    design, rng = crown(), np.random.default_rng(2)
    alpha, by_points = rng.standard_normal(12), rng.standard_normal(design.lattice.directions.shape)
    forth, back = np.sum(design.displacement(alpha) * by_points), alpha @ design.pull_back(by_points)
    assert abs(forth) > 0.1
    assert back == pytest.approx(forth, rel=1e-12)


def test_control_points_are_drawn_on_the_surface_and_move_with_their_variables() -> None:
    design, mesh = crown((5, 3)), crossed_links().first.mesh
    at_rest = design.control_points(mesh.points, np.zeros(15))
    assert at_rest.shape == (5, 3, 3)
    corners = design.lattice.nodes.reshape(design.lattice.counts)[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert at_rest[[0, 0, -1, -1], [0, -1, 0, -1]] == pytest.approx(mesh.points[corners])
    moved = design.control_points(mesh.points, np.eye(15)[7])
    distance = np.linalg.norm(moved - at_rest, axis=2).ravel()
    assert distance == pytest.approx(np.eye(15)[7])


@pytest.mark.parametrize("width", [0.0, 0.3, None, 1e3])
def test_the_boundary_beyond_the_transition_strip_keeps_its_place(width: float | None) -> None:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 4, 8))
    design = SurfaceDesign("block", side(mesh, "z0"), (2, 2), width)
    # The strip is 0.15 times the diagonal of the surface if nothing else is said.
    reach = 0.15 * np.sqrt(5.0) if width is None else width
    x, y, z = mesh.points.T
    boundary = (x == 0) | (x == 2) | (y == 0) | (y == 1) | (z == 1)
    expected = np.flatnonzero(boundary & (z > reach))
    assert (len(expected) > 0) == (width != 1e3)
    cut = np.zeros(mesh.points.shape, dtype=bool)
    assert np.array_equal(design.nodes_beyond_transition(mesh, cut), expected)


@pytest.mark.parametrize("net", [(0, 3), (4, -1)])
def test_a_net_without_control_points_is_refused(net: tuple[int, int]) -> None:
    with pytest.raises(InvalidInputError, match=r"control points each way, got \(.*\): try \(7, 4\), for"):
        crown(net)


def test_a_net_finer_than_the_mesh_is_refused() -> None:
    counts = crossed_links().first.crown.counts
    assert crown(counts).size == counts[0] * counts[1]
    for net in ((counts[0] + 1, 2), (2, counts[1] + 1)):
        with pytest.raises(InvalidInputError, match="use fewer points or finer cells"):
            crown(net)


def test_a_number_of_control_points_moves_a_curve() -> None:
    mesh = rectangle((0.0, 0.0), (4.0, 1.0), (8, 2))
    design = SurfaceDesign("plate", side_of(mesh, "y1"), 3)
    assert design.size == 3
    moved = design.displacement(np.array([0.0, 1.0, 0.0]))
    # From right to left, with the body on the left.
    t = 1.0 - mesh.points[design.lattice.nodes, 0] / 4.0
    np.testing.assert_allclose(moved, np.column_stack([0.0 * t, 2 * t * (1 - t)]), atol=1e-14)
    np.testing.assert_allclose(
        design.control_points(mesh.points, np.array([0.0, 0.5, 0.0])), [[4.0, 1.0], [2.0, 1.5], [0.0, 1.0]]
    )


def test_a_pair_on_a_curve_and_a_number_on_a_surface_are_refused() -> None:
    curve = side_of(rectangle((0.0, 0.0), (4.0, 1.0), (8, 2)), "y1")
    with pytest.raises(
        InvalidInputError, match=r"a curve in the plane is a number .* got \(7, 4\) on 'plate': .* net=7"
    ):
        SurfaceDesign("plate", curve)
    top = side_of(block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (8, 4, 2)), "z1")
    with pytest.raises(
        InvalidInputError, match=r"a surface is a pair of numbers, got 7 on 'brick': give net=\(7, 4\)"
    ):
        SurfaceDesign("brick", top, 7)


def test_a_net_that_the_nodes_do_not_feel_is_refused() -> None:
    scene = Scene({"brick": Body(block((0, 0, 0), (2, 1, 1), (6, 3, 2)), RUBBER)}, [Support("brick", "z0")])
    top = side(scene.bodies["brick"].mesh, "z1")
    along = replace(top, parameters=top.parameters[:, [0, 0]])
    assert SurfaceDesign("brick", top, (3, 3)).on(scene).size == 9
    with pytest.raises(
        InvalidInputError,
        match=r"nodes move only in 5 ways \(variables 1, 2, .* use fewer",
    ):
        SurfaceDesign("brick", along, (3, 3)).on(scene)


# How accurately states of designs are solved, and which designs may overlap before they are loaded.
STEEL, DESIGN_STATES_RUBBER = PlaneStrain(100.0, 0.3), NeoHooke(1.0, 0.3)
#: A design whose middle lies inside the floor, by more than facets explain.
DEEP = np.array([0.0, 0.2, 0.0])


def pressed(material: Material, floor: float = 0.0) -> Scene:
    """A block pressed and dragged on a floor."""
    pair = ContactPair(Surface("b", "y0"), RigidPlane((0.0, floor), (0.0, 1.0)), Coulomb(0.3))
    support = Support("b", "y1", (0.08, -0.1))
    return Scene({"b": Body(rectangle((0, 0), (2, 1), (8, 4)), material)}, [support], [], [pair])


def designed(scene: Scene, **more: object) -> ShapeProblem:
    contact = ContactProblem(scene, MPI.COMM_SELF, **more)  # type: ignore[arg-type]
    return ShapeProblem(contact, SurfaceDesign("b", "y0", net=3), Movement("b", "x1", (1.0, 0.3)))


@pytest.mark.parametrize(
    ("settings", "wanted"),
    [
        ({}, 1e-8),
        ({"steps": AutomaticSteps(TangentNewton(tolerance=1e-12))}, 1e-12),
        ({"steps": AutomaticSteps(TangentNewton(tolerance=1e-12)), "tolerance": 1e-4}, 1e-4),
    ],
)
def test_states_of_rubber_are_solved_to_newtons_tolerance(settings: dict[str, object], wanted: float) -> None:
    problem = designed(pressed(DESIGN_STATES_RUBBER), **settings)
    assert problem.evaluate(0.1 * DEEP).tolerance == wanted == problem.contact.number()
    assert problem.last.state.solution.residuals.worst < wanted  # type: ignore[union-attr]


def test_other_states_are_solved_to_the_tolerance_of_their_solver() -> None:
    assert designed(pressed(STEEL)).evaluate(0.1 * DEEP).tolerance == FaceNewton().tolerance
    assert designed(pressed(STEEL), solver=FaceNewton(1e-9)).evaluate(0.1 * DEEP).tolerance == 1e-9
    response = SceneResponse(
        lambda floor: pressed(DESIGN_STATES_RUBBER, floor), {"floor": 0.0},
        {"force": lambda state: state.contact.normal_force.sum()}, MPI.COMM_SELF,
    )  # fmt: skip
    assert response()["force"] > 0.0
    assert response.state is not None
    assert response.state.solution.residuals.worst < TangentNewton().tolerance


def test_a_new_mesh_is_solved_as_the_first_one() -> None:
    problem = designed(pressed(DESIGN_STATES_RUBBER), steps=AutomaticSteps(TangentNewton(tolerance=1e-11)))
    far = Remeshed(problem, share=0.95)
    far.evaluate(DEEP)
    assert len(far.remeshings) > 0
    assert {each.contact.number() for each in far.problems} == {1e-11}


@pytest.mark.parametrize("material", [STEEL, DESIGN_STATES_RUBBER], ids=["steel", "rubber"])
def test_designs_may_overlap_whichever_is_the_first(material: Material) -> None:
    settings = {"tolerance": 1e-10}
    one, other = (designed(pressed(material), **settings) for _ in range(2))
    one.evaluate(np.zeros(3))
    value = one.evaluate(DEEP).value
    assert other.evaluate(DEEP).value == pytest.approx(value, rel=1e-7)
    assert other.scene_of(DEEP).points[:, 1].min() < -0.05


@pytest.mark.parametrize("first", [np.zeros(3), -1.5 * DEEP], ids=["as given", "apart"])
def test_a_shape_that_is_given_may_not_overlap_whichever_design_is_the_first(first: np.ndarray) -> None:
    floor = pressed(STEEL, floor=0.1)
    with pytest.raises(InvalidInputError, match=r"bodies must not overlap at the start: .* of 'b' lie up to"):
        designed(floor).evaluate(first)
    apart = designed(pressed(STEEL))
    apart.evaluate(first)
    with pytest.raises(InvalidInputError, match=r"bodies must not overlap at the start"):
        apart.case(replace(apart.scene, contacts=floor.contacts)).evaluate(first)


def test_overlaps_are_told_of_the_last_design_alone(caplog: pytest.LogCaptureFixture) -> None:
    scene = replace(pressed(STEEL), supports=[Support("b", "y1", (0.0, -0.002))])
    problem = designed(scene)
    method = BundleTrust(tolerance=1e-2, max_evaluations=4, raise_on_failure=False)
    with caplog.at_level(logging.WARNING):
        result = minimize(problem, DEEP / 2, method, bounds=(0.05 * DEEP - 1e-3, 0.6 * DEEP + 1e-3))
    overlaps = [record.getMessage() for record in caplog.records if "overlap" in record.getMessage()]
    assert result.evaluations > 1
    assert len(overlaps) == 1
    assert overlaps[0].startswith("at the end of the minimisation: surfaces of b y0 on rigid plane overlap")
    cases = LoadCases({"one": problem, "two": problem.case(scene)})
    assert set(cases.remarks(result.x)) == set(problem.remarks(result.x))
    assert problem.remarks(-DEEP) == ()


@pytest.mark.parametrize("material", [STEEL, DESIGN_STATES_RUBBER], ids=["steel", "rubber"])
@pytest.mark.parametrize("given", [{}, {"gap": 0.0}])
def test_doubts_about_a_surface_are_told_of_the_shape_given_alone(
    given: dict[str, float], material: Material, caplog: pytest.LogCaptureFixture
) -> None:
    scene = pressed(material)
    off = scene.bodies["b"].mesh.with_shapes({"y0": Plane((0.0, -1e-4), (0.0, -1.0))})
    pair = replace(scene.contacts[0], **given)  # type: ignore[arg-type]
    problem = designed(replace(scene, bodies={"b": Body(off, material)}, contacts=[pair]))
    with caplog.at_level(logging.WARNING):
        for size in (0.05, 0.1, 0.15):
            problem.evaluate(size * DEEP)
    words = [record.getMessage() for record in caplog.records if "off its shape" in record.getMessage()]
    assert len(words) == 1


# The displacement of a surface is extended into the mesh, and derivatives are pulled back the same way.
CELLS = ("hexahedron", "tetrahedron")


@cache
def brick(cell: str) -> Scene:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.5), (4, 3, 3), cell)
    return Scene({"brick": Body(mesh, RUBBER)}, [Support("brick", "z0")])


def marks(body: Body, nodes: np.ndarray) -> np.ndarray:
    held = np.zeros(body.mesh.points.shape, dtype=bool)
    held[nodes] = True
    return held


def extension(cell: str, held: str = "z0") -> MeshMotion:
    scene = brick(cell)
    body = scene.bodies["brick"]
    decomposition = decompose(scene, {"brick": box_partition(body.mesh, (2, 1, 1))}, MPI.COMM_SELF)
    top, bottom = (np.unique(body.mesh.surfaces[name]) for name in ("z1", held))
    return MeshMotion(decomposition, "brick", body, top, marks(body, np.setdiff1d(bottom, top)))


@pytest.mark.parametrize("cell", CELLS)
def test_prescribed_values_are_met_and_held_nodes_stay(cell: str) -> None:
    motion, mesh = extension(cell), brick(cell).bodies["brick"].mesh
    given = np.random.default_rng(1).standard_normal((len(motion.moving), 3))
    moved = motion.extend(given)
    assert moved.shape == mesh.points.shape
    assert moved[motion.moving] == pytest.approx(given, abs=1e-14)
    assert np.all(moved[np.unique(mesh.surfaces["z0"])] == 0.0)
    inside = np.setdiff1d(np.arange(mesh.n_nodes), np.unique([*mesh.surfaces["z0"], *mesh.surfaces["z1"]]))
    assert np.abs(moved[inside]).min() > 0.0


@pytest.mark.parametrize("cell", CELLS)
def test_a_top_that_moves_as_a_whole_stretches_the_body_evenly(cell: str) -> None:
    motion, mesh = extension(cell), brick(cell).bodies["brick"].mesh
    shift = np.array([0.3, -0.2, 0.1])
    moved = motion.extend(np.tile(shift, (len(motion.moving), 1)))
    assert moved == pytest.approx(mesh.points[:, 2:] / 1.5 * shift, abs=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_pulling_back_is_the_transpose_of_extending(cell: str) -> None:
    motion, rng = extension(cell), np.random.default_rng(2)
    given = rng.standard_normal((len(motion.moving), 3))
    by_points = rng.standard_normal(brick(cell).bodies["brick"].mesh.points.shape)
    forth, back = np.sum(motion.extend(given) * by_points), np.sum(given * motion.pull_back(by_points))
    assert abs(forth) > 1.0
    assert back == pytest.approx(forth, rel=1e-12)


def test_components_do_not_mix() -> None:
    motion = extension("hexahedron")
    given = np.zeros((len(motion.moving), 3))
    given[:, 1] = 1.0
    moved = motion.extend(given)
    assert np.all(moved[:, [0, 2]] == 0.0)
    assert moved[:, 1].max() == 1.0


@pytest.mark.parametrize("stiffening", [0.0, 1.0, 2.0])
def test_cells_deform_as_much_as_their_volume_to_the_stiffening(stiffening: float) -> None:
    mesh = box_lattice([np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 3), np.array([0.0, 1.0, 1.25, 1.5])])
    scene = Scene({"brick": Body(mesh, RUBBER)}, [Support("brick", "z0")])
    decomposition = decompose(scene, {"brick": box_partition(mesh, (2, 1, 1))}, MPI.COMM_SELF)
    top, bottom = (np.unique(mesh.surfaces[name]) for name in ("z1", "z0"))
    held = marks(scene.bodies["brick"], bottom)
    motion = MeshMotion(decomposition, "brick", scene.bodies["brick"], top, held, stiffening=stiffening)
    moved = motion.extend(np.tile([0.0, 0.0, 0.1], (len(top), 1)))[:, 2]
    levels = [moved[np.isclose(mesh.points[:, 2], z)] for z in (0.0, 1.0, 1.25, 1.5)]
    assert max(np.ptp(level) for level in levels) < 1e-13
    thick, thin, top_strain = np.diff([level[0] for level in levels]) / [1.0, 0.25, 0.25]
    assert thin == pytest.approx(top_strain)
    assert thick / thin == pytest.approx(4.0**stiffening)


def test_small_cells_on_a_crown_let_it_move_farther() -> None:
    links = chain_link(LinkShape(n_around=24, n_a=4, n_b=10, grading=2.5))
    scene = Scene({"link": Body(links.mesh, RUBBER)}, [Support("link", "grip")])
    decomposition = decompose(scene, {"link": box_partition(links.mesh, (2, 1, 1))}, MPI.COMM_SELF)
    design = SurfaceDesign("link", links.crown, (7, 4))
    motion = motion_of(decomposition, scene, design)
    even = MeshMotion(decomposition, "link", scene.bodies["link"], motion.moving, motion.held, stiffening=0.0)
    given = design.displacement(np.random.default_rng(3).uniform(-1.0, 1.0, 28))
    far, near = (largest(links.mesh, way.extend(given)) for way in (motion, even))
    assert far > 2.5 * near > 0.0


def largest(mesh: BodyMesh, moved: np.ndarray) -> float:
    """How often the displacement can be applied before a cell inverts."""
    steps = np.geomspace(0.01, 10.0, 100)
    sound = [bool(thickness(mesh.points + step * moved, mesh.cells).min() > 0.0) for step in steps]
    return float(steps[np.argmin(sound) - 1]) if not all(sound) else float(steps[-1])


def test_nodes_that_are_to_move_and_to_stay_are_refused() -> None:
    scene = brick("hexahedron")
    body = scene.bodies["brick"]
    decomposition = decompose(scene, {"brick": box_partition(body.mesh, (2, 1, 1))}, MPI.COMM_SELF)
    top, side = (np.unique(body.mesh.surfaces[name]) for name in ("z1", "x0"))
    with pytest.raises(InvalidInputError, match=r"4 nodes of body 'brick' lie on both: choose another"):
        MeshMotion(decomposition, "brick", body, top, marks(body, side))


def test_a_chain_follows_its_crowns_and_stays_where_it_is_held_or_pulled() -> None:
    problem, links = chain_problem(None), crossed_links()
    points = problem.points_of(np.full(problem.size, 0.2))
    for design, link in zip(problem.designs, (links.first, links.second), strict=True):
        moved = points[design.body] - link.mesh.points
        grip = np.unique(link.mesh.surfaces["grip"])
        assert len(grip) > 10
        assert np.all(moved[grip] == 0.0)
        assert moved[link.crown.nodes] == pytest.approx(0.2 * link.crown.directions, abs=1e-12)
        assert np.all(
            moved[design.nodes_beyond_transition(link.mesh, np.zeros(link.mesh.points.shape, dtype=bool))]
            == 0.0
        )
        distance = np.linalg.norm(moved, axis=1)
        # Smooth: between the crown and what stays, nodes go part of the way.
        assert np.count_nonzero((distance > 0.01) & (distance < 0.19)) > 20
        assert distance.max() <= 0.2 + 1e-12


def test_a_plane_of_symmetry_holds_only_what_is_across_it() -> None:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.5), (4, 3, 3))
    mesh = mesh.moved(mesh.points + 0.1 * (mesh.points[:, 2:] / 1.5) ** 2 * mesh.points[:, :1] * [0, 0, -1.0])
    sides = [Support("brick", "x0", (0.0, None, None)), Support("brick", "y0", (None, 0.0, None))]
    scene = Scene({"brick": Body(mesh, RUBBER)}, [*sides, Support("brick", "z0")])
    decomposition = decompose(scene, {"brick": box_partition(mesh, (2, 1, 1))}, MPI.COMM_SELF)
    geometry = DesignGeometry(scene, decomposition, [SurfaceDesign("brick", "z1", (3, 2), transition=2.0)])
    (design,) = geometry.designs
    alpha = 1.0 + np.random.default_rng(4).random(6)
    moved = geometry.points_of(0.1 * alpha)["brick"] - mesh.points
    on_x, on_y = (np.unique(mesh.surfaces[side]) for side in ("x0", "y0"))
    assert np.abs(moved[on_x, 0]).max() == np.abs(moved[on_y, 1]).max() == 0.0
    inner = np.setdiff1d(on_x, [*mesh.surfaces["z1"].ravel(), *mesh.surfaces["z0"].ravel()])
    assert np.abs(moved[inner, 2]).min() > 1e-3
    assert moved[design.lattice.nodes] == pytest.approx(design.displacement(0.1 * alpha), abs=1e-14)
    assert np.all(moved[np.unique(mesh.surfaces["z0"])] == 0.0)
    by_points = np.random.default_rng(5).standard_normal(mesh.points.shape)
    assert geometry.pull_back(by_points) @ alpha == pytest.approx(10.0 * np.sum(moved * by_points), rel=1e-12)
    with pytest.raises(InvalidInputError, match="16 nodes of that on 'brick' would leave one"):
        DesignGeometry(scene, decomposition, [SurfaceDesign("brick", "x0", (3, 2))])
