"""Prisms, pyramids, serendipity cells and several shapes in one body, from gmsh and by meshio."""

from __future__ import annotations

from collections.abc import Callable

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, Traction, solve_scene
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import boundary_faces, completed, quadratic, serendipity
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.collapsed import SHAPES, by_shape
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.mesh.quadratic_nodes import ordered
from fenics_contact.output.paraview import write_vtu
from fenics_contact.pictures import plot_field
from fenics_contact.pictures.section import cells_of, linear
from fenics_contact.readers.bodies import TaggedMesh, bodies_of
from fenics_contact.readers.meshio import from_meshio, read_mesh
from tests.fem.graded import pulled
from tests.fem.mixed_cells import mixed_bar
from tests.fem.several_ranks import displacement_of
from tests.readers.four_boxes import bars_of_all_orders, displacement_on


@pytest.fixture(scope="module")
def bars() -> dict[str, BodyMesh]:
    return bars_of_all_orders()


def test_a_model_of_all_shapes_is_one_body(bars: dict[str, BodyMesh]) -> None:
    first = bars["linear"]
    assert list(by_shape(first.cells, 3)) == ["tetrahedron", "pyramid", "prism", "hexahedron"]
    assert first.volume == pytest.approx(4.0, rel=1e-12)
    assert sorted(first.surfaces) == ["x0", "x1", "y0", "y1", "z0", "z1"]
    assert bars["quadratic"].order == 2
    assert not bars["quadratic"].centres
    assert bars["serendipity"].centres
    assert bars["serendipity"].n_nodes == bars["quadratic"].n_nodes


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_a_model_of_all_shapes_has_an_even_stress_on_every_number_of_ranks(
    bars: dict[str, BodyMesh], ranks: int, mpirun: Callable[..., str]
) -> None:
    """Linear, quadratic and serendipity, in five subdomains."""
    exact = np.concatenate([mesh.points * [0.01, -0.003, -0.003] for mesh in bars.values()])
    if ranks == 1:
        answer = np.array(displacement_on(MPI.COMM_SELF, bars))
    else:
        answer = displacement_of("tests.readers.four_boxes", ranks, mpirun)
    np.testing.assert_allclose(answer, exact, atol=1e-10 * np.abs(exact).max())


def as_meshio(mesh: BodyMesh, lacking: bool) -> meshio.Mesh:
    """Return a body in the order of VTK, whose prisms begin with the other triangle, without centres."""
    names = {"tetrahedron": "tetra", "pyramid": "pyramid", "prism": "wedge", "hexahedron": "hexahedron"}
    blocks = []
    for shape, (_, own) in by_shape(mesh.cells, 3).items():
        count = SHAPES[shape].counts[1] if lacking else own.shape[1]
        own = own[:, SHAPES[shape].mirror(count)] if shape == "prism" else own[:, :count]
        blocks.append((f"{names[shape]}{count if mesh.order > 1 else ''}", own))
    return meshio.Mesh(mesh.points, blocks)


def test_prisms_of_either_order_are_read_by_meshio() -> None:
    bar = mixed_bar()
    found = from_meshio(as_meshio(bar, False))["mesh"]
    assert found.cells_in_words == bar.cells_in_words
    assert found.volume == pytest.approx(2.0, rel=1e-12)


def test_cells_of_20_nodes_stay_as_they_are_and_may_be_completed() -> None:
    bar = serendipity(quadratic(block((0, 0, 0), (2, 1, 1), (2, 1, 1))))
    lean = meshio.Mesh(bar.points[:], [("hexahedron20", bar.cells[:, :20])])
    found = from_meshio(lean)["mesh"]
    assert found.cells_in_words == "2 serendipity hexahedra"
    assert found.n_nodes == bar.n_nodes
    assert completed(found).cells_in_words == "2 quadratic hexahedra"


def test_prisms_of_15_nodes_follow_in_three_centres() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
    middles = [corners[sorted(each)].mean(axis=0) for each in SHAPES["prism"].sets(15)[6:]]
    order = [*range(6), *np.random.default_rng(0).permutation(9) + 6]  # any order is put right
    points = np.vstack([corners, middles])
    tagged = TaggedMesh(
        "a test", points, {"wedge": ordered(points, np.array([order]), SHAPES["prism"])},
        {"lug": {"wedge": np.array([0])}}, {}, ("set", "surface"),
    )  # fmt: skip
    lug = bodies_of(tagged)["lug"]
    assert lug.cells_in_words == "1 serendipity prism"
    assert len(lug.centres.nodes) == 3
    assert lug.volume == pytest.approx(0.5)


def test_files_have_all_shapes_and_are_read_again(tmp_path) -> None:  # type: ignore[no-untyped-def]
    mesh = mixed_bar()
    scene = Scene(
        {"bar": Body(mesh, IsotropicElasticity(100.0, 0.3))},
        [Support("bar", "x0")],
        [Traction("bar", "x1", (0.0, 0.0, 0.1))],
    )
    state = solve_scene(scene, MPI.COMM_SELF)
    write_vtu(state, tmp_path)
    read = read_mesh(tmp_path / "state_bar.vtu", labels="pieces")
    (again,) = read.values()
    assert again.volume == pytest.approx(2.0, rel=1e-12)
    assert {name: len(mine) for name, (mine, _) in by_shape(again.cells, 3).items()} == {
        name: len(mine) for name, (mine, _) in by_shape(mesh.cells, 3).items()
    }
    grid = state.to_pyvista()["bar"]
    assert sorted(np.unique(grid.celltypes)) == [10, 12, 13, 14]
    assert grid.compute_cell_sizes()["Volume"].sum() == pytest.approx(2.0)
    np.testing.assert_allclose(grid.cell_data["von_mises"], state.gather_von_mises("bar"))
    drawn = linear("bar", grid)
    assert np.unique(drawn.celltypes).tolist() == [12]
    assert drawn.n_cells == mesh.n_cells
    skin, _ = boundary_faces(cells_of(drawn))
    np.testing.assert_allclose(vector_areas(np.asarray(drawn.points), skin).sum(axis=0), 0.0, atol=1e-12)


def test_pictures_of_quadratic_pyramids_have_a_colour_for_each_of_their_pieces(tmp_path) -> None:  # type: ignore[no-untyped-def]
    mesh = quadratic(mixed_bar())
    scene = pulled(mesh, IsotropicElasticity(100.0, 0.3))
    state = solve_scene(scene, MPI.COMM_SELF)
    own = {"bar": np.arange(mesh.n_cells, dtype=float)}
    assert plot_field(state, own, tmp_path / "cells.png").path.exists()
