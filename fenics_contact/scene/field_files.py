"""Fields from files: tables of points, and values on the nodes or cells of a mesh."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.checks import require_file
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.mesh_io import read_with_meshio
from fenics_contact.scene.sampled import SampledField

if TYPE_CHECKING:
    from mpi4py import MPI

TABLES = (".csv", ".txt", ".dat", ".tsv")
AXES = ("x", "y", "z")


def read_field(
    path: str | Path,
    field: str | Sequence[str] | None = None,
    *,
    reach: float | None = None,
    comm: MPI.Comm | None = None,
) -> SampledField:
    """Read a field as a function of position, for loads, supports, friction coefficients and gaps.

    Example:
        ``Pressure("shell", "outer", read_field("wind.csv", "pressure"))``; the file begins with a line of
        names, ``x, y, z, pressure``. ``ThermalStrain("disc", read_field("heat.vtu", "temperature"))`` takes
        values at the nodes of another program's mesh, which need not be the body's.

    Args:
        path: A table (.csv, .txt, .dat, .tsv) with one row a point, whose first line names the columns x, y,
            z (z may be missing) and others, separated by commas, semicolons, tabs or blanks, after remarks
            that begin with "#"; or a mesh of any format that meshio reads, with fields at its nodes or its
            cells, which count at their centres.
        field: Name of the column or field; several, one for each axis, for a vector made of numbers. Needed
            if there is more than one.
        reach: See `SampledField`.
        comm: If given, rank 0 reads the file and all ranks receive the field.

    Raises:
        InvalidInputError: If the file is missing or cannot be read, lacks coordinates or the field, or has
            something other than finite numbers.

    Note:
        Collective on ``comm`` if given.
    """
    if comm is None:
        return SampledField(*_read(Path(path), field), reach)
    read = None
    with together(comm):
        read = _read(Path(path), field) if comm.rank == 0 else None
    points, values = comm.bcast(read)
    return SampledField(points, values, reach)


def _read(path: Path, field: str | Sequence[str] | None) -> tuple[np.ndarray, np.ndarray]:
    """Return points and values."""
    require_file(path, "a field")
    if path.suffix.lower() in TABLES:
        columns = _table(path)
        points = np.column_stack([columns.pop(axis) for axis in AXES if axis in columns])
        places = dict.fromkeys(columns, points)
    else:
        places, columns = _of_mesh(path)
    names = _chosen(path, columns, field)
    values = [columns[name] for name in names]
    return places[names[0]], values[0] if len(values) == 1 else np.column_stack(values)


def _table(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a table by name."""
    try:
        lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"the field '{path}' must be readable text: {error}") from error
    while len(lines) > 1 and lines[0].startswith("#") and not _is_number(lines[1]):
        del lines[0]  # a remark before the line of names
    mark = next((mark for mark in ",;\t" if lines and mark in lines[0]), None)
    rows = [line.split() for line in lines] if mark is None else list(csv.reader(lines, delimiter=mark))
    names = [name.strip().lstrip("#").strip() for name in rows[0]] if rows else []
    named = [name.lower() if name.lower() in AXES else name for name in names]
    if not {"x", "y"} <= set(named) or len(set(named)) < len(named):
        raise InvalidInputError(
            f"the first line of '{path}' must name its columns, x, y, z and others, each once, got "
            f"{', '.join(names) or 'nothing'}: write a line such as x, y, z, pressure"
        )
    return dict(zip(named, _numbers(path, rows[1:], len(named)).T, strict=True))


def _is_number(line: str) -> bool:
    return line.lstrip()[0] in "+-.0123456789"


def _numbers(path: Path, rows: Sequence[Sequence[str]], count: int) -> np.ndarray:
    """Return the rows of a table as numbers, shape (n, count)."""
    uneven = next((number for number, row in enumerate(rows) if len(row) != count), None)
    if uneven is not None or not rows:
        got = "no rows" if uneven is None else f"{len(rows[uneven])} in row {uneven + 1}"
        raise InvalidInputError(
            f"every row of '{path}' must have {count} entries, as many as its first line names, got {got}: "
            "complete the table"
        )
    try:
        return np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise InvalidInputError(
            f"all rows of '{path}' but the first must be numbers ({error}): write them with a point as "
            "decimal mark"
        ) from error


def _of_mesh(path: Path) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return points and values of every field of a mesh by name."""
    mesh = read_with_meshio(path)
    places = dict.fromkeys(mesh.point_data, np.asarray(mesh.points, dtype=np.float64))
    fields = dict(mesh.point_data)
    centres = [mesh.points[block.data].mean(axis=1) for block in mesh.cells]
    for name, values in mesh.cell_data.items():
        if name not in fields:
            places[name], fields[name] = np.concatenate(centres), np.concatenate(values)
    return places, fields


def _chosen(
    path: Path, columns: Mapping[str, np.ndarray], field: str | Sequence[str] | None
) -> tuple[str, ...]:
    """Return the names of the columns that make the field."""
    wanted = (field,) if isinstance(field, str) else tuple(columns if field is None else field)
    if not wanted or not set(wanted) <= set(columns) or (field is None and len(columns) > 1):
        asked = "none was named" if field is None else f"{', '.join(wanted)} was asked for"
        raise InvalidInputError(
            f"'{path}' must have the field that is wanted, it has {', '.join(columns) or 'none'}, and "
            f"{asked}: give field, one of these names, or several for a vector"
        )
    return wanted
