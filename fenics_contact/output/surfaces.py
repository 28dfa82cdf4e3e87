"""Designed surfaces as tables of points, and designed bodies as triangles (STL)."""

from __future__ import annotations

from math import ceil, log10
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact.design.design import MovedSurface
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.mesh.cell_types import FACET_TYPES
from fenics_contact.output.files import replacing, write_text
from fenics_contact.shapes.combined import CLOSE
from fenics_contact.shapes.parametric import tensor_grid

if TYPE_CHECKING:
    from fenics_contact.design.problem import ShapeProblem
    from fenics_contact.design.several import JointProblem
    from fenics_contact.mesh.body_mesh import BodyMesh


def moved_surfaces(problem: ShapeProblem | JointProblem, alpha: np.ndarray) -> tuple[MovedSurface, ...]:
    """Return the surface of every design, moved. Collective."""
    points = problem.points_of(alpha)
    parts = np.split(np.asarray(alpha), np.cumsum([design.size for design in problem.designs])[:-1])
    found = []
    for design, part in zip(problem.designs, parts, strict=True):
        surface = MovedSurface(design, problem.scene.bodies[design.body].mesh, part)
        at = points[design.body][design.lattice.nodes]
        off = float(np.abs(surface.after(surface.parameters) - at).max())
        if off > CLOSE * float(np.ptp(at, axis=0).max()):
            raise InvalidInputError(
                f"a surface in a file must be moved by one design, that on {design.body!r} is moved by "
                f"{off:.3g} by another, too: let designs share no nodes, or narrow their transitions"
            )
        found.append(surface)
    return tuple(found)


def moved_body(
    problem: ShapeProblem | JointProblem, alpha: np.ndarray, body: str | None
) -> tuple[str, BodyMesh]:
    """Return name and mesh of a designed body, None for the only one, in a design's shape. Collective."""
    designed = sorted({design.body for design in problem.designs})
    if body not in designed and (body is not None or len(designed) > 1):
        raise InvalidInputError(f"the body must be one of {designed}, which designs move, got {body!r}")
    name = designed[0] if body is None else body
    return name, problem.scene_of(alpha).bodies[name].mesh


@collectively("write_design_table", lambda problem, *_, **__: problem.comm)
@naming_arguments
def write_design_table(
    problem: ShapeProblem | JointProblem,
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
            f"a table needs at least 2 lines along each of the {len(surface.ticks)} parameters, got {lines}"
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


@collectively("write_stl", lambda problem, *_, **__: problem.comm)
@naming_arguments
def write_stl(
    problem: ShapeProblem | JointProblem, alpha: np.ndarray, path: str | Path, *, body: str | None = None
) -> Path:
    """Write the closed boundary of a designed body as a binary STL file. Collective.

    The triangles are the facets of the mesh, of quadrilaterals two, of quadratic facets the pieces between
    their nodes; their right-hand normals point out. The format names no unit and has seven digits.

    Args:
        problem: The problem with the design.
        alpha: Design variables of all its designs, shape (size,), [length]: ``result.x``.
        path: File to write; its folder is created.
        body: Name of the body; needed if designs move several.

    Returns:
        The path.

    Raises:
        InvalidInputError: If the body is plane or not designed, or alpha does not fit.
        InvalidDesignError: If the design inverts a cell.

    Example:
        >>> write_stl(problem, result.x, "output/link_1.stl", body="link 1")  # doctest: +SKIP
    """
    import meshio  # takes a tenth of a second

    target = Path(path)
    with together(problem.comm):
        if problem.scene.dim == 2:
            raise InvalidInputError(
                "an STL needs a body in space, the scene is plane: write its profile by write_design_table"
            )
    _, mesh = moved_body(problem, alpha, body)
    with together(problem.comm):
        if problem.comm.rank == 0:
            points, triangles = _triangles(mesh)
            with replacing(target) as (temporary,):
                written = meshio.Mesh(points, [("triangle", triangles)])
                meshio.write(temporary, written, file_format="stl", binary=True)
    return target


def _triangles(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of the boundary and its triangles, outward."""
    facets, _ = mesh.linear.boundary
    triangles = facets[:, FACET_TYPES[facets.shape[1], 3].simplices].reshape(-1, 3)
    nodes, numbers = np.unique(triangles, return_inverse=True)
    return mesh.points[nodes], numbers.reshape(-1, 3)
