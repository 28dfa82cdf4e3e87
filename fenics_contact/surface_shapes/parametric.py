"""Surfaces from a user's parametrisation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from fenics_contact.checks import GivenVector, checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.surface_shapes.patch import Patch
from fenics_contact.surface_shapes.tensor_grid import tensor_grid

Map = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
@checked()
class Parametric(Patch):
    """A surface X(u) over a rectangle of parameters; in the plane a curve over an interval.

    The body lies behind the normal X₁ × X₂ of the parameters' tangents; in the plane to the left of the
    curve's direction, as for a counterclockwise circle. Beyond its border the surface continues straight.
    Tangents must not vanish: leave out poles.

    Attributes:
        position: X, vectorised, (n, dim − 1) -> (n, dim), [length].
        lower: Smallest parameters, dim − 1 of them.
        upper: Largest parameters.
        derivative: ∂X/∂u, (n, dim − 1) -> (n, dim, dim − 1); central differences if it is None.
        periodic: Which parameters are periodic, one boolean each; none unless given.
        flipped: Whether the body lies on the other side.
        samples: Number of starting points along each parameter: more if the surface turns within one
            interval.

    Example:
        >>> import numpy as np
        >>> from fenics_contact.surface_shapes.parametric import Parametric
        >>> wave = Parametric(lambda u: np.column_stack([-u, np.cos(u)]), (-4.0,), (4.0,))
        >>> wave.distance(np.array([[0.0, 1.5]])).round(6)
        array([0.5])
    """

    position: Map
    lower: GivenVector
    upper: GivenVector
    derivative: Map | None = None
    periodic: Sequence[bool] = ()
    flipped: bool = False
    samples: int = 64

    def __post_init__(self) -> None:
        """Reject an empty range, and an invalid position.

        Raises:
            InvalidInputError: If the range is empty, or the samples are not finite points.
        """
        count = len(self.lower)
        numbers = count == len(self.upper) and np.isfinite([*self.lower, *self.upper]).all()
        if count not in (1, 2) or not numbers or not np.less(self.lower, self.upper).all():
            raise InvalidInputError(
                "Parametric.lower must be one or two finite numbers, each below its upper, got "
                f"{self.lower!r} and {self.upper!r}: give the range of each parameter"
            )
        if len(self.periodic) not in (0, count) or self.samples < 3:
            raise InvalidInputError(
                f"Parametric.periodic must hold {count} booleans and samples be at least 3, got "
                f"{self.periodic!r} and {self.samples}: one boolean per parameter"
            )
        starts = self._starts()
        values = np.asarray(self.position(starts), dtype=np.float64)
        if values.shape != (len(starts), count + 1) or not np.isfinite(values).all():
            raise InvalidInputError(
                f"Parametric.position must return finite numbers of shape {(len(starts), count + 1)} for "
                f"parameters of shape {starts.shape}, got shape {values.shape} or NaN: one row per point"
            )

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return len(self.lower) + 1

    @cached_property
    def _range(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        periodic = np.array(self.periodic or [False] * len(self.lower))
        return np.array(self.lower, dtype=float), np.array(self.upper, dtype=float), periodic

    def _starts(self) -> np.ndarray:
        low, high, _ = self._range
        axes = [np.linspace(a, b, self.samples) for a, b in zip(low, high, strict=True)]
        return tensor_grid(axes)

    @cached_property
    def _rounding(self) -> float:
        """Rounding of the surface's coordinates relative to its size, which is large far from the origin."""
        points = self._samples[1].data
        return float(np.finfo(float).eps * np.abs(points).max() / np.ptp(points, axis=0).max())

    def _position(self, u: np.ndarray) -> np.ndarray:
        low, high, periodic = self._range
        return np.asarray(self.position(np.where(periodic, low + (u - low) % (high - low), u)), dtype=float)

    def _tangents(self, u: np.ndarray) -> np.ndarray:
        if self.derivative is not None:
            low, high, periodic = self._range
            return np.asarray(self.derivative(np.where(periodic, low + (u - low) % (high - low), u)))
        step = self._steps(1 / 3)
        middle = self._away(u, 1.01 * step)
        slopes = self._slopes(middle, step)
        return slopes + np.einsum("ndab,nb->nda", self._bends(u), u - middle)

    def _bends(self, u: np.ndarray) -> np.ndarray:
        step = self._steps(1 / 4 if self.derivative is None else 1 / 3)
        # Differences of differences, which stay inside the range.
        middle = self._away(u, 2.01 * step)
        first = partial(self._slopes, step=step) if self.derivative is None else self._tangents
        shifts = np.diag(step)
        bends = [(first(middle + s) - first(middle - s)) / (2 * s.max()) for s in shifts]
        both = np.stack(bends, axis=-1)
        return np.asarray(0.5 * (both + np.swapaxes(both, 2, 3)))

    def _slopes(self, u: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return central differences of the position, (n, k) -> (n, dim, k)."""
        shifts = np.diag(step)
        slopes = [(self._position(u + s) - self._position(u - s)) / (2 * s.max()) for s in shifts]
        return np.stack(slopes, axis=-1)

    def _steps(self, power: float) -> np.ndarray:
        """Return the steps that balance rounding and truncation error, (k,)."""
        low, high, _ = self._range
        return np.asarray(0.1 * self._rounding**power * (high - low))

    def _away(self, u: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Move parameters into the range so that differences do not leave it."""
        low, high, periodic = self._range
        return np.where(periodic, u, np.clip(u, low + step, high - step))
