"""Force and moment of several forces about a point, as one value, and tables of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector, unit_vector
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.linalg import ROUNDING
from fenics_contact.scene import Surface


@displayed
@dataclass(frozen=True, eq=False)
class Resultant:
    """The resultant of forces that act on a body, in the undeformed geometry.

    Attributes:
        force: Sum of the forces, shape (dim,), [force].
        moment: Sum of their moments about ``about``, shape (3,) in space; one number in the plane, positive
            from x to y; [force·length]. Plane bodies have forces and moments a unit of thickness.
        about: The point, shape (dim,), [length].
        surface: The surface on which they act; None for a sum over surfaces.
    """

    force: np.ndarray
    moment: np.ndarray | float
    about: np.ndarray
    surface: Surface | None = None

    def moment_about(self, point: GivenVector | np.ndarray) -> np.ndarray | float:
        """Return the moment about another point, shape (3,) or a number, [force·length].

        Args:
            point: The point, shape (dim,), [length].

        Raises:
            InvalidInputError: If it is no point of the bodies' space.
        """
        return self.moment + moment_of(self.force, self.about - point_of(point, len(self.force)))

    def __add__(self, other: Resultant) -> Resultant:
        """Return the sum with another one about the same point."""
        return Resultant(self.force + other.force, self.moment + other.moment, self.about, self.surface)

    def __sub__(self, other: Resultant) -> Resultant:
        """Return the difference to another one about the same point."""
        return Resultant(self.force - other.force, self.moment - other.moment, self.about, self.surface)

    def torque(self, point: GivenVector | np.ndarray, direction: GivenVector) -> float:
        """Return the moment about an axis in space, [force·length].

        Args:
            point: A point on the axis, shape (3,), [length].
            direction: Direction of the axis, of any length, shape (3,); turning as a right-handed screw is
                positive.

        Raises:
            InvalidInputError: If the bodies are plane, or point or direction are not three numbers.
        """
        if len(self.force) == 2:
            raise InvalidInputError(
                "an axis needs bodies in space, these are plane: their only axis is normal to the plane, "
                "and moment_about(point) is the torque about it"
            )
        return float(np.dot(self.moment_about(point), unit_vector("the direction of an axis", direction, 3)))

    def __str__(self) -> str:
        """Return it in words."""
        moment = _in_brackets(_row(self.moment))
        return (
            f"force {_in_brackets(self.force)} [force], moment {moment} [force·length] about "
            f"{_in_brackets(self.about)}"
        )


@displayed
@dataclass(frozen=True, eq=False)
class Resultants:
    """Resultants in the order of a list of the scene.

    Attributes:
        kind: What they are, such as "reaction".
        entries: One for each entry of that list.
    """

    kind: str
    entries: tuple[Resultant, ...]

    def __len__(self) -> int:
        """Return the number of entries."""
        return len(self.entries)

    def __getitem__(self, number: int) -> Resultant:
        """Return the entry of a place in the list."""
        return self.entries[number]

    def __iter__(self) -> Iterator[Resultant]:
        """Return the entries in their order."""
        return iter(self.entries)

    def __str__(self) -> str:
        """Return a table with one line for each entry."""
        names = [f"{each.surface.body}/{each.surface.name}" if each.surface else "" for each in self.entries]
        return table([(f"{self.kind} {i}", name) for i, name in enumerate(names)], self.entries)


def table(
    names: list[tuple[str, ...]],
    resultants: tuple[Resultant, ...],
    scales: tuple[float, float] | None = None,
) -> str:
    """Return forces and moments of several resultants, one per line behind its names, with their units.

    Args:
        names: Names of each line.
        resultants: The resultants, all in space or all in the plane.
        scales: A force and a moment beside which what is only rounding is shown as zero; by default the
            largest components.
    """
    if not resultants:
        return "none"
    columns = [
        np.stack([each.force for each in resultants]),
        np.stack([_row(each.moment) for each in resultants]),
    ]
    sizes = scales or tuple(float(np.abs(part).max()) for part in columns)
    shown = [
        np.where(np.abs(part) > ROUNDING * size, part, 0.0) for part, size in zip(columns, sizes, strict=True)
    ]
    cells = [
        (*name, *(f"{value:.5g}" for value in row)) for name, row in zip(names, np.hstack(shown), strict=True)
    ]
    dim = len(resultants[0].force)
    moments = ("Mx", "My", "Mz") if dim == 3 else ("M",)
    head = (*[""] * len(names[0]), *("Fx", "Fy", "Fz")[:dim], *moments)
    return "\n".join([*_aligned([head, *cells], len(names[0])), "F in [force], M in [force·length]"])


def _aligned(rows: list[tuple[str, ...]], names: int) -> list[str]:
    """Return rows of cells as lines, the first ``names`` columns to the left and the others to the right."""
    width = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(size) if k < names else cell.rjust(size)
            for k, (cell, size) in enumerate(zip(row, width, strict=True))
        ).rstrip()
        for row in rows
    ]


def resultant(
    forces: np.ndarray, places: np.ndarray, about: np.ndarray, surface: Surface | None = None
) -> Resultant:
    """Return force and moment of forces that act at places, both of shape (n, dim), about a point, (dim,)."""
    moment = moment_of(forces, places - about)
    total = float(moment.sum()) if forces.shape[1] == 2 else moment.sum(axis=0)
    return Resultant(forces.sum(axis=0), total, about, surface)


def moment_of(force: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Return arm × force, shape (..., 3), in the plane the number x·Fy − y·Fx, shape (...,)."""
    if force.shape[-1] == 2:
        return np.asarray(arm[..., 0] * force[..., 1] - arm[..., 1] * force[..., 0])
    return np.cross(arm, force)


def point_of(given: GivenVector | np.ndarray, dim: int) -> np.ndarray:
    """Return a point as an array, shape (dim,).

    Raises:
        InvalidInputError: If it does not have ``dim`` finite coordinates.
    """
    point = np.asarray(given, dtype=np.float64)
    if point.shape != (dim,) or not np.isfinite(point).all():
        raise InvalidInputError(
            f"the point that moments refer to needs {dim} finite coordinates, got {given!r}: give a point in "
            "the bodies' unit of length, or none for the default"
        )
    return point


def _row(moment: np.ndarray | float) -> np.ndarray:
    return np.atleast_1d(np.asarray(moment, dtype=np.float64))


def _in_brackets(values: np.ndarray) -> str:
    return f"({', '.join(f'{value:.5g}' for value in values)})"
