"""Linear constraints on a net of control points for shapes that can be made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fenics_contact._base.checks import naming_arguments
from fenics_contact._optimize.constraints import LinearConstraints
from fenics_contact.errors import InvalidInputError

Array = NDArray[np.float64]


class Net(Protocol):
    """A net of control points over a surface; `fenics_contact.SurfaceDesign` is one."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of control points along each parameter; the last one runs fastest."""

    @property
    def lattice(self) -> Any:
        """Nodes, parameters, directions and counts of the surface, see `gallery.DesignSurface`."""


@naming_arguments
def symmetric(design: Net, axis: int) -> LinearConstraints:
    """Keep the displacement equal to its mirror image along a parameter.

    The shape is symmetric where the reference and its parameters are.

    Args:
        axis: Number of the parameter, 0 or 1.

    Raises:
        InvalidInputError: If the net has no such parameter.
    """
    net = _lines(design, axis, 1, "symmetric")
    half = len(net) // 2
    return _equal(net.size, net[:half].ravel(), net[::-1][:half].ravel())


@naming_arguments
def monotone(design: Net, axis: int, sign: int = 1) -> LinearConstraints:
    """Let the displacement never fall along a parameter; rise with sign -1.

    The differences of neighbouring control points, which must not change sign, bound the derivative.

    Args:
        axis: Number of the parameter, 0 or 1.
        sign: 1 or -1.

    Raises:
        InvalidInputError: If the net has no such parameter, or fewer than two control points along it.
    """
    if sign not in (1, -1):
        raise InvalidInputError(f"sign of a monotone displacement must be 1 or -1, got {sign!r}")
    net = _lines(design, axis, 2, "monotone")
    rows = sign * (_unit(net[:-1], net.size) - _unit(net[1:], net.size))
    return LinearConstraints(rows, np.zeros(len(rows)))


@naming_arguments
def convex(design: Net, axis: int, points: Array | None = None) -> LinearConstraints:
    """Keep profiles along a parameter from turning hollow: they bulge out of the body, or are straight.

    Their curvature is that of the reference less w'' + κ² w, to first order in the displacement w along the
    normals, see `smallest_radius`.

    Args:
        axis: Number of the parameter, 0 or 1.
        points: Reference coordinates of the body, shape (n_nodes, dim), for the curvature κ of the reference;
            None for a flat one.

    Raises:
        InvalidInputError: If the net has no such parameter, or fewer than three control points along it.
    """
    rows, curvature = _bending(design, axis, points, "convex")
    return LinearConstraints(rows, curvature)


@naming_arguments
def smallest_radius(design: Net, axis: int, radius: float, points: Array) -> LinearConstraints:
    """Limit the curvature of profiles along a parameter, hollow or bulging, to that of a radius.

    Second differences of the control points bound w'' along the lines of the net, as Bernstein polynomials
    lie between their coefficients. The curvature κ - κ² w - w'' is that to first order in the displacement w:
    right for small slopes, and for w small beside 1/κ. Lines have the lengths of the reference, whose κ,
    positive where it bulges out, is taken at the middle control point of each difference: right for flat
    references and arcs.

    Args:
        axis: Number of the parameter, 0 or 1.
        radius: Smallest radius of curvature, [length].
        points: Reference coordinates of the body, shape (n_nodes, dim): ``mesh.points``.

    Raises:
        InvalidInputError: If the radius is not positive, the reference is curved more sharply, the net has no
            such parameter, or fewer than three control points along it.
    """
    if not 0.0 < radius < np.inf:
        raise InvalidInputError(f"the smallest radius must be positive and finite, got {radius}")
    rows, curvature = _bending(design, axis, points, "of a smallest radius")
    sharpest = float(np.abs(curvature).max(initial=0.0))
    if sharpest > (1.0 + 1e-9) / radius:
        raise InvalidInputError(f"the smallest radius must not exceed {1.0 / sharpest:.6g}, got {radius:.6g}")
    limit = np.concatenate([curvature + 1.0 / radius, 1.0 / radius - curvature])
    return LinearConstraints(np.vstack([rows, -rows]), limit)


@naming_arguments
def fixed_rim(design: Net, width: int | Sequence[int] = 1) -> LinearConstraints:
    """Hold the control points at the rim of the net, so that the surface keeps its edges.

    Args:
        width: Number of control points from the rim that are held; with two it keeps its tangents, too. One
            number for each direction of the net holds two opposite ends more than the others: (1, 0) only
            where the first parameter begins and ends.

    Raises:
        InvalidInputError: If nothing inside is left to move, or nothing is held.
    """
    counts = design.counts
    widths = (width,) * len(counts) if isinstance(width, int) else tuple(width)
    fits = len(widths) == len(counts) and min(widths) >= 0 and max(widths) > 0
    if not fits or any(count <= 2 * held for count, held in zip(counts, widths, strict=True)):
        raise InvalidInputError(f"a rim of {width} must be at least 1 and leave some of a net of {counts}")
    inner = np.zeros(counts, dtype=bool)
    inner[tuple(slice(held, count - held) for count, held in zip(counts, widths, strict=True))] = True
    held = np.flatnonzero(~inner)
    rows = _unit(held, inner.size)
    return LinearConstraints(np.zeros((0, inner.size)), np.zeros(0), rows, np.zeros(len(rows)))


def joined(designs: Sequence[Net], *parts: tuple[int, LinearConstraints]) -> LinearConstraints:
    """Place constraints of single designs in the variables of all."""
    ends = np.cumsum([0, *(np.prod(design.counts, dtype=int) for design in designs)])
    matrices: dict[str, list[Array]] = {"rows": [np.zeros((0, ends[-1]))], "equal": [np.zeros((0, ends[-1]))]}
    limits: dict[str, list[Array]] = {"rows": [np.zeros(0)], "equal": [np.zeros(0)]}
    for number, part in parts:
        if number not in range(len(designs)):
            raise InvalidInputError(f"there are {len(designs)} designs, got number {number}: count from 0")
        equal = [("equal", *each) for each in part.equalities]
        for kind, matrix, limit in (("rows", part.matrix, part.limit), *equal):
            given, first, last = np.asarray(matrix, dtype=float), ends[number], ends[number + 1]
            if given.ndim != 2 or given.shape[1] != last - first:
                raise InvalidInputError(
                    f"constraints of design {number} must have {last - first} columns, got {given.shape}"
                )
            matrices[kind].append(np.pad(given, ((0, 0), (first, ends[-1] - last))))
            limits[kind].append(np.asarray(limit, dtype=float))
    sides = [np.concatenate(side[kind]) for kind in ("rows", "equal") for side in (matrices, limits)]
    return LinearConstraints(*sides)


def _lines(design: Net, axis: int, least: int, what: str) -> NDArray[np.intp]:
    """Return the numbers of the control points, those along the axis first, shape (count, lines)."""
    counts = design.counts
    if axis not in range(len(counts)):
        raise InvalidInputError(f"axis must be one of the {len(counts)} parameters of the net, got {axis!r}")
    if counts[axis] < least:
        raise InvalidInputError(f"a {what} profile needs {least} or more control points, got {counts[axis]}")
    numbers = np.moveaxis(np.arange(np.prod(counts, dtype=int)).reshape(counts), axis, 0)
    return numbers.reshape(counts[axis], -1)


def _unit(numbers: NDArray[np.intp], size: int) -> Array:
    """Return one row for each number with a one there."""
    return np.eye(size)[np.ravel(numbers)]


def _equal(size: int, left: NDArray[np.intp], right: NDArray[np.intp]) -> LinearConstraints:
    rows = _unit(left, size) - _unit(right, size)
    return LinearConstraints(np.zeros((0, size)), np.zeros(0), rows, np.zeros(len(rows)))


def _bending(design: Net, axis: int, points: Array | None, what: str) -> tuple[Array, Array]:
    """Return rows of w'' + κ² w at every second difference along the axis, and κ there."""
    net = _lines(design, axis, 3, what)
    count, lines = net.shape
    lengths: Array = np.ones(lines)
    curvature: Array = np.zeros((count - 2, lines))
    if points is not None:
        lengths, curvature = _reference(design, axis, np.asarray(points, dtype=float))
    factor = (count - 1) * (count - 2) / np.broadcast_to(lengths, curvature.shape).ravel()[:, None] ** 2
    second = _unit(net[2:], net.size) - 2.0 * _unit(net[1:-1], net.size) + _unit(net[:-2], net.size)
    kappa = curvature.ravel()
    return factor * second + kappa[:, None] ** 2 * _unit(net[1:-1], net.size), kappa


def _reference(design: Net, axis: int, points: Array) -> tuple[Array, Array]:
    """Return lengths of the reference along the net's lines, (lines,), and κ at the second differences.

    κ, shape (count - 2, lines), is that of the circle through three neighbouring nodes, within the plane of
    the normals.
    """
    lattice, counts = design.lattice, design.counts
    grid = np.moveaxis(points[lattice.nodes].reshape(*lattice.counts, -1), axis, 0)
    normals = np.moveaxis(lattice.directions.reshape(*lattice.counts, -1), axis, 0)
    grid, normals = (each.reshape(len(each), -1, each.shape[-1]) for each in (grid, normals))
    across = lattice.parameters.reshape(*lattice.counts, -1).take(0, axis=axis).reshape(grid.shape[1], -1)
    wanted = [0.5] if len(counts) == 1 else np.linspace(0.0, 1.0, counts[1 - axis])
    places = np.zeros(len(across)) if len(counts) == 1 else across[:, 1 - axis]
    nearest = [int(np.argmin(np.abs(places - place))) for place in wanted]
    grid, normals = grid[:, nearest], normals[:, nearest]
    steps = np.linalg.norm(np.diff(grid, axis=0), axis=2)
    before, after = steps[:-1, :, None], steps[1:, :, None]
    bends = 2.0 * (np.diff(grid, axis=0)[1:] / after - np.diff(grid, axis=0)[:-1] / before) / (before + after)
    kappa = -np.einsum("nld,nld->nl", bends, normals[1:-1])
    along = np.cumsum(steps, axis=0)[:-1] / steps.sum(axis=0)
    middles = np.arange(1, counts[axis] - 1) / (counts[axis] - 1)
    found = [np.interp(middles, own, each) for own, each in zip(along.T, kappa.T, strict=True)]
    return steps.sum(axis=0), np.array(found).T
