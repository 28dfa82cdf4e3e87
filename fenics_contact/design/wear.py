"""Objectives of wear: volume, depth and evenness of what contact has taken away."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.objective import Partials, require_linear
from fenics_contact.design.objectives import (
    LargestPressure,
    OfPoints,
    OfPressures,
    PressureNonuniformity,
    PressureNorm,
    points_of,
    require_exponent,
)
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.results.state import State


@dataclass(frozen=True)
@checked()
class OfWear(OfPressures, ABC):
    """J = φ(V, A), a function of the volumes V_i = A_i w_i worn off at the slave's nodes, and of their areas.

    The depth w is that of both surfaces together, after all load steps up to the one judged: in a `LoadPath`
    give the objective of the last step alone, ``objectives={"last": WornVolume()}``.

    Attributes:
        pair: Number of the contact pair in the scene; None for the points of all pairs that wear.
    """

    is_of_slip = True

    can_be_infinite = False

    def of_nothing(self) -> float:
        """Return φ where nothing is worn."""
        return 0.0

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Return the derivatives by depths and areas; raises as `value` does, and without wear."""
        value, by_worn, by_area = self._evaluated(state)
        return Partials.of(state, value, by_worn=by_worn, by_area=by_area)

    def _evaluated(self, state: State) -> OfPoints:
        require_linear(state, self)
        contact, mine = state.contact, points_of(state, type(self).__name__, self.pair)
        wearing = np.array([bool(each.wears) for each in state.scene.contacts], dtype=bool)
        mine = mine[wearing[contact.points.pair[mine]]]
        if not len(mine):
            raise InvalidInputError(
                f"{type(self).__name__} needs a pair that wears, got pair={self.pair} of a scene where "
                f"{int(wearing.sum())} of {len(wearing)} do: give it wear=Wear(...)"
            )
        depth, area = contact.worn_depth[mine], contact.area[mine]
        by_worn, by_area = np.zeros((2, contact.points.count))
        if not depth.any():
            return self.of_nothing(), by_worn, by_area
        value, by_volume, by_own = self.of_points(area * depth, area)
        by_worn[mine], by_area[mine] = by_volume * area, by_own + by_volume * depth
        return value, by_worn, by_area


@dataclass(frozen=True)
@checked()
class WornVolume(OfWear):
    """J = Σ A_i w_i, the volume worn off both surfaces, [length³].

    Of one step from rest with `Wear.cycles` of one it is that of a cycle. With a constant coefficient it is k
    times the sum of forces times slips; with friction, k / μ times `FrictionWork`.

    Example:
        >>> 1e3 * WornVolume(pair=0)
        WeightedSum(terms=((1000.0, WornVolume(pair=0)),))
    """

    def of_points(self, volume: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the sum."""
        return float(volume.sum()), np.ones(len(volume)), np.zeros(len(volume))


@dataclass(frozen=True)
@checked()
class LargestWornDepth(OfWear):
    """J = max w_i, the largest worn depth of a node, [length]; kinks and subgradient as `LargestPressure`.

    Example:
        >>> LargestWornDepth(pair=0)
        LargestWornDepth(pair=0)
    """

    def of_points(self, volume: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the largest depth."""
        return LargestPressure().of_points(volume, area)


@dataclass(frozen=True)
@checked()
class WornDepthNorm(OfWear):
    """J = (Σ A_i w_i^p / Σ A_i)^(1/p), a smooth bound of the largest depth from below, [length].

    As `PressureNorm` is one of the largest pressure. Where the depth is even it is the depth.

    Attributes:
        p: Exponent from 2 to 100.

    Raises:
        InvalidInputError: If p is out of its range.

    Example:
        >>> WornDepthNorm(p=12.0).p
        12.0
    """

    p: float = 8.0

    def __post_init__(self) -> None:
        """Check the exponent."""
        require_exponent("WornDepthNorm", self.p)

    def of_points(self, volume: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the norm."""
        return PressureNorm(p=self.p).of_points(volume, area)


@dataclass(frozen=True)
@checked()
class WearNonuniformity(OfWear):
    """J = Σ A_i (w_i − m)² / (m² Σ A_i) with the mean depth m: zero where wear is even, no unit.

    As `PressureNonuniformity` of the pressure: open nodes count, with w = 0.
    """

    def of_points(self, volume: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the unevenness."""
        return PressureNonuniformity().of_points(volume, area)

    def of_nothing(self) -> float:
        """Reject a design that wears nowhere."""
        raise InvalidDesignError(
            "WearNonuniformity needs surfaces that wear, but nothing is worn: let them press and slide"
        )
