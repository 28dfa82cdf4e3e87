"""Faces are found, matched and oriented; volumes and Jacobians agree with what is known of them."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.mesh import boundary_faces, scaled_jacobian
from fenics_contact.mesh.cell_types import HEXAHEDRON
from fenics_contact.mesh.faces import cell_faces, match_faces, neighbours, number_faces, orient, vector_areas
from fenics_contact.mesh.quality import cell_volumes, jacobian_ratio, jacobians, volume

CELLS = ["hexahedron", "tetrahedron"]
RNG = np.random.default_rng(5)


def shaken(cell: str) -> tuple[np.ndarray, np.ndarray]:
    """A block whose inner and outer nodes are all moved a little."""
    mesh = block((0, 0, 0), (3, 2, 2), (3, 2, 2), cell)
    return mesh.points + np.random.default_rng(1).uniform(-0.1, 0.1, mesh.points.shape), mesh.cells


@pytest.mark.parametrize("cell", CELLS)
def test_local_faces_point_out_of_their_cell(cell: str) -> None:
    points, cells = shaken(cell)
    faces = cell_faces(cells)
    areas = vector_areas(points, faces.reshape(-1, faces.shape[2])).reshape(*faces.shape[:2], 3)
    outward = points[faces].mean(axis=2) - points[cells].mean(axis=1, keepdims=True)
    assert np.sum(areas * outward, axis=-1).min() > 0.0


@pytest.mark.parametrize("cell", CELLS)
def test_the_boundary_is_watertight(cell: str) -> None:
    points, cells = shaken(cell)
    facets, _ = boundary_faces(cells)
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2)
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == edges.shape[0], "an edge is run through twice in the same direction"
    assert there == {(b, a) for a, b in there}, "an edge is not met from the other side"
    assert vector_areas(points, facets).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_the_boundary_knows_its_cells() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (3, 3, 3))
    facets, owner = boundary_faces(mesh.cells)
    assert facets.shape == (54, 4)
    assert all(set(facet) <= set(mesh.cells[cell]) for facet, cell in zip(facets, owner, strict=True))
    assert 13 not in owner, "the cell in the middle has no free face"


def test_every_inner_face_makes_a_pair_of_neighbours() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (4, 3, 2))
    pairs = neighbours(mesh.cells)
    assert pairs.shape[0] == 3 * 3 * 2 + 4 * 2 * 2 + 4 * 3 * 1
    assert mesh.grid is not None
    assert np.all(np.abs(mesh.grid[pairs[:, 0]] - mesh.grid[pairs[:, 1]]).sum(axis=1) == 1)


def test_a_face_of_three_cells_is_refused() -> None:
    cells = block((0, 0, 0), (1, 1, 1), (2, 1, 1)).cells
    with pytest.raises(InvalidInputError, match=r"at most 2 cells, the face with nodes .* belongs to 3"):
        neighbours(np.vstack([cells, cells[:1]]))


def test_equal_faces_get_equal_numbers_whatever_their_order() -> None:
    faces = np.array([[7, 3, 1, 9], [1, 3, 7, 8], [9, 1, 7, 3], [2**30, 3, 1, 9]])
    numbers = number_faces(faces)
    assert numbers[0] == numbers[2]
    assert sorted(set(numbers.tolist())) == [0, 1, 2]


def test_a_face_is_found_among_others_or_not_at_all() -> None:
    faces = np.array([[4, 5, 6], [1, 2, 9]])
    assert match_faces(faces, np.array([[0, 1, 2], [6, 4, 5]])).tolist() == [1, -1]


@pytest.mark.parametrize("cell", CELLS)
def test_shuffled_facets_are_turned_outwards(cell: str) -> None:
    mesh = block((0, 0, 0), (3, 2, 2), (3, 2, 2), cell)
    facets = mesh.surfaces["y1"]
    oriented = orient(mesh.cells, RNG.permuted(facets, axis=1))
    assert vector_areas(mesh.points, oriented).sum(axis=0) == pytest.approx([0.0, 6.0, 0.0])


def test_a_facet_that_is_no_boundary_face_is_refused() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    with pytest.raises(InvalidInputError, match=r"1 of 2 are not, first facet 1 with nodes \[0, 1, 2, 5\]"):
        orient(mesh.cells, np.vstack([mesh.surfaces["x0"][:1], [[0, 1, 2, 5]]]))


def test_the_jacobian_is_the_derivative_of_the_trilinear_map() -> None:
    points, cells = shaken("hexahedron")

    def image(position: np.ndarray) -> np.ndarray:
        weights = np.prod(np.where(HEXAHEDRON.vertices == 1.0, position, 1.0 - position), axis=1)
        return np.asarray(weights @ points[cells])

    position, h = np.array([0.3, 0.8, 0.1]), 1e-5
    columns = [(image(position + h * e) - image(position - h * e)) / (2 * h) for e in np.eye(3)]
    expected = np.linalg.det(np.stack(columns, axis=-1))
    assert jacobians(points, cells, position[None])[:, 0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("cell", CELLS)
def test_the_volume_agrees_with_the_divergence_theorem(cell: str) -> None:
    points, cells = shaken(cell)
    facets, _ = boundary_faces(cells)
    corners = points[facets]
    if cell == "tetrahedron":
        flux = np.sum(corners.mean(axis=1) * vector_areas(points, facets), axis=1)
    else:  # bilinear facets: 2 x 2 Gauss points integrate the quadratic-by-quadratic flux exactly
        flux = np.zeros(facets.shape[0])
        for u in (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)):
            for v in (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)):
                a, b, c, d = corners.transpose(1, 0, 2)
                x = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
                x_u = (1 - v) * (b - a) + v * (c - d)
                x_v = (1 - u) * (d - a) + u * (c - b)
                flux += 0.25 * np.sum(x * np.cross(x_u, x_v), axis=1)
    assert volume(points, cells) == pytest.approx(flux.sum() / 3.0, rel=1e-13)


def test_a_box_has_the_best_quality_there_is() -> None:
    mesh = block((0, 0, 0), (1, 2, 3), (1, 1, 1))
    assert scaled_jacobian(mesh.points, mesh.cells) == pytest.approx([1.0])
    assert jacobian_ratio(mesh.points, mesh.cells) == pytest.approx([1.0])
    assert cell_volumes(mesh.points, mesh.cells) == pytest.approx([6.0])


def test_a_regular_tetrahedron_has_the_best_quality_there_is() -> None:
    points = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    cells = np.array([[0, 2, 1, 3]])
    assert jacobians(points, cells)[0, 0] > 0.0
    assert scaled_jacobian(points, cells) == pytest.approx([1.0])
    assert scaled_jacobian(points, cells[:, [1, 0, 2, 3]]) == pytest.approx([-1.0])


@pytest.mark.parametrize("cell", CELLS)
def test_a_mirrored_cell_has_negative_quality(cell: str) -> None:
    points, cells = shaken(cell)
    mirrored = points * [1.0, 1.0, -1.0]
    assert scaled_jacobian(points, cells).min() > 0.0
    assert scaled_jacobian(mirrored, cells).max() < 0.0
    assert jacobian_ratio(mirrored, cells).max() < 0.0
    assert volume(mirrored, cells) == pytest.approx(-volume(points, cells))
