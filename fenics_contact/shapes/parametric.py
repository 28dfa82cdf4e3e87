"""Surfaces that are images of a rectangle: a user's parametrisation, and splines through points.

With the foot X(u) of a point x, tangents J = ∂X/∂u, normal n, first and second fundamental forms G = JᵀJ and
B = −n·∂²X/∂u², the distance is d = n·(x − X), its gradient n and its Hessian J G⁻¹ B (G + d B)⁻¹ Jᵀ.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from fenics_contact._base.checks import GivenVector, checked
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.shapes.simple import ROUNDING

if TYPE_CHECKING:
    from scipy.interpolate import BSpline, RectBivariateSpline

#: Tangents are degenerate if their area, relative to the product of their lengths, is below this.
FLAT = 1e-10
#: Fraction of det G below which the determinant of G + d B indicates a centre of curvature.
FOCAL = 1e-12


@dataclass(frozen=True, eq=False)
class Feet:
    """Feet of perpendiculars on a surface, and its derivatives there.

    `position`: feet; `tangents`: first derivatives of the parametrisation there, (n, dim, dim − 1); `bends`:
    second derivatives, (n, dim, dim − 1, dim − 1); `free`: which parameters are not held at the border, (n,
    dim − 1); the continuation beyond is straight; `sign`: 1, or −1 where the normal that the parametrisation
    gives points into the body; or one per point.
    """

    points: np.ndarray
    position: np.ndarray
    tangents: np.ndarray
    bends: np.ndarray
    free: np.ndarray
    sign: float | np.ndarray = 1.0

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals out of the body, (n, dim)."""
        first = self.tangents[:, :, 0]
        if self.tangents.shape[2] == 1:
            across = np.stack([first[:, 1], -first[:, 0]], axis=1)
        else:
            across = np.cross(first, self.tangents[:, :, 1])
        length = np.linalg.norm(across, axis=1)
        sizes = np.linalg.norm(self.tangents, axis=1)
        if not (length > FLAT * sizes.max(axis=1, initial=0.0) ** sizes.shape[1]).all():  # also catches NaN
            worst = self.position[int(np.argmin(length))]
            raise InvalidInputError(
                f"derivatives must not be zero or parallel, got such at {np.round(worst, 6)}: leave out poles"
            )
        return np.asarray((self.sign / length)[:, None] * across)

    @property
    def distance(self) -> np.ndarray:
        """Signed distance from the surface, beyond its border from its tangents, (n,)."""
        return np.einsum("nd,nd->n", self.normals, self.points - self.position)

    @property
    def curvatures(self) -> np.ndarray:
        """Second derivatives of the distance, (n, dim, dim)."""
        form = -np.einsum("nd,ndab->nab", self.normals, self.bends)
        gram = self.gram
        moved = masked(gram + self.distance[:, None, None] * form, self.free)
        focal = np.abs(np.linalg.det(moved)) <= FOCAL * np.abs(np.linalg.det(gram))
        moved[focal] = np.sqrt(FOCAL) * gram[focal]
        turned = np.swapaxes(np.linalg.solve(gram, form), 1, 2) @ np.swapaxes(self.tangents, 1, 2)
        steps = np.linalg.solve(moved, np.swapaxes(self.tangents * self.free[:, None, :], 1, 2))
        hessian = np.swapaxes(turned, 1, 2) @ steps
        return np.asarray(0.5 * (hessian + np.swapaxes(hessian, 1, 2)))

    @property
    def gram(self) -> np.ndarray:
        """First fundamental form G, (n, dim − 1, dim − 1)."""
        return np.asarray(np.swapaxes(self.tangents, 1, 2) @ self.tangents)

    def steps(self) -> np.ndarray:
        """Return Newton steps of the parameters to the closest points, Gauss-Newton's where these fail."""
        off = self.points - self.position
        slope = np.einsum("nda,nd->na", self.tangents, off) * self.free
        gram = self.gram
        full = gram - np.einsum("nd,ndab->nab", off, self.bends)
        full, gram = masked(full, self.free), masked(gram, self.free)
        downhill = np.linalg.eigvalsh(full)[:, 0] > 0.1 * np.linalg.eigvalsh(gram)[:, 0]
        chosen = np.where(downhill[:, None, None], full, gram)
        return np.asarray(np.linalg.solve(chosen, slope[:, :, None])[:, :, 0])


def masked(matrices: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return matrices whose rows and columns of held parameters are the identity's."""
    both = free[:, :, None] & free[:, None, :]
    return np.where(both, matrices, np.eye(free.shape[1]))


#: Largest number of steps to a closest point: if all were halved, the last would be below rounding.
STEPS = 60
#: Size of the last step to a closest point, relative to the range of the parameters.
LAST = 1e-10
#: A closest point is held at the border if its parameter would leave the range by more than this fraction.
HELD = 1e-8


class Patch(ABC):
    """Distances, normals and curvatures of a parametrised surface, by Newton's method from close samples."""

    flipped: bool

    @abstractmethod
    def _position(self, u: np.ndarray) -> np.ndarray:
        """Return X, (n, k) -> (n, k + 1)."""

    @abstractmethod
    def _tangents(self, u: np.ndarray) -> np.ndarray:
        """Return ∂X/∂u, (n, k) -> (n, k + 1, k)."""

    @abstractmethod
    def _bends(self, u: np.ndarray) -> np.ndarray:
        """Return ∂²X/∂u², (n, k) -> (n, k + 1, k, k)."""

    @property
    @abstractmethod
    def _range(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Least and largest parameters and which of them are periodic, (k,) each."""

    @property
    def _borders(self) -> tuple[np.ndarray, np.ndarray]:
        """Parameters beyond which there is no surface, (k,) each."""
        return self._range[:2]

    @abstractmethod
    def _starts(self) -> np.ndarray:
        """Return the parameters of samples that are dense enough to locate closest points, (m, k)."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance to the closest point, beyond the border to the tangents there."""
        return self._feet(points).distance

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the normals at the closest points."""
        return self._feet(points).normals

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the second derivatives of the distance."""
        return self._feet(points).curvatures

    def at(self, u: np.ndarray) -> np.ndarray:
        """Return the surface's points at parameters, (n, dim − 1) -> (n, dim), [length]."""
        return self._position(np.asarray(u, dtype=np.float64))

    @cached_property
    def _samples(self) -> tuple[np.ndarray, cKDTree]:
        starts = self._starts()
        return starts, cKDTree(self._position(starts))

    def _feet(self, points: np.ndarray) -> Feet:
        """Return the closest points and the surface's derivatives there."""
        points = np.asarray(points, dtype=np.float64)
        starts, tree = self._samples
        low, high, periodic = self._range
        u: np.ndarray = starts[tree.query(points)[1]]
        part: np.ndarray = np.ones((len(points), 1))
        rounding = ROUNDING * np.linalg.norm(points, axis=1, keepdims=True)
        for _ in range(STEPS if len(points) else 0):
            feet = self._at(points, u)
            trial = u + part * feet.steps()
            trial = np.where(periodic, trial, np.clip(trial, low, high))
            away = np.linalg.norm(points - feet.position, axis=1, keepdims=True)
            tried = np.linalg.norm(points - self._position(trial), axis=1, keepdims=True)
            closer = tried <= (1 + ROUNDING) * away + rounding
            moved = np.abs(trial - u)
            u, part = np.where(closer, trial, u), np.where(closer, np.minimum(1.0, 2 * part), 0.5 * part)
            if not (moved > LAST * (high - low)).any():
                break
        return self._at(points, u)

    def _at(self, points: np.ndarray, u: np.ndarray) -> Feet:
        position, tangents = self._position(u), self._tangents(u)
        (low, high), (_, _, periodic) = self._borders, self._range
        pull = np.einsum("nda,nd->na", tangents, points - position)
        # Points exactly above the border are held only by rounding.
        strong = np.abs(pull) > HELD * np.einsum("nda,nda->na", tangents, tangents) * (high - low)
        held = strong & ~periodic & np.where(pull > 0, u >= high, u <= low)
        return Feet(points, position, tangents, self._bends(u), ~held, -1.0 if self.flipped else 1.0)


def tensor_grid(ticks: Iterable[ArrayLike]) -> np.ndarray:
    """Return all points of which each coordinate is one of its ticks, the last one running fastest."""
    axes = np.meshgrid(*map(np.asarray, ticks), indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, len(axes))


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
        >>> from fenics_contact.shapes import Parametric
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
        """Reject an empty range, and samples that are not finite points."""
        count = len(self.lower)
        numbers = count == len(self.upper) and np.isfinite([*self.lower, *self.upper]).all()
        if count not in (1, 2) or not numbers or not np.less(self.lower, self.upper).all():
            raise InvalidInputError(
                f"lower must be one or two numbers below upper, got {self.lower!r} and {self.upper!r}"
            )
        if len(self.periodic) not in (0, count) or self.samples < 3:
            raise InvalidInputError(
                f"periodic needs {count} booleans, samples 3 or more, got {self.periodic!r}, {self.samples}"
            )
        starts = self._starts()
        values = np.asarray(self.position(starts), dtype=np.float64)
        if values.shape != (len(starts), count + 1) or not np.isfinite(values).all():
            raise InvalidInputError(
                f"position must return finite numbers of shape {(len(starts), count + 1)}, got {values.shape}"
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


#: Degree of the spline between sampled points: its curvature is smooth.
DEGREE = 5
#: Distance, relative to the range, from sides that degenerate to a point (poles) at which normals are
#: evaluated.
OFF_POLES = 1e-4


@displayed
@dataclass(frozen=True, eq=False)
class SplinePatch(Patch):
    """A smooth surface through a grid of points, in the plane a curve through a row.

    The parameters are the indices of the points. The body lies behind the normal X₁ × X₂, in the plane to the
    left of the direction of the points. Beyond its border the surface continues straight.

    Attributes:
        grid: Points of the surface, (n₁, n₂, 3) or (n₁, 2), in periodic directions with the first repeated at
            the end.
        periodic: Which directions are smoothly periodic, one boolean each.
        flipped: Whether the body lies on the other side.
    """

    grid: np.ndarray
    periodic: tuple[bool, ...] = ()
    flipped: bool = False
    _poles: tuple[np.ndarray, np.ndarray] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Detect the sides that degenerate to a point."""
        grid, counts = self.grid, self.grid.shape[:-1]
        small = 1e-9 * np.ptp(grid.reshape(-1, self.dim), axis=0).max()
        low, high = np.zeros(len(counts)), np.array(counts, dtype=float) - 1
        for axis, count in enumerate(counts):
            for end, bound, sign in ((0, low, 1), (count - 1, high, -1)):
                side = np.take(grid, end, axis=axis).reshape(-1, self.dim)
                if len(side) > 1 and np.ptp(side, axis=0).max() < small:
                    bound[axis] += sign * OFF_POLES * (count - 1)
        object.__setattr__(self, "_poles", (low, high))

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return int(self.grid.shape[-1])

    @property
    def _range(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return *self._poles, np.array(self.periodic or [False] * (self.dim - 1))

    @property
    def _borders(self) -> tuple[np.ndarray, np.ndarray]:
        # Beyond a pole the surface continues.
        return np.zeros(self.dim - 1), np.array(self.grid.shape[:-1]) - 1.0

    def _starts(self) -> np.ndarray:
        # Between the points: at poles one of two parameters is arbitrary.
        axes = [np.arange(count - 1) + 0.5 for count in self.grid.shape[:-1]]
        return tensor_grid(axes)

    @cached_property
    def _spline(self) -> BSpline | list[RectBivariateSpline]:
        from scipy.interpolate import RectBivariateSpline, make_interp_spline  # few bodies need them

        axes = [np.arange(float(count)) for count in self.grid.shape[:-1]]
        if len(axes) == 1:
            return make_interp_spline(axes[0], self.grid, k=DEGREE)
        return [RectBivariateSpline(*axes, self.grid[:, :, k], kx=DEGREE, ky=DEGREE, s=0) for k in range(3)]

    def _derivative(self, u: np.ndarray, *orders: int) -> np.ndarray:
        """Return a derivative of the position, (n, k) -> (n, k + 1)."""
        _, _, periodic = self._range
        u = np.where(periodic, u % (np.array(self.grid.shape[:-1]) - 1), u)
        if isinstance(self._spline, list):
            dx, dy = orders
            return np.stack([spline.ev(u[:, 0], u[:, 1], dx=dx, dy=dy) for spline in self._spline], axis=1)
        return np.asarray(self._spline(u[:, 0], orders[0]))

    def _position(self, u: np.ndarray) -> np.ndarray:
        return self._derivative(u, *[0] * (self.dim - 1))

    def _tangents(self, u: np.ndarray) -> np.ndarray:
        return np.stack([self._derivative(u, *row) for row in np.eye(self.dim - 1, dtype=int)], axis=2)

    def _bends(self, u: np.ndarray) -> np.ndarray:
        rows = np.eye(self.dim - 1, dtype=int)
        columns = [np.stack([self._derivative(u, *(a + b)) for a in rows], axis=2) for b in rows]
        return np.stack(columns, axis=3)
