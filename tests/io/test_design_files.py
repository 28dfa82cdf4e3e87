"""Designed surfaces as tables and triangles: read back they are the surface."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactProblem, Scene, ShapeProblem, SurfaceDesign, read_field
from fenics_contact.design import StrainEnergy
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.output import write_design_table, write_stl
from tests.io.designed_block import lid, variables


def table_of(path: Path) -> dict[str, np.ndarray]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    numbers = np.array([line.split(",") for line in lines[1:]], dtype=float)
    return dict(zip(lines[0].split(","), numbers.T, strict=True))


@pytest.mark.parametrize("dim", [2, 3])
def test_a_table_has_the_nodes_as_the_design_moves_them(dim: int, tmp_path: Path) -> None:
    problem, alpha = lid(dim), variables(dim)
    table = table_of(write_design_table(problem, alpha, tmp_path / "lid.csv", length="m"))
    axes, nodes = "xyz"[:dim], problem.designs[0].lattice.nodes
    moved = np.column_stack([table[f"{axis}_moved"] for axis in axes])
    before = np.column_stack([table[axis] for axis in axes])
    assert np.ptp(table["movement"]) > 0.05
    np.testing.assert_allclose(moved, problem.points_of(alpha)["pad"][nodes], atol=1e-14)
    np.testing.assert_allclose(before, problem.scene.bodies["pad"].mesh.points[nodes], atol=1e-14)
    assert "lengths in m," in (tmp_path / "lid.csv").read_text()


def test_a_table_on_lines_of_its_own_lies_on_the_polynomial_of_the_net(tmp_path: Path) -> None:
    path = write_design_table(lid(), variables(), tmp_path / "lid.csv", lines=(7, 3))
    table = table_of(path)
    np.testing.assert_allclose(table["s"], np.repeat(np.arange(7) / 6, 3))
    np.testing.assert_allclose(table["x"], 4 * table["s"], atol=1e-14)
    design = lid().designs[0]
    at_corners = table["movement"][[0, 2, 18, 20]]
    np.testing.assert_allclose(at_corners, variables().reshape(design.counts)[[0, 0, -1, -1], [0, -1, 0, -1]])
    field = read_field(path, "movement")
    np.testing.assert_allclose(field.values, table["movement"])


def test_an_stl_file_is_the_closed_boundary_of_the_moved_body(tmp_path: Path) -> None:
    problem, alpha = lid(cell="tetrahedron"), variables()
    read = meshio.read(write_stl(problem, alpha, tmp_path / "pad.stl"))
    corners = read.points[read.cells_dict["triangle"]].astype(float)
    volume = np.linalg.det(corners).sum() / 6
    assert abs(volume - 8.0) > 1e-3
    assert volume == pytest.approx(problem.volume(alpha)[0], rel=1e-6)
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    assert np.abs(outward.sum(axis=0)).max() < 1e-6, "the boundary is closed"


def test_an_stl_of_hexahedra_has_two_triangles_for_every_facet(tmp_path: Path) -> None:
    read = meshio.read(write_stl(lid(), 0 * variables(), tmp_path / "pad.stl"))
    corners = read.points[read.cells_dict["triangle"]].astype(float)
    assert len(corners) == 2 * 2 * (8 * 4 + 8 * 2 + 4 * 2)
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(8.0)


def test_a_surface_that_two_designs_move_is_refused(tmp_path: Path) -> None:
    mesh = block((0, 0, 0), (4, 2, 1), (16, 4, 4))
    scene = Scene({"pad": Body(mesh, IsotropicElasticity(100.0, 0.3))})
    nets = SurfaceDesign("pad", "z1", net=(3, 3)), SurfaceDesign("pad", "x1", net=(3, 3))
    problem = ShapeProblem(ContactProblem(scene, MPI.COMM_SELF), nets, StrainEnergy())
    alpha = np.zeros(18)
    write_design_table(problem, alpha, tmp_path / "lid.csv")
    alpha[9 + 4] = 0.05
    with pytest.raises(InvalidInputError, match=r"that on 'pad' is moved by 0\.\d+ by another one, too"):
        write_design_table(problem, alpha, tmp_path / "lid.csv")


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"there are 1 designs, got number 1: count from 0"):
        write_design_table(lid(), variables(), tmp_path / "lid.csv", design=1)
    with pytest.raises(
        InvalidInputError, match=r"at least 2 lines along each of the 2 parameters, got \(5,\)"
    ):
        write_design_table(lid(), variables(), tmp_path / "lid.csv", lines=(5,))
    with pytest.raises(InvalidInputError, match=r"alpha must have shape \(12,\), got \(3,\)"):
        write_design_table(lid(), np.zeros(3), tmp_path / "lid.csv")
    with pytest.raises(InvalidInputError, match=r"the scene is plane: write its profile"):
        write_stl(lid(2), variables(2), tmp_path / "pad.stl")
    with pytest.raises(InvalidInputError, match=r"got 'lid': name one of \['pad'\]"):
        write_stl(lid(), variables(), tmp_path / "pad.stl", body="lid")
    assert not list(tmp_path.iterdir())
