"""Rigid tools from STL and other files of triangles."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.readers import read_triangulation
from tests.shapes.bodies import CUBE, SIDES, ball


@pytest.mark.parametrize(("name", "binary"), [("ball.stl", False), ("ball.stl", True), ("ball.ply", True)])
def test_a_file_of_triangles_is_the_body_that_was_written(tmp_path: Path, name: str, binary: bool) -> None:
    points, triangles = ball(200)
    meshio.write_points_cells(tmp_path / name, points, [("triangle", triangles)], binary=binary)
    body = read_triangulation(tmp_path / name, scale=25.4, smooth=0.4)
    assert (len(body.points), len(body.triangles), body.smooth) == (200, 396, 0.4)
    np.testing.assert_allclose(np.linalg.norm(body.points, axis=1), 25.4, rtol=1e-6)


def test_quadrilaterals_are_halved(tmp_path: Path) -> None:
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    meshio.write_points_cells(tmp_path / "cube.obj", CUBE, [("quad", quads)])
    assert read_triangulation(tmp_path / "cube.obj").distance(np.full((1, 3), 0.5)) == pytest.approx(-0.5)


@pytest.mark.parametrize(
    ("cells", "scale", "message"),
    [
        ([("triangle", SIDES[1:])], 1.0, r"file '.*tool.vtu': Triangulation must be closed.* 3 open edges"),
        (
            [("line", SIDES[:, :2])],
            1.0,
            r"file '.*tool.vtu' must hold the triangles of .* surface .*, it has line",
        ),
        ([("triangle", SIDES)], -1.0, r"scale must be a positive number, got -1.0"),
    ],
)
def test_files_without_a_body_are_refused(tmp_path: Path, cells: list, scale: float, message: str) -> None:  # type: ignore[type-arg]
    meshio.write_points_cells(tmp_path / "tool.vtu", CUBE, cells)
    with pytest.raises(InvalidInputError, match=message):
        read_triangulation(tmp_path / "tool.vtu", scale=scale)


@pytest.mark.parametrize(
    ("far", "message"),
    [
        (1e200, r"Triangulation needs finite points \(n, 3\)"),
        (1e12, r"triangles must have three different corners, got none"),
    ],
)
def test_points_that_are_too_far_away_are_refused(tmp_path: Path, far: float, message: str) -> None:
    points = np.vstack([CUBE, [[far, 0.0, 0.0]]])
    wild = np.concatenate([SIDES, [[0, 8, 8]]])
    meshio.write_points_cells(tmp_path / "tool.vtu", points, [("triangle", wild)])
    with pytest.raises(InvalidInputError, match=message):
        read_triangulation(tmp_path / "tool.vtu")
