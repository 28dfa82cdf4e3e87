"""Closed surfaces of triangles from STL and other files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.readers.meshio import read_with_meshio
from fenics_contact.shapes.triangulation import Triangulation

if TYPE_CHECKING:
    from mpi4py import MPI


@naming_arguments
def read_triangulation(
    path: str | Path,
    *,
    scale: float = 1.0,
    smooth: float = np.pi / 6,
    file_format: str | None = None,
    comm: MPI.Comm | None = None,
) -> Triangulation:
    """Read a closed surface of triangles, such as a rigid tool, from STL, PLY, OBJ or what else meshio reads.

    Quadrilaterals are halved.

    Args:
        path: The file.
        scale: Factor of its coordinates, such as 25.4 from inches to millimetres.
        smooth: Largest angle between triangles of a round surface, in radians, see `shapes.Triangulation`.
        file_format: Name of meshio's format, if the file's suffix does not determine it.
        comm: If given, rank 0 reads the file and all ranks receive the surface.

    Raises:
        InvalidInputError: If the file cannot be read, has no triangles, or these do not enclose a body.

    Example:
        ``ContactPair(Surface("sheet", "top"), read_triangulation("punch.stl"))``

    Note:
        Collective on ``comm`` if given.
    """
    if not (np.isfinite(scale) and scale > 0):
        raise InvalidInputError(f"scale must be a positive number, got {scale!r}: 1000 turns m into mm")
    return on_root_then_bcast(comm, lambda: _read(Path(path), scale, smooth, file_format))


def _read(path: Path, scale: float, smooth: float, file_format: str | None) -> Triangulation:
    mesh = read_with_meshio(path, file_format)
    parts = [np.asarray(block.data) for block in mesh.cells if block.type == "triangle"]
    for block in mesh.cells:
        if block.type == "quad":
            parts += [np.asarray(block.data)[:, corners] for corners in ([0, 1, 2], [0, 2, 3])]
    if not parts:
        kinds = ", ".join(sorted({block.type for block in mesh.cells})) or "nothing"
        raise InvalidInputError(
            f"file '{path}' must hold the triangles of a closed surface (STL), it has {kinds}"
        )
    try:
        return Triangulation(scale * np.asarray(mesh.points, dtype=np.float64), np.concatenate(parts), smooth)
    except InvalidInputError as error:
        raise InvalidInputError(f"file '{path}': {error}") from None
