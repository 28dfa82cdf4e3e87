"""Values of loads and supports: numbers, functions of position, UFL, fields known at points or in files."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import KDTree
from ufl.core.expr import Expr

from fenics_contact._base.checks import LARGEST, GivenVector, checked, floats, naming_arguments, require_file
from fenics_contact._base.display import displayed
from fenics_contact._scene.checks import check_positive
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.errors.ranks import on_root_then_bcast

if TYPE_CHECKING:
    from mpi4py import MPI


#: A function of points, shape (n, dim), [length], with a row (a vector) or a number (a scalar) for each.
OfPosition = Callable[[np.ndarray], np.ndarray]


@displayed
@dataclass(frozen=True, eq=False)
class NodeValues:
    """Values at nodes of a body, as a function of position: that of the nearest node.

    Attributes:
        points: Coordinates of the nodes, shape (n, dim), [length].
        values: Shape (n,), or (n, k).
    """

    points: np.ndarray
    values: np.ndarray

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.points)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the values at points, shape (n, dim)."""
        return np.asarray(self.values[self._tree.query(points)[1]])

    def __getstate__(self) -> dict[str, np.ndarray]:
        """Pickle the values alone."""
        return {"points": self.points, "values": self.values}


@dataclass(frozen=True)
@checked()
class Ufl:
    """A value written in UFL: compiled into the form and evaluated at its quadrature points.

    Numbers in it are compiled in, too: for a load that changes from step to step a function of position,
    which needs no compiler, is cheaper. Derivatives by the shape of a body are exact for numbers and UFL;
    gradients of functions of position are central differences, see `gradients_of`.

    Attributes:
        function: Takes the spatial coordinate (UFL), returns a UFL vector or scalar.

    Example:
        Hydrostatic pressure:

        >>> Pressure("dam", "front", Ufl(lambda x: 9.81e-6 * (2e4 - x[2]))).surface
        'front'
    """

    function: Callable[[Expr], Expr | float | Sequence[Expr | float]]


#: A vector: numbers, a function of positions, or UFL.
VectorValue = Sequence[float] | OfPosition | Ufl
#: A number, a function of positions, or UFL.
ScalarValue = float | OfPosition | Ufl


def checked_vector(name: str, value: Any) -> Any:
    """Return numbers as a tuple of floats, a function or UFL as it is."""
    if isinstance(value, Ufl) or callable(value):
        return value
    return numbers_of_vector(name, value, "give one for x, y and z, or a function of the points")


def numbers_of_vector(name: str, value: Any, remedy: str) -> GivenVector:
    """Return a vector that cannot depend on position as a tuple of floats."""
    array = finite_numbers(value)
    if array.shape not in ((2,), (3,)):
        needed = "must be three finite numbers (two for a plane body)"
        raise InvalidInputError(f"{name} {needed}, got {value!r}: {remedy}")
    return floats(array)


def checked_scalar(name: str, value: Any) -> Any:
    """Return a number as a float, a function or UFL as it is."""
    if isinstance(value, Ufl) or callable(value):
        return value
    array = finite_numbers(value)
    if array.shape != ():
        raise InvalidInputError(
            f"{name} must be a finite number, got {value!r}: give a number or a function of the points"
        )
    return float(array)


#: Stands for what is something other than numbers: no vector, value or list of points has its shape.
NOT_NUMBERS = np.empty((0, 0, 0, 0, 0))


def finite_numbers(value: Any) -> np.ndarray:
    """Return a value as an array of floats, `NOT_NUMBERS` if it is other than numbers below 1e60."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return NOT_NUMBERS
    return array if (np.abs(array) < LARGEST).all() else NOT_NUMBERS


def is_number(value: Any) -> bool:
    """Return whether a value is one finite number, no text and no truth value."""
    return not isinstance(value, str | bool) and finite_numbers(value).shape == ()


def evaluate(name: str, function: OfPosition, points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Evaluate a function of position.

    `points`: points, shape (n, dim), [length].
    """
    with user_code(f"the function given as {name}"):
        values = finite_numbers(function(points.copy()))
    wanted = (len(points), *shape)
    if values.shape != wanted:
        raise InvalidInputError(
            f"the function given as {name} must return finite numbers of shape {wanted} for points of shape "
            f"{points.shape}, got {_shape(values)}: it receives all points at once, one row each"
        )
    return values


def not_negative(name: str, given: float | OfPosition, points: np.ndarray) -> np.ndarray:
    """Return a number or the values of a function at points, shape (n,), if none is negative."""
    if not callable(given):
        return np.full(len(points), float(given))
    values = evaluate(name, given, points, ())
    if (values < 0).any():
        worst = int(np.argmin(values))
        raise InvalidInputError(
            f"{name} must be zero or positive everywhere, got {values[worst]:.6g} at "
            f"({', '.join(f'{x:.6g}' for x in points[worst])}): give a function that is"
        )
    return values


def gradients_of(name: str, function: OfPosition, points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the gradients of a function of position by central differences.

    The step is 1e-5 of the extent of the points, at which the error of smooth functions is about 1e-10 of
    their values; at a kink the slope is the mean of both sides. The function is asked for at points that lie
    outside the body by one step.

    `points`: points, shape (n, dim), [length].

    The result has shape ``(n, *shape, dim)``, the derivatives last.
    """
    step = 1e-5 * (float(np.ptp(points, axis=0).max(initial=0.0)) or 1.0)
    beside = f"{name}, asked {step:.1e} beside the nodes for its gradient"
    columns = [
        evaluate(beside, function, points + way, shape) - evaluate(beside, function, points - way, shape)
        for way in step * np.eye(points.shape[1])
    ]
    return np.stack(columns, axis=-1) / (2.0 * step)


@displayed
@dataclass(frozen=True, eq=False)
@checked("points", "values")
class SampledField:
    """A field given by its values at points; use it wherever a function of position is accepted.

    It has the given values at the points. Between them it is interpolated through the nearest ones, by radial
    functions that do not mind how the points lie: on a line, on a curved surface or in a volume. Beyond the
    points it stays near the value of the nearest one, and only as far as ``reach``.

    Attributes:
        points: Coordinates, shape (n, dim), [length]. Points with three of which the last is the same
            everywhere suit plane bodies, too.
        values: A number for each, shape (n,), a vector, shape (n, dim), or the components of an
            `InitialStress`, shape (n, 6).
        reach: Largest distance from the nearest point at which it may be asked for, [length]; by default
            twice the largest distance of a point from its nearest neighbour.

    Raises:
        InvalidInputError: If shapes do not fit, numbers are not finite, or a point is given twice.

    Example:
        >>> heights = SampledField([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [0.0, 0.5, 2.0])
        >>> heights(np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
        array([0.5 , 0.25])
    """

    points: np.ndarray
    values: np.ndarray
    reach: float | None = None

    def __post_init__(self) -> None:
        """Convert to arrays of numbers and reject what is no field."""
        points, values = finite_numbers(self.points), finite_numbers(self.values)
        if points.ndim != 2 or points.shape[1] not in (2, 3) or len(points) == 0:
            raise InvalidInputError(
                "SampledField.points must be rows of two or three finite numbers, got "
                f"{_shape(points)}: give one row for each point"
            )
        if values.shape not in ((len(points),), points.shape, (len(points), 6)):
            raise InvalidInputError(
                f"SampledField.values must be {len(points)} finite numbers, or rows of {points.shape[1]} or "
                f"6, one for each point, got {_shape(values)}: give a value for each point"
            )
        if self.reach is not None:
            remedy = "give the largest distance from a point at which its value still holds, or none"
            check_positive("SampledField.reach", self.reach, remedy)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "values", values)
        self._refuse_doubles()

    def _refuse_doubles(self) -> None:
        order = np.lexsort(self.points.T)
        same = np.flatnonzero((np.diff(self.points[order], axis=0) == 0).all(axis=1))
        if same.size:
            one, other = sorted(order[same[0] : same[0] + 2])
            raise InvalidInputError(
                f"SampledField.points must differ, points {one} and {other} are the same, "
                f"{self.points[one]}, and so are {len(same) - 1} more: give each point once"
            )

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Evaluate at points, shape (n, dim) -> (n,), or (n, dim) for a vector, (n, 6) for a stress.

        Raises:
            InvalidInputError: If one is farther than ``reach`` from all given ones, or in another space.
        """
        known, values = self._in_space(points.shape[1])
        self._refuse_far(points, known)
        if len(points) == 0 or len(known) == 1:
            return np.repeat(values[:1], len(points), axis=0)
        return np.asarray(_through(known, values, points))

    def _in_space(self, dim: int) -> tuple[np.ndarray, np.ndarray]:
        """Return points and values for bodies of a dimension."""
        own = self.points.shape[1]
        flat = own == 3 and np.ptp(self.points[:, 2]) == 0
        if own == dim:
            return self.points, self.values
        if dim == 3 or not flat:
            raise InvalidInputError(
                f"SampledField.points must have {dim} coordinates, as the bodies have, got {own}: give {dim}"
            )
        vectors = self.values.ndim == 2 and self.values.shape[1] == 3
        return self.points[:, :2], self.values[:, :2] if vectors else self.values

    def _refuse_far(self, points: np.ndarray, known: np.ndarray) -> None:
        reach = self._reach if self.reach is None else self.reach
        far, _ = KDTree(known).query(points)
        if np.any(far > reach):
            worst = int(np.argmax(far))
            place = ", ".join(f"{x:.6g}" for x in points[worst])
            raise InvalidInputError(
                f"a sampled field must be known where it is used, its nearest point is {far[worst]:.6g} from "
                f"({place}), and it reaches only {reach:.6g}: give values there, or a larger reach"
            )

    @cached_property
    def _reach(self) -> float:
        if len(self.points) == 1:
            return np.inf
        return 2.0 * float(KDTree(self.points).query(self.points, 2)[0][:, 1].max())


def _through(known: np.ndarray, values: np.ndarray, points: np.ndarray, neighbours: int = 32) -> np.ndarray:
    """Return the values at points, interpolated through some nearest known ones."""
    from scipy.interpolate import RBFInterpolator  # most scenes have no fields

    # A kernel of distances alone, with a constant: solvable however the points lie.
    form = RBFInterpolator(known, values, min(neighbours, len(known)), kernel="linear", degree=0)
    return np.asarray(form(points))


def _shape(array: np.ndarray) -> str:
    return "something other than finite numbers" if array is NOT_NUMBERS else f"shape {array.shape}"


TABLES = (".csv", ".txt", ".dat", ".tsv")
AXES = ("x", "y", "z")


@naming_arguments
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
        InvalidInputError: If the file is missing or cannot be read, has no coordinates, not the field, or has
            something other than finite numbers.

    Note:
        Collective on ``comm`` if given.
    """
    return SampledField(*on_root_then_bcast(comm, lambda: _read(Path(path), field)), reach)


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
    while len(lines) > 1 and lines[0].startswith("#") and lines[1].lstrip()[0] not in "+-.0123456789":
        del lines[0]  # a remark before the line of names
    mark = next((mark for mark in ",;\t" if lines and mark in lines[0]), "")
    rows = list(csv.reader(lines, delimiter=mark)) if mark else [line.split() for line in lines]
    names = [name.strip().lstrip("#").strip() for name in rows[0]] if rows else []
    named = [name.lower() if name.lower() in AXES else name for name in names]
    if not {"x", "y"} <= set(named) or len(set(named)) < len(named):
        raise InvalidInputError(
            f"the first line of '{path}' must name its columns, x, y, z and others, each once, got "
            f"{', '.join(names) or 'nothing'}: write a line such as x, y, z, pressure"
        )
    return dict(zip(named, _numbers(path, rows[1:], len(named)).T, strict=True))


def _numbers(path: Path, rows: Sequence[Sequence[str]], count: int) -> np.ndarray:
    """Return the rows of a table as numbers, shape (n, count)."""
    uneven = [f"{len(row)} in row {number}" for number, row in enumerate(rows, 1) if len(row) != count]
    if uneven or not rows:
        got = uneven[0] if uneven else "no rows"
        raise InvalidInputError(
            f"every row of '{path}' must have {count} entries, as its first line has, got {got}: complete it"
        )
    try:
        return np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise InvalidInputError(
            f"all rows of '{path}' but the first must be numbers ({error}): write decimals with a point"
        ) from error


def _of_mesh(path: Path) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return points and values of every field of a mesh by name."""
    from fenics_contact.readers.meshio import read_with_meshio  # most scenes have no fields

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
    if field is None:
        wanted, asked, most = tuple(columns), "none was named", 1
    else:
        wanted, most = (field,) if isinstance(field, str) else tuple(field), len(columns)
        asked = f"{', '.join(wanted)} was asked for"
    if not wanted or not set(wanted) <= set(columns) or len(columns) > most:
        raise InvalidInputError(
            f"'{path}' must have the field that is wanted, it has {', '.join(columns) or 'none'}, and "
            f"{asked}: give field, one of these names, or several for a vector"
        )
    return wanted
