"""Bodies with cells of different sizes are drawn as one piece."""

from __future__ import annotations

import numpy as np

from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import refined
from fenics_contact.mesh.faces import boundary_faces
from fenics_contact.pictures.section import nodal, without_seams
from fenics_contact.results.fields import in_space
from fenics_contact.results.multi_block import body_grid, hanging_of


def test_outlines_have_no_lines_between_small_and_large_cells() -> None:
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (5, 3))
    for reach in (0.9, 0.4):
        centres = mesh.points[mesh.cells].mean(axis=1)
        mesh = refined(mesh, np.linalg.norm(centres - [1.3, 0.4], axis=1) < reach).mesh
    outline = boundary_faces(mesh.cells, 2, mesh.hanging)[0]
    drawn = without_seams(mesh.points, boundary_faces(mesh.cells, 2)[0])
    assert len(drawn) == len(outline)
    np.testing.assert_array_equal(np.unique(np.sort(drawn), axis=0), np.unique(np.sort(outline), axis=0))
    np.testing.assert_array_equal(without_seams(mesh.points, outline), outline)


def test_fields_of_cells_are_continuous_between_small_and_large_ones() -> None:
    mesh = refined(block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3, 3, 3)), [0, 1, 13]).mesh
    grid = body_grid(mesh, in_space(mesh.points))
    grid.cell_data["size"] = np.arange(mesh.n_cells, dtype=float)
    hanging = hanging_of(grid.copy())
    assert hanging
    values = nodal(grid, "size")
    np.testing.assert_allclose(values[hanging.nodes], values[hanging.masters].mean(axis=1))
    assert np.ptp(values) > 1.0
    whole = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1, 1, 1))
    assert not hanging_of(body_grid(whole, in_space(whole.points)))
