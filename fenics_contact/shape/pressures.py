"""Contact pressures as objectives: the largest, a smooth bound of it, how even they are, on what area."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import checked
from fenics_contact.contact import State
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.linalg import ROUNDING
from fenics_contact.scene import Scene
from fenics_contact.shape.area_derivative import by_true_areas
from fenics_contact.shape.contact_forces import on_rows
from fenics_contact.shape.forms import ShapeForms
from fenics_contact.shape.objective import Partials
from fenics_contact.shape.sums import Weighable

#: Value, derivative by forces and by areas of the points, shape (n,) each.
OfPoints = tuple[float, np.ndarray, np.ndarray]


@dataclass(frozen=True)
@checked()
class OfPressures(Weighable, ABC):
    """J = φ(λ_N, A), a function of normal forces and areas of the slave's nodes.

    A node's pressure is its force over its area, that of the deformed slave where it deforms much, as of
    `ContactResult.pressure`. Nodes on the rim of a surface have small areas: where facets
    are wide, their pressure is less certain than that of the others.

    Attributes:
        pair: Number of the contact pair in the scene; None for the points of all pairs.
    """

    pair: int | None = None

    @abstractmethod
    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return φ and its derivatives.

        Args:
            force: λ_N, shape (n,), [force], some positive.
            area: A, shape (n,), [length²].
        """

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return φ.

        Raises:
            InvalidInputError: If there is no such pair.
            InvalidDesignError: If nothing touches.
        """
        return self._evaluated(state)[0]

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Return the derivatives by forces and areas; raises as `value` does. Collective."""
        value, by_force, by_area = self._evaluated(state)
        by_areas = by_true_areas(state, by_area)
        return Partials.of(state, value, by_multiplier=on_rows(state, by_force, None), **by_areas)

    def _evaluated(self, state: State) -> OfPoints:
        contact = state.contact
        mine = points_of(state, type(self).__name__, self.pair)
        force, area = contact.normal_force[mine], contact.area[mine]
        if not (force > 0.0).any():
            where = "no contact pair" if self.pair is None else f"not contact pair {self.pair}"
            raise InvalidDesignError(
                f"{type(self).__name__} needs surfaces that touch, but {where} of this design transmits a "
                "force: press the bodies together, or keep the design closer to one that touches"
            )
        value, *derivatives = self.of_points(force, area)
        by_force, by_area = np.zeros((2, contact.points.count))
        by_force[mine], by_area[mine] = derivatives
        return value, by_force, by_area


def points_of(state: State, what: str, pair: int | None) -> np.ndarray:
    """Return the numbers of the contact points of a pair, of all pairs if it is None."""
    if pair is None:
        return np.arange(state.contact.points.count)
    require_pair(state.scene, what, pair)
    return state.contact.on_pair(pair)


def require_pair(scene: Scene, what: str, pair: int) -> None:
    """Check the number of a pair."""
    count = len(scene.contacts)
    if not 0 <= pair < count:
        known = f"0 to {count - 1}" if count else "but it has none"
        raise InvalidInputError(
            f"{what}.pair must be the number of a contact pair of the scene, {known}, got {pair!r}: "
            "leave it out for all pairs"
        )


@dataclass(frozen=True)
@checked()
class LargestPressure(OfPressures):
    """J = max p_i, the largest pressure of a node, [force / length²].

    The subgradient is that of the node with the largest pressure; where several are equal, to rounding, that
    of the first. While one node after the other is lowered J has kinks, which the bundle method knows how to
    deal with; `PressureNorm` has none.

    Example:
        >>> LargestPressure(pair=0)
        LargestPressure(pair=0)
    """

    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the largest pressure; only its node has derivatives."""
        pressure = force / area
        first = int(np.argmax(pressure >= (1.0 - ROUNDING) * pressure.max()))
        by_force, by_area = np.zeros((2, len(force)))
        by_force[first] = 1.0 / area[first]
        by_area[first] = -pressure[first] / area[first]
        return float(pressure[first]), by_force, by_area


@dataclass(frozen=True)
@checked()
class PressureNorm(OfPressures):
    """J = (Σ A_i p_i^p / Σ A_i)^(1/p), a smooth bound of the largest pressure from below, [force / length²].

    The sums are over all slave nodes, open ones included, so that nothing jumps where points open or close.
    With the node of the largest pressure p_max and its area A_k

        J ≤ p_max ≤ J (Σ A_i / A_k)^(1/p).

    The larger p, the closer, and the more J behaves like the maximum with its kinks.

    Attributes:
        p: Exponent from 2 to 100; the mean, p = 1, is given by the load, not by the shape.

    Raises:
        InvalidInputError: If p is out of its range.

    Example:
        >>> PressureNorm(p=12.0).p
        12.0
    """

    p: float = 8.0

    def __post_init__(self) -> None:
        """Check the exponent."""
        require_exponent("PressureNorm", self.p)

    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the norm; pressures are divided by the largest one first, as powers overflow."""
        pressure, total, p = force / area, area.sum(), self.p
        scale = pressure.max()
        value = scale * float(area @ (pressure / scale) ** p / total) ** (1.0 / p)
        ratio = pressure / value
        return value, ratio ** (p - 1.0) / total, value / (p * total) * ((1.0 - p) * ratio**p - 1.0)


def require_exponent(what: str, p: float) -> None:
    """Check the exponent of a smooth bound of a largest value, of which powers must not overflow."""
    if not 2.0 <= p <= 100.0:
        raise InvalidInputError(
            f"{what}.p must be a number from 2 to 100, got {p!r}: the larger, the closer to the largest "
            "value, try 8"
        )


@dataclass(frozen=True)
@checked()
class PressureUnevenness(OfPressures):
    """J = Σ A_i (p_i − m)² / (m² Σ A_i), m = Σ A_i p_i / Σ A_i: zero where the pressure is even, no unit.

    It is the square of the relative standard deviation over the whole slave surface. Open points count with
    p = 0: a mean over closed points only would jump where one opens. So J also rewards a large area in
    contact, J = Σ A_i / A_c − 1 with the area A_c of `ContactArea`.
    """

    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the unevenness."""
        spread, by_force, by_area = _effective_area(force, area)
        total = area.sum()
        by_spread = -total / spread**2
        return float(total / spread - 1.0), by_spread * by_force, 1.0 / spread + by_spread * by_area


@dataclass(frozen=True)
@checked()
class ContactArea(OfPressures):
    """J = (Σ A_i p_i)² / Σ A_i p_i², the area in contact, smooth, [length²].

    The area on which an even pressure has the same resultant and the same mean square. Where the pressure is
    even it is the area in contact; it is 8/9 of that of Hertz' elliptic spot and 0.925 of that of his strip.
    `contact.contact_area` locates the rim between nodes; its derivative is infinite where nodes open. Here
    the pressures of all nodes are differentiated and their areas, not the place of the rim.

    To enlarge it, minimise ``-ContactArea()`` or `PressureUnevenness`.
    """

    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the area."""
        return _effective_area(force, area)


def _effective_area(force: np.ndarray, area: np.ndarray) -> OfPoints:
    """Return (Σ λ)² / Σ λ² / A and its derivatives."""
    total, pressure = force.sum(), force / area
    squares = force @ pressure
    value = total**2 / squares
    return float(value), 2.0 * value * (1.0 / total - pressure / squares), value * pressure**2 / squares
