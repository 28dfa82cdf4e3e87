"""A designed surface as a table of points before and after."""

from __future__ import annotations

from math import ceil, log10
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.io.moved_bodies import moved_surfaces
from fenics_contact.io.replacing import write_text
from fenics_contact.surface_shapes import tensor_grid

if TYPE_CHECKING:
    from fenics_contact.shape import LoadPath, MovedSurface, ShapeProblem


@collectively("write_design_table", lambda problem, *_, **__: problem.comm)
def write_design_table(
    problem: ShapeProblem | LoadPath,
    alpha: np.ndarray,
    path: str | Path,
    *,
    design: int = 0,
    lines: tuple[int, ...] | None = None,
    length: str = "mm",
) -> Path:
    """Write a designed surface as a table (CSV), in the plane a profile. Collective.

    After lines that begin with "#" and say what it is, a line names the columns: the parameters ``s`` and
    ``t`` of the net, in the plane ``s``; ``x``, ``y``, ``z`` before; ``movement`` along the unit normal, out
    of the body; ``x_moved``, ``y_moved``, ``z_moved``. t runs fastest. Numbers have 14 digits.

    Args:
        problem: The problem with the design.
        alpha: Design variables of all its designs, shape (size,), [length]: ``result.x``.
        path: File to write; its folder is created.
        design: Number of the design among ``problem.designs``.
        lines: Number of lines of equal spacing along s and t, at least 2 each; those of the mesh's nodes
            unless given.
        length: Name of the unit of length.

    Returns:
        The path; `scene.read_field` reads a column of it.

    Raises:
        InvalidInputError: If there is no such design, alpha does not fit, or there are too few lines.

    Example:
        >>> write_design_table(problem, result.x, "output/crown.csv", lines=(51, 11))  # doctest: +SKIP
    """
    target, surfaces = Path(path), moved_surfaces(problem, alpha)
    with together(problem.comm):
        if design not in range(len(surfaces)):
            raise InvalidInputError(f"there are {len(surfaces)} designs, got number {design}: count from 0")
        text = _table(surfaces[design], _places(surfaces[design], lines), length)
        if problem.comm.rank == 0:
            write_text(target, text)
    return target


def _places(surface: MovedSurface, lines: tuple[int, ...] | None) -> np.ndarray:
    """Return the parameters of the rows, shape (n, dim − 1)."""
    if lines is None:
        return surface.parameters
    if len(lines) != len(surface.ticks) or min(lines) < 2:
        raise InvalidInputError(
            f"a table needs a number of at least 2 lines along each of the {len(surface.ticks)} parameters, "
            f"got {lines}: give a tuple such as {(51, 11)[: len(surface.ticks)]}"
        )
    ticks = [np.linspace(0.0, 1.0, count) for count in lines]
    return tensor_grid(ticks)


def _table(surface: MovedSurface, places: np.ndarray, length: str) -> str:
    design, axes = surface.design, "xyz"[: surface.mesh.dim]
    net = " × ".join(map(str, design.counts))
    names = [*"st"[: len(axes) - 1], *axes, "movement", *(f"{axis}_moved" for axis in axes)]
    columns = np.column_stack(
        [places, surface.before(places), surface.movement(places), surface.after(places)]
    )
    digits = 14 - ceil(log10(np.abs(columns).max()))  # beyond them there is rounding alone
    rows = [",".join(f"{number:.15g}" for number in row) for row in columns.round(digits) + 0.0]
    head = [
        f"# surface of {design.body!r} moved by a net of {net} control points",
        f"# parameters from 0 to 1, lengths in {length}, movement along the normal",
    ]
    return "\n".join([*head, ",".join(names), *rows]) + "\n"
