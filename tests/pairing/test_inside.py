"""Points inside facets: where gaps are smallest, what they measure, and how they move with nodes."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    RigidSphere,
    RigidTool,
    Roller,
    Scene,
    Support,
    Surface,
)
from fenics_contact._pairing.inside import (
    Deepest,
    GapsAt,
    InFacets,
    InsideOf,
    Sampled,
    deepest_points,
    points_inside,
)
from fenics_contact._pairing.masters import turning
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._pairing.search import find_contact_points
from fenics_contact._scene.local_axes import NO_AXES
from fenics_contact.gallery import block, half_disc, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic, refined
from fenics_contact.mesh.body_mesh import BodyMesh

STEEL, FLAT_STEEL = IsotropicElasticity(2.1e5, 0.3), PlaneStrain(2.1e5, 0.3)
RNG = np.random.default_rng(4)


def found(corners: int, gap: GapsAt, count: int = 1) -> Deepest:
    return deepest_points(corners, Sampled.of(corners, np.arange(count), gap), gap)


@pytest.mark.parametrize(
    ("corners", "tip"), [(2, (0.33,)), (3, (0.31, 0.42)), (4, (-0.41, 0.27)), (4, (0.97, -0.9))]
)
def test_a_tip_between_the_nodes_is_found_where_it_is(corners: int, tip: tuple[float, ...]) -> None:
    deepest = found(corners, lambda _, local: np.linalg.norm(local - tip, axis=1) - 0.1)
    np.testing.assert_allclose(deepest.local, [tip], atol=0.005)
    assert deepest.gap[0] == pytest.approx(-0.1, abs=0.005)
    assert deepest.missed[0] == pytest.approx(-deepest.gap[0])


def test_a_tip_between_samples_that_are_open_is_found() -> None:
    deepest = found(2, lambda _, local: 0.07 * np.abs(local[:, 0] - 0.2) - 0.01)
    np.testing.assert_allclose(deepest.local, [[0.2]], atol=0.005)


@pytest.mark.parametrize("tilt", [0.0, 1e-6])
def test_of_a_flat_bottom_the_middle_is_found(tilt: float) -> None:
    def gap(_: np.ndarray, local: np.ndarray) -> np.ndarray:
        return np.maximum(np.abs(local[:, 0] - 0.2) - 0.25, 0.0) - 0.1 + tilt * local[:, 0]

    np.testing.assert_allclose(found(2, gap).local, [[0.2]], atol=1e-12)


def test_facets_are_missed_that_lie_deeper_than_their_nodes_in_the_master_alone() -> None:
    def gap(facet: np.ndarray, local: np.ndarray) -> np.ndarray:
        bottom = np.array([0.05, -0.05, 0.0])[facet]  # open, pierced, and as deep as its node
        return np.where(facet < 2, local[:, 0] ** 2 + bottom, local[:, 0] - 1.0)

    deepest = found(2, gap, 3)
    np.testing.assert_array_equal(deepest.facet, [1])
    np.testing.assert_allclose(deepest.missed, [0.05], atol=1e-6)


def slave_of(mesh: BodyMesh, side: str, master: object, **more: Body) -> InsideOf:
    material = STEEL if mesh.points.shape[1] == 3 else FLAT_STEEL
    pair = ContactPair(Surface("slave", side), master)  # type: ignore[arg-type]
    return InsideOf.of(Scene({"slave": Body(mesh, material)} | more, contacts=[pair]), pair)


def anywhere(of: InsideOf, count: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Return random points of facets."""
    corners = of.slave.corners
    return RNG.integers(0, len(of.slave.facets), count), RNG.uniform(-0.9, 0.9, (count, corners // 2))


def test_gaps_on_a_tool_change_with_the_motions_of_body_and_tool() -> None:
    tool = RigidTool("tool", RigidSphere((0.2, 0.3, -2.0), 2.0), at=(0.0, 0.0, -2.0))
    of = slave_of(block((-1, -1, 0), (1, 1, 1), (3, 3, 1)), "z0", tool)
    at = anywhere(of)
    points, nodes = of.at(*at), of.scene.points
    places = points.own @ nodes
    np.testing.assert_allclose(places[:, 2], 0.0, atol=1e-12)
    gradient = RNG.normal(size=(3, 3))
    turn, shift = RNG.normal(size=3), RNG.normal(size=3)
    moved = nodes @ gradient.T
    own = NodeNumbers.of(of.scene).global_nodes("tool", np.arange(of.scene.bodies["tool"].mesh.n_nodes))
    moved[own] = np.cross(turn, nodes[own] - tool.at) + shift
    tool_moves = np.cross(turn, places - tool.at) + shift
    closing = np.einsum("nd,nd->n", points.normal, places @ gradient.T - tool_moves)
    np.testing.assert_allclose(points.gap(moved), points.distance + closing, atol=1e-10)


def test_gaps_between_bodies_change_with_the_motions_of_both() -> None:
    lower = rectangle((-2, -1), (2, -0.1), (7, 2))
    of = slave_of(rectangle((-1, 0), (1, 1), (3, 2)), "y0", Surface("low", "y1"), low=Body(lower, FLAT_STEEL))
    points, nodes = of.at(*anywhere(of)), of.scene.points
    np.testing.assert_allclose(points.distance, 0.1, atol=1e-12)
    gradient, places = RNG.normal(size=(2, 2)), points.own @ nodes
    apart = np.array([0.0, 0.1])
    closing = (places @ gradient.T - (places - apart) @ gradient.T)[:, 1]
    np.testing.assert_allclose(points.gap(nodes @ gradient.T), 0.1 + closing, atol=1e-12)


def test_facets_that_look_away_from_an_obstacle_do_not_meet_it() -> None:
    mesh = block((-1, -1, 0), (1, 1, 1), (2, 2, 1))
    plane = RigidPlane((0.0, 0.0, -0.1), (0.0, 0.0, 1.0))
    for side, meets in (("z0", True), ("z1", False)):
        of = slave_of(mesh, side, plane)
        assert (np.isfinite(of.at(*anywhere(of)).distance) == meets).all()


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_points_of_quadratic_facets_move_with_all_their_nodes(cell: str) -> None:
    mesh = quadratic(rectangle((-1, 0), (1, 1), (3, 2), cell))
    of = slave_of(mesh, "y0", RigidPlane((0.0, -0.1), (0.0, 1.0)))
    at = anywhere(of)
    points, x = of.at(*at), of.scene.points[:, 0]
    np.testing.assert_allclose(points.own @ x**2, (points.own @ x) ** 2, atol=1e-12)
    bent = np.column_stack([np.zeros_like(x), x**2])
    np.testing.assert_allclose(points.gap(bent), 0.1 + (points.own @ x) ** 2, atol=1e-12)
    np.testing.assert_allclose(of.bulge(*at, lambda *places: of.at(*places).gap(bent)), 0.0, atol=1e-12)


def test_a_linear_facet_over_a_ball_bulges_by_its_sagitta() -> None:
    of = slave_of(rectangle((-1, 0), (1, 1), (1, 1)), "y0", RigidSphere((0.0, -2.0), 2.0))
    at = np.array([0]), np.array([[0.0]])
    sagitta = np.sqrt(5.0) - 2.0
    bulge = of.bulge(*at, lambda *places: of.at(*places).distance)
    np.testing.assert_allclose(bulge, [sagitta], rtol=1e-12)


def test_points_of_round_surfaces_lie_on_them() -> None:
    around = RigidSphere((0.0, 1.0), 1.5, hollow=True)
    of = slave_of(half_disc(1.0, 4, symmetry="", grading=0.0), "contact", around)
    points = of.at(*anywhere(of, 30))
    on_chords = np.linalg.norm(points.own @ of.scene.points - (0.0, 1.0), axis=1)
    assert 1.0 - on_chords.min() > 1e-3
    np.testing.assert_allclose(points.distance, 0.5, atol=1e-5)


def test_hanging_nodes_move_with_those_of_the_facets_they_hang_on() -> None:
    mesh = block((-1, -1, 0), (1, 1, 1), (4, 4, 2))
    middle = mesh.points[mesh.cells].mean(axis=1)
    halved = refined(mesh, (middle[:, 0] > 0.0) & (middle[:, 2] < 0.5)).mesh
    of = slave_of(halved, "z0", RigidPlane((0.0, 0.0, -0.1), (0.0, 0.0, 1.0)))
    assert halved.followers is not None
    points = of.at(*anywhere(of, 60))
    moved = np.zeros(len(of.scene.points))
    followed = halved.followers.followed(halved.n_nodes)
    hanging = np.flatnonzero(followed.diagonal() == 0.0)
    assert len(hanging)
    moved[hanging] = 1.0
    assert not (points.own @ moved).any()
    np.testing.assert_allclose(points.own.sum(axis=1), 1.0, atol=1e-12)


def test_points_on_planes_of_symmetry_are_those_of_edges_there() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    pair = ContactPair(Surface("slave", "z0"), RigidSphere((0.0, 0.0, -2.0), 2.0))
    held = [Support("slave", "x0", (0.0, None, None)), Support("slave", "z1", (0.0, 0.0, -0.1))]
    of = InsideOf.of(Scene({"slave": Body(mesh, STEEL)}, held, contacts=[pair]), pair)
    edges = np.array([[-1.0, 0.2], [1.0, 0.2], [0.2, -1.0], [0.2, 1.0]])
    places = of.at(np.zeros(4, dtype=int), edges).own @ of.scene.points
    np.testing.assert_array_equal(of.cut(np.zeros(4, dtype=int), edges)[:, 0], places[:, 0] == 0.0)
    assert not of.cut(np.zeros(1, dtype=int), np.array([[-0.99, 0.99]])).any()


def test_points_are_pressed_in_compared_with_nodes_around_their_facet() -> None:
    of = slave_of(rectangle((-1.5, 0), (1.5, 1), (3, 1)), "y0", RigidPlane((0.0, -0.1), (0.0, 1.0)))
    places = of.slave.points[of.slave.facets][..., 0]
    middle = int(np.flatnonzero(np.abs(places).max(axis=1) < 1.0)[0])
    heights = {-1.5: 1.0, -0.5: 7.0, 0.5: 9.0, 1.5: 2.0}

    def opened(facet: np.ndarray, local: np.ndarray) -> np.ndarray:
        x = np.round(of.at(facet, local).own @ of.scene.points[:, 0], 9)
        return np.array([heights.get(float(at), 5.0) for at in x])

    at = np.array([middle]), np.array([[0.0]])
    assert of.pressed_in(*at, opened) == pytest.approx([5.0 - 1.5])


def test_facets_turn_as_far_as_normals_at_their_nodes_differ() -> None:
    of = slave_of(rectangle((-1.5, 0), (1.5, 1), (3, 1)), "y0", RigidPlane((0.0, -0.1), (0.0, 1.0)))
    normals, angle = -of.slave.normals.copy(), 0.1
    end = int(np.argmax(of.slave.points[:, 0]))
    normals[end] = np.sin(angle), np.cos(angle)
    last = (of.slave.facets == end).any(axis=1)
    expected = np.where(last, 2.0 * np.sin(0.5 * angle), 0.0)
    np.testing.assert_allclose(turning(of.slave, normals), expected, atol=1e-12)


def test_points_inside_facets_lie_in_the_master_by_their_reliefs_and_slide_across_their_normals() -> None:
    """On a ball as wide as a facet, between nodes from which it is seen from the side."""
    of = slave_of(block((-1.5, -1.5, 0), (1.5, 1.5, 1), (3, 3, 1)), "z0", RigidSphere((0.0, 0.0, -0.3), 0.4))
    held = np.zeros(of.scene.points.shape, dtype=bool)
    points, middle = find_contact_points(of.scene, held), np.zeros((1, 2))
    places = of.slave.points[of.slave.facets][..., :2]
    facet = np.flatnonzero((np.abs(places) < 1.0).all(axis=(1, 2)))
    nearest = np.flatnonzero(points.slave == of.nodes[of.slave.facets[facet[0]][0]])
    assert abs(points.normal[nearest[0], 2]) < np.abs(points.normal[nearest[0], :2]).min()
    chosen = InFacets(nearest, facet, middle, np.array([0.02]))
    found = points_inside(of.scene, points, chosen, held, NO_AXES)
    np.testing.assert_array_equal(found.are_inside, nearest)
    place = (found.own[nearest] @ of.scene.points)[0] - (0.0, 0.0, -0.3)  # from the centre of the ball
    np.testing.assert_allclose(place, (0.0, 0.0, 0.3), atol=1e-12)
    away = np.linalg.norm(place)
    np.testing.assert_allclose(found.normal[nearest], [place / away], atol=1e-12)
    np.testing.assert_allclose(found.distance[nearest], away - 0.4, atol=1e-12)
    np.testing.assert_allclose(found.gap[nearest], away - 0.4 + 0.02, atol=1e-12)
    others = np.setdiff1d(np.arange(points.count), nearest)
    np.testing.assert_array_equal(found.gap[others], points.gap[others])
    frame = np.vstack([found.normal[nearest[0]], *found.tangents[nearest[0]].reshape(2, 3)])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(InFacets.of(found).relief, [0.02], atol=1e-12)


@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_points_inside_facets_have_the_planes_of_symmetry_of_their_places(turn: float) -> None:
    """One stands for a node on the plane and lies beside it, one the other way round."""
    mesh, (c, s) = block((0, 0, 0), (2, 2, 1), (2, 2, 1)), (np.cos(turn), np.sin(turn))
    mesh = mesh.moved(mesh.points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
    pair = ContactPair(Surface("slave", "z0"), RigidPlane((0.0, 0.0, -0.1), (0.0, 0.0, 1.0)))
    of = InsideOf.of(Scene({"slave": Body(mesh, STEEL)}, [Roller("slave", "x0")], contacts=[pair]), pair)
    across = np.array([c, s, 0.0])
    ends = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    at = np.repeat(np.arange(4), 4), np.tile(ends, (4, 1))
    on_plane = np.flatnonzero(np.abs(of.at(*at).own @ of.scene.points @ across) < 1e-9)[0]
    facet, end = at[0][on_plane], at[1][on_plane]
    held = np.zeros(of.scene.points.shape, dtype=bool)
    points, nodes = find_contact_points(of.scene, held), of.nodes[of.slave.facets[facet]]
    distance = of.scene.points[nodes] @ across
    which = [np.flatnonzero(points.slave == nodes[k(distance)])[0] for k in (np.argmin, np.argmax)]
    chosen = InFacets(np.array(which), np.full(2, facet), np.array([0.0 * end, end]), np.zeros(2))
    found = points_inside(of.scene, points, chosen, held, NO_AXES)
    marks = [each.symmetric if turn == 0.0 else each.oblique_normals for each in (points, found)]
    assert marks[0] is not None
    assert marks[1] is not None
    for mark, there in zip(marks, ([True, False], [False, True]), strict=True):
        assert [bool(mark[k].any()) for k in which] == there
