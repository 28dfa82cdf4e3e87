"""Control points move a surface along its normals by Bernstein polynomials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import Body, Scene, Support, SurfaceDesign
from fenics_contact.design.design import bernstein, tensor_bernstein
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle, side_of
from tests.shape.blocks import RUBBER, side
from tests.shape.chains import crossed_links

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
    with pytest.raises(
        InvalidInputError, match=r"at least one control point each way, got \(.*\): try \(7, 4\), for"
    ):
        crown(net)


def test_a_net_finer_than_the_mesh_is_refused() -> None:
    counts = crossed_links().first.crown.counts
    assert crown(counts).size == counts[0] * counts[1]
    for net in ((counts[0] + 1, 2), (2, counts[1] + 1)):
        with pytest.raises(InvalidInputError, match="use fewer control points or a finer mesh"):
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
        match=r"9 control points move the nodes in only 5 independent ways \(variables 1, 2, .* use fewer",
    ):
        SurfaceDesign("brick", along, (3, 3)).on(scene)
