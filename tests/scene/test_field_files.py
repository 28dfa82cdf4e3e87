"""Fields from tables and from meshes of other programs."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

from fenics_contact import read_field
from fenics_contact.errors import InvalidInputError

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    "text",
    [
        "x, y, z, pressure\n0, 0, 0, 1\n1, 0, 0, 2\n1, 1, 0, 3\n",
        "# X;Y;Z;pressure\n0;0;0;1\n1;0;0;2\n\n1;1;0;3\n",
        "\ufeffpressure x y z\n1 0 0 0\n2 1 0 0\n3 1 1 0\n",
        "x\ty\tpressure\n0\t0\t1\n1\t0\t2\n1\t1\t3",
    ],
)
def test_a_table_is_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "wind.csv"
    path.write_text(text, encoding="utf-8")
    field = read_field(path)
    asked = POINTS[:3, : field.points.shape[1]]
    np.testing.assert_allclose(field(asked), [1.0, 2.0, 3.0], atol=1e-12)


def test_columns_make_a_vector(tmp_path: Path) -> None:
    path = tmp_path / "flow.txt"
    path.write_text("x y z tx ty tz\n0 0 0 1 2 3\n1 0 0 4 5 6\n")
    np.testing.assert_allclose(read_field(path, ["tz", "ty", "tx"])(POINTS[:2]), [[3, 2, 1], [6, 5, 4]])


def test_fields_of_nodes_and_cells_are_read(tmp_path: Path) -> None:
    path = tmp_path / "heat.vtu"
    mesh = meshio.Mesh(
        POINTS,
        [("triangle", [[0, 1, 2]]), ("triangle", [[0, 2, 3]])],
        point_data={"temperature": [1.0, 2.0, 3.0, 4.0]},
        cell_data={"source": [[10.0], [20.0]]},
    )
    mesh.write(path)
    np.testing.assert_allclose(read_field(path, "temperature")(POINTS), [1, 2, 3, 4], atol=1e-12)
    centres = np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0]]) / 3.0
    np.testing.assert_allclose(read_field(path, "source")(centres), [10.0, 20.0])
    with pytest.raises(InvalidInputError, match="it has temperature, source, and none was named"):
        read_field(path)


@pytest.mark.parametrize(
    ("name", "text", "field", "message"),
    [
        ("none.csv", None, None, "none.csv"),
        ("a.csv", "", None, "must name its columns, x, y, z and others, each once, got nothing"),
        ("a.csv", "0, 0, 0, 1\n", None, "got 0, 0, 0, 1: write a line such as x, y, z, pressure"),
        ("a.csv", "x, y, x, p\n", None, "each once"),
        ("a.csv", "x, y, z, p\n", None, "must have 4 entries, .* got no rows"),
        ("a.csv", "x, y, z, p\n1, 2, 3\n", None, "must have 4 entries, .* got 3 in row 1"),
        ("a.csv", "x, y, z, p\n1, 2, 3, much\n", None, "but the first must be numbers"),
        ("a.csv", "x, y, z, p, q\n1, 2, 3, 4, 5\n", None, "it has p, q, and none was named"),
        ("a.csv", "x, y, z, p\n1, 2, 3, 4\n", "q", "it has p, and q was asked for"),
        ("a.csv", "x, y, z\n1, 2, 3\n", None, "it has none, and none was named"),
        ("a.csv", "x, y, z, p\n1, 2, 3, nan\n", None, "values must be 1 finite numbers"),
        ("a.odd", "x", None, "must end in one of"),
    ],
)
def test_what_holds_no_field_is_refused(
    tmp_path: Path, name: str, text: str | None, field: str | None, message: str
) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InvalidInputError, match=message):
        read_field(tmp_path / name, field)
