"""Sides of structured meshes that a design may move by name."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, half_disc, hemisphere, rectangle, side_of
from fenics_contact.mesh import quadratic

BOX = block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (8, 4, 2))


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize(
    ("name", "axis", "counts"), [("z1", 2, (9, 5)), ("x0", 0, (5, 3)), ("y1", 1, (9, 3))]
)
def test_a_side_of_a_block_is_a_grid(cell: str, name: str, axis: int, counts: tuple[int, int]) -> None:
    mesh = block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (8, 4, 2), cell)
    side = side_of(mesh, name)
    assert side.counts == counts
    np.testing.assert_array_equal(np.sort(side.nodes), np.unique(mesh.surfaces[name]))
    outward = np.zeros(3)
    outward[axis] = 1.0 if name.endswith("1") else -1.0
    np.testing.assert_allclose(side.directions, np.tile(outward, (len(side.nodes), 1)), atol=1e-14)
    places = np.delete(mesh.points[side.nodes], axis, axis=1)
    np.testing.assert_allclose(side.parameters, places / places.max(axis=0), atol=1e-14)
    first = side.parameters[:, 0].reshape(counts)
    assert np.ptp(first, axis=1).max() < 1e-12
    assert np.all(np.diff(first[:, 0]) > 0.0)


def test_nodes_of_a_bent_side_move_along_its_normals() -> None:
    points = BOX.points.copy()
    points[:, 2] += 0.1 * points[:, 0] * points[:, 2]
    side = side_of(BOX.moved(points), "z1")
    np.testing.assert_allclose(
        side.directions, np.tile([-0.1, 0.0, 1.0] / np.sqrt(1.01), (45, 1)), atol=1e-12
    )


def without_a_facet() -> BodyMesh:
    return BodyMesh(BOX.points, BOX.cells, {"z1": BOX.surfaces["z1"][[0, 5]]})


def roof() -> BodyMesh:
    points = BOX.points.copy()
    points[:, 2] += 2.0 * np.abs(points[:, 0] - 2.0)
    return BOX.moved(points)


@pytest.mark.parametrize(
    ("mesh", "name"),
    [
        (BOX, "top"), (without_a_facet(), "z1"),
        (hemisphere(1.0, 4), "contact"), (roof(), "z1"),
    ],
    ids=["no such surface", "two facets apart", "ball", "roof"],
)  # fmt: skip
def test_what_is_no_grid_is_refused_with_what_is_needed(mesh: BodyMesh, name: str) -> None:
    with pytest.raises(
        InvalidInputError, match=rf"rectangular grid seen along x, y or z, .* got '{name}' of a"
    ):
        side_of(mesh, name)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_side_of_quadratic_cells_is_a_grid_of_twice_as_many(cell: str) -> None:
    mesh = quadratic(block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (4, 2, 1), cell))
    side = side_of(mesh, "z1")
    assert side.counts == (9, 5)
    np.testing.assert_array_equal(np.sort(side.nodes), np.unique(mesh.surfaces["z1"]))
    np.testing.assert_allclose(side.parameters * (4.0, 2.0), mesh.points[side.nodes, :2], atol=1e-14)


@pytest.mark.parametrize("order", [1, 2])
def test_a_curve_runs_by_its_length_with_the_body_on_its_left(order: int) -> None:
    mesh = half_disc(2.0, 4, symmetry="", grading=0.0)
    arc = side_of(quadratic(mesh) if order == 2 else mesh, "contact")
    mesh = quadratic(mesh) if order == 2 else mesh
    points = mesh.points[arc.nodes]
    assert arc.counts == (len(arc.nodes),) == (8 * order + 1,)
    assert len(np.unique(arc.nodes)) == len(arc.nodes)
    angle = np.arctan2(points[:, 0], 2.0 - points[:, 1])
    assert np.all(np.diff(angle) > 0.0), "from left to right below the disc"
    np.testing.assert_allclose(arc.parameters[:, 0], (angle - angle[0]) / np.ptp(angle), atol=5e-3)
    outward = (points - (0.0, 2.0)) / 2.0
    np.testing.assert_allclose(arc.directions[1:-1], outward[1:-1], atol=2e-2)
    np.testing.assert_allclose(np.linalg.norm(arc.directions, axis=1), 1.0)


def ring() -> BodyMesh:
    """A square with a square hole, whose edge is closed."""
    mesh = rectangle((0.0, 0.0), (3.0, 3.0), (3, 3))
    cells = np.delete(mesh.cells, 4, axis=0)
    hole = mesh.cells[4][[0, 3, 2, 1]]
    return BodyMesh(mesh.points, cells, {"hole": np.column_stack([hole, np.roll(hole, -1)])})


def in_two_pieces() -> BodyMesh:
    mesh = rectangle((0.0, 0.0), (3.0, 1.0), (3, 1))
    return BodyMesh(
        mesh.points, mesh.cells, {"ends": np.concatenate([mesh.surfaces["x0"], mesh.surfaces["x1"]])}
    )


@pytest.mark.parametrize(
    ("mesh", "name"),
    [(ring(), "hole"), (in_two_pieces(), "ends"), (ring(), "edge")],
    ids=["closed", "two pieces", "none"],
)
def test_what_is_no_curve_with_two_ends_is_refused(mesh: BodyMesh, name: str) -> None:
    with pytest.raises(InvalidInputError, match=rf"one in one piece with two ends, got '{name}' of a mesh"):
        side_of(mesh, name)
