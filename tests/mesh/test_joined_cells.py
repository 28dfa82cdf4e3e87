"""Cells of several shapes as one array: volumes, faces, quality, linear pieces, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import boundary_faces, joined_cells, quadratic, scaled_jacobian
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.collapsed import SHAPES, by_shape, collapse, places_of
from fenics_contact.mesh.faces import neighbours, vector_areas
from tests.fem.mixed_cells import mixed_bar, mixed_plate

STRAIGHT = {
    "triangle": ([[0, 0], [1, 0], [0, 1]], 1 / 2),
    "quadrilateral": ([[0, 0], [1, 0], [1, 1], [0, 1]], 1.0),
    "tetrahedron": ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], 1 / 6),
    "pyramid": ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], 1 / 3),
    "prism": ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], 1 / 2),
    "hexahedron": ([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], 1.0),
}


def one_cell(shape: str, order: int) -> BodyMesh:
    points, _ = STRAIGHT[shape]
    dim = len(points[0])
    mesh = BodyMesh(points, joined_cells({shape: [list(range(len(points)))]}, dim))
    return mesh if order == 1 else quadratic(mesh)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", list(STRAIGHT))
def test_a_cell_has_its_volume_its_closed_boundary_and_all_polynomials(shape: str, order: int) -> None:
    mesh = one_cell(shape, order)
    assert mesh.volume == pytest.approx(STRAIGHT[shape][1], rel=1e-13)
    facets, _ = boundary_faces(mesh.cells, mesh.dim)
    vertices, edges = SHAPES[shape].corners, len(SHAPES[shape].edges)
    assert len(facets) == (2 - vertices + edges if mesh.dim == 3 else edges)  # Euler
    np.testing.assert_allclose(vector_areas(mesh.points, facets).sum(axis=0), 0.0, atol=1e-14)
    # Values of polynomials at the nodes of the hexahedron follow from those at the nodes of the cell.
    x = places_of(mesh.points, mesh.cells)[0]
    how = collapse(shape, order)
    own = mesh.points[mesh.cells[0][how.places]]
    for i in range(mesh.dim):
        np.testing.assert_allclose(how.values @ own[:, i], x[:, i], atol=1e-14)
        for j in range(mesh.dim if order == 2 else 0):
            np.testing.assert_allclose(how.values @ (own[:, i] * own[:, j]), x[:, i] * x[:, j], atol=1e-14)
    assert len(how.places) == SHAPES[shape].counts[0 if order == 1 else 2]


def test_a_mesh_of_all_shapes_has_neighbours_and_linear_pieces() -> None:
    bar = mixed_bar()
    assert bar.cells_in_words == "40 tetrahedra, 28 pyramids, 8 prisms and 4 hexahedra"
    inside = sum(faces * count for faces, count in ((4, 40), (5, 28), (5, 8), (6, 4)))
    facets, _ = boundary_faces(bar.cells)
    assert 2 * len(neighbours(bar.cells)) == inside - len(facets)
    assert bar.surfaces["x0"].shape == (4, 4)
    assert bar.surfaces["x1"].shape == (8, 3)
    fine = quadratic(bar)
    assert fine.linear.volume == pytest.approx(2.0, rel=1e-13)
    counts = np.bincount(fine.cells_cut)
    for name, (mine, _) in by_shape(fine.cells, 3).items():
        assert (counts[mine] == (10 if name == "pyramid" else 8)).all()
    assert fine.linear.surfaces["z1"].shape == (4 * (8 + 2 * 4), 3)
    np.testing.assert_allclose(vector_areas(fine.points, fine.linear.surfaces["z1"]).sum(axis=0), [0, 0, 2.0])
    plate = quadratic(mixed_plate())
    assert plate.linear.volume == pytest.approx(2.0, rel=1e-13)
    assert plate.surfaces["y0"].shape == (5, 3)


def test_the_quality_of_a_regular_cell_is_one() -> None:
    h, root = np.sqrt(0.75), np.sqrt(0.5)
    prism = np.array([[0, 0, 0], [1, 0, 0], [0.5, h, 0], [0, 0, 1], [1, 0, 1], [0.5, h, 1]])
    pyramid = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, root]])
    for name, points in (("prism", prism), ("pyramid", pyramid)):
        cells = joined_cells({name: [list(range(len(points)))]})
        assert scaled_jacobian(points, cells)[0] == pytest.approx(1.0)
        leaning = points + points[:, 2:] * [0.8, 0.0, 0.0]
        assert 0.0 < scaled_jacobian(leaning, cells)[0] < 0.9


def test_an_inverted_cell_is_named() -> None:
    bar = mixed_bar()
    prism = by_shape(bar.cells, 3)["prism"][0][3]
    cells = bar.cells.copy()
    cells[prism] = cells[prism][[4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(
        InvalidInputError, match=rf"1 of 80 are inverted or flat; the worst is cell {prism} at"
    ):
        BodyMesh(bar.points, cells)


def test_other_repetitions_and_numbers_of_nodes_are_refused() -> None:
    points = np.array(STRAIGHT["hexahedron"][0], dtype=float)[:7]
    with pytest.raises(
        InvalidInputError, match=r"must be prisms, pyramids or simplices as joined_cells .* cell 0"
    ):
        BodyMesh(points, [[0, 1, 2, 3, 4, 5, 6, 6]])
    with pytest.raises(
        InvalidInputError, match=r"shapes of cells in 3 dimensions must be among .* got 'wedge'"
    ):
        joined_cells({"wedge": [[0, 1, 2, 3, 4, 5]]})
    with pytest.raises(InvalidInputError, match=r"prisms have 6 or 18 nodes, got .* in_vtk_order"):
        joined_cells({"prism": [list(range(15))]})
    with pytest.raises(InvalidInputError, match=r"needs cells all linear or all quadratic, got both"):
        joined_cells({"prism": [list(range(6))], "tetrahedron": [list(range(10))]})
    with pytest.raises(InvalidInputError, match=r"surface 's' must consist of boundary faces"):
        BodyMesh(mixed_bar().points, mixed_bar().cells, {"s": [[0, 1, 20]]})


def test_facets_may_be_given_by_their_own_nodes() -> None:
    bar = mixed_bar()
    top = bar.surfaces["z1"]
    triangles = top[top[:, 2] == top[:, 3]]
    same = BodyMesh(
        bar.points, bar.cells, {"t": triangles[:, :3], "q": top[top[:, 2] != top[:, 3]], "both": top}
    )
    assert same.surfaces["t"].shape == (8, 3)
    assert same.surfaces["q"].shape == (4, 4)
    assert same.surfaces["both"].shape == (12, 4)
