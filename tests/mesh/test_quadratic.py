"""Quadratic cells: numbered as VTK and dolfinx number them, closed, as curved as their surfaces."""

from __future__ import annotations

import basix
import numpy as np
import pytest
import vtk

from fenics_contact import BodyMesh, _dolfinx
from fenics_contact._dolfinx.cells import NODE_ORDER, shape
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import boundary_faces, in_vtk_order, quadratic
from fenics_contact.mesh.cell_types import CELL_TYPES, shape_gradients, shape_values
from fenics_contact.mesh.faces import corners_of, vector_areas
from fenics_contact.shapes import Sphere

QUADRATIC = ["triangle6", "quadrilateral9", "tetrahedron10", "hexahedron27"]
VTK_CELL = {"triangle6": 22, "quadrilateral9": 28, "tetrahedron10": 24, "hexahedron27": 29}


def linear_mesh(cell: str) -> BodyMesh:
    if CELL_TYPES[cell].dim == 3:
        return block((0, 0, 0), (2, 1, 1), (3, 2, 2), cell=shape(cell))
    return rectangle((0, 0), (2, 1), (3, 2), cell=shape(cell))


@pytest.mark.parametrize("cell", QUADRATIC)
def test_nodes_are_numbered_as_vtk_and_dolfinx_number_them(cell: str) -> None:
    kind = CELL_TYPES[cell]
    of_vtk = vtk.vtkGenericCell.InstantiateCell(VTK_CELL[cell])
    places = [of_vtk.GetParametricCoords()[i] for i in range(3 * len(kind.nodes))]
    np.testing.assert_allclose(np.reshape(places, (-1, 3))[:, : kind.dim], kind.nodes)
    lagrange = basix.create_element(
        basix.ElementFamily.P, getattr(basix.CellType, shape(cell)), 2, basix.LagrangeVariant.equispaced
    )
    np.testing.assert_allclose(kind.nodes[NODE_ORDER[cell]], lagrange.points)


@pytest.mark.parametrize("cell", list(CELL_TYPES))
def test_shape_functions_are_one_on_their_node_and_reproduce_polynomials(cell: str) -> None:
    kind, rng = CELL_TYPES[cell], np.random.default_rng(0)
    np.testing.assert_allclose(shape_values(kind, kind.nodes), np.eye(len(kind.nodes)), atol=1e-14)
    positions = rng.random((5, kind.dim)) / kind.dim
    matrix, vector = rng.random((kind.dim, kind.dim)), rng.random(kind.dim)
    matrix = (matrix + matrix.T) * (kind.order - 1)

    def polynomial(x: np.ndarray) -> np.ndarray:
        return np.asarray(0.5 * np.einsum("ni,ij,nj->n", x, matrix, x) + x @ vector)

    at_nodes = polynomial(kind.nodes)
    np.testing.assert_allclose(shape_values(kind, positions) @ at_nodes, polynomial(positions), atol=1e-14)
    slopes = np.einsum("mkd,k->md", shape_gradients(kind, positions), at_nodes)
    np.testing.assert_allclose(slopes, positions @ matrix + vector, atol=1e-13)
    assert shape_values(kind, positions[:0]).shape == (0, len(kind.nodes))
    assert shape_gradients(kind, positions[:0]).shape == (0, len(kind.nodes), kind.dim)


@pytest.mark.parametrize("cell", QUADRATIC)
def test_a_quadratic_mesh_has_the_surfaces_and_the_volume_of_the_linear_one(cell: str) -> None:
    linear = linear_mesh(cell)
    mesh = quadratic(linear)
    assert (mesh.cell_type, mesh.order, linear.order) == (cell, 2, 1)
    assert mesh.n_cells == linear.n_cells
    assert mesh.volume == pytest.approx(2.0)
    np.testing.assert_array_equal(mesh.points[: linear.n_nodes], linear.points)
    lattice = np.unique(np.round(mesh.points * [6, 4, 4][: mesh.dim]), axis=0)
    assert len(lattice) == mesh.n_nodes == np.prod([7, 5, 5][: mesh.dim])
    for name, facets in linear.surfaces.items():
        there = mesh.surfaces[name]
        assert there.shape == (len(facets), CELL_TYPES[cell].faces.shape[1])
        np.testing.assert_array_equal(
            np.sort(corners_of(there, mesh.dim)[np.lexsort(np.sort(corners_of(there, mesh.dim)).T)]),
            np.sort(facets[np.lexsort(np.sort(facets).T)]),
        )
    faces, _ = boundary_faces(mesh.cells, mesh.dim)
    np.testing.assert_allclose(vector_areas(mesh.points, faces).sum(axis=0), 0.0, atol=1e-14)


@pytest.mark.parametrize("cell", QUADRATIC)
def test_linear_pieces_fill_the_mesh_and_keep_its_names(cell: str) -> None:
    linear = linear_mesh(cell)
    half = {"left": np.arange(4), "right": np.arange(4, linear.n_cells)}
    mesh = quadratic(BodyMesh(linear.points, linear.cells, linear.surfaces, regions=half))
    pieces = mesh.linear
    assert pieces is mesh.linear, "made once"
    assert linear.linear is linear
    checked = BodyMesh(pieces.points, pieces.cells, pieces.surfaces, regions=pieces.regions)
    assert checked.cell_type == shape(cell)
    assert checked.n_cells == 2**mesh.dim * mesh.n_cells
    assert checked.volume == pytest.approx(mesh.volume)
    assert [len(cells) // 2**mesh.dim for cells in pieces.regions.values()] == [4, mesh.n_cells - 4]
    moved = mesh.moved(2.0 * mesh.points)
    assert moved.linear.volume == pytest.approx(2.0**mesh.dim * mesh.volume), "not the pieces of before"


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_under_a_curved_edge_the_area_converges_with_the_fourth_power(cell: str) -> None:
    exact, errors = np.pi / 3 + np.sqrt(3) / 2, []
    for n in (2, 4):
        flat = rectangle((0, 0), (1, 1), (n, n), cell=cell)
        linear = flat.moved(flat.points * np.sqrt(4 - flat.points[:, :1] ** 2) ** [0, 1])
        linear = linear.with_shapes({"y1": Sphere((0.0, 0.0), 2.0)})
        errors.append([mesh.volume - exact for mesh in (linear, quadratic(linear))])
    rates = np.log2(np.abs(errors[0]) / np.abs(errors[1]))
    assert rates[0] == pytest.approx(2.0, abs=0.1)
    assert rates[1] > 3.5


def under_an_arc(centre: float, *, hollow: bool = False) -> BodyMesh:
    """A thin rectangle whose upper corners lie on a circle of radius 2.5 about (2, centre)."""
    thin = rectangle((0, 0), (4, 0.3), (1, 1))
    return thin.with_shapes({"y1": Sphere((2.0, centre), 2.5, hollow=hollow)})


def test_thin_cells_keep_their_shape_under_a_curved_surface() -> None:
    thin = under_an_arc(-1.2)
    mesh = quadratic(thin)
    assert mesh.points[:, 1].max() == pytest.approx(1.3)
    assert mesh.volume > thin.volume + 1.0


def test_midpoints_that_turn_a_cell_inside_out_are_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"positive Jacobian, .*: refine the mesh along its curved"):
        quadratic(under_an_arc(1.8, hollow=True))


def test_quadratic_cells_do_not_become_quadratic_again() -> None:
    with pytest.raises(InvalidInputError, match="needs linear cells, got quadratic quadrilaterals"):
        quadratic(quadratic(rectangle((0, 0), (1, 1), (1, 1))))


@pytest.mark.parametrize("cell", QUADRATIC)
def test_another_order_of_nodes_is_told_which_is_expected(cell: str) -> None:
    mesh, corners = quadratic(linear_mesh(cell)), len(CELL_TYPES[cell].edges)
    other = mesh.cells.copy()
    other[:, corners : corners + 2] = other[:, [corners + 1, corners]]
    words = rf"in the order of VTK, the {corners} corners and then .* corners 0-1, 1-2, .* order \[0, 1, 2.*"
    with pytest.raises(InvalidInputError, match=words + rf" {corners + 1}, {corners}"):
        BodyMesh(mesh.points, other)
    points, cells = in_vtk_order(mesh.points, other)
    np.testing.assert_array_equal(BodyMesh(points, cells).cells, mesh.cells)


def test_faces_of_quadratic_tetrahedra_are_known_by_their_corners() -> None:
    """Whichever corner they begin with: two cells list a face between them from different corners."""
    mesh = quadratic(linear_mesh("tetrahedron10"))
    assert len(boundary_faces(mesh.cells)[0]) == len(boundary_faces(linear_mesh("tetrahedron10").cells)[0])


def test_facets_with_other_midpoints_than_the_cells_are_refused() -> None:
    mesh = quadratic(rectangle((0, 0), (1, 1), (2, 1)))
    facets = mesh.surfaces["y0"].copy()
    facets[:, 2] = facets[::-1, 2]
    with pytest.raises(
        InvalidInputError, match=r"corners of each facet, then the midpoints .* 2 of 2 do not"
    ):
        BodyMesh(mesh.points, mesh.cells, {"y0": facets})
    turned = mesh.surfaces["y0"][:, [1, 0, 2]]
    with pytest.raises(InvalidInputError, match="with the normal pointing out of the body, 2 of 2"):
        BodyMesh(mesh.points, mesh.cells, {"y0": turned})


def test_a_mesh_of_dolfinx_has_the_quadratic_nodes() -> None:
    mesh = quadratic(block((0, 0, 0), (2, 1, 1), (2, 1, 1)))
    own = _dolfinx.local_mesh(mesh.points, mesh.cells, mesh.cell_type)
    space = _dolfinx.coefficient(own, "u").function_space
    nodes, dofs = _dolfinx.node_dofs(space)
    place = space.tabulate_dof_coordinates()[dofs]
    np.testing.assert_allclose(place, mesh.points[nodes], atol=1e-14)


def test_linear_cells_have_a_boundary_of_their_own() -> None:
    mesh = quadratic(block((0, 0, 0), (1, 1, 1), (2, 1, 1)))
    assert mesh.boundary[0].shape == (10, 9)
    assert mesh.linear.boundary[0].shape == (40, 4)
    np.testing.assert_array_equal(mesh.linear.boundary[0], boundary_faces(mesh.linear.cells)[0])
