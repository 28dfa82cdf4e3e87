"""How lengths, areas and volumes in coordinates are those of bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Measure:
    """Lengths, areas and volumes are those of the coordinates; around an axis see `RevolvedMeasure`."""

    #: Whether facets of one size have different areas at different places.
    varies = False

    def around(self, first: Any) -> Any:
        """Return the measure per measure in coordinates, (...) or UFL, by first coordinates, [length]."""
        return 1.0

    def around_closed(self, first: np.ndarray, closed: np.ndarray, share: np.ndarray) -> np.ndarray | float:
        """Return `around` in the middle of the closed share of facets, (n,).

        `first`, `closed`: first coordinates and marks of their corners.
        """
        return 1.0

    def weights(self, weight: np.ndarray, functions: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Return weights of the points of cells on facets, as weights of a quadrature.

        `functions`: functions of the nodes of facets, (n, q, nodes); `first`: their first coordinates.
        """
        return weight

    def density(
        self, value: np.ndarray, by_place: np.ndarray, first: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return a density per measure in coordinates, (n,), and its derivative by the place, (n, dim)."""
        return value, by_place

    def bearing(self, points: np.ndarray, facets: np.ndarray, areas: np.ndarray) -> np.ndarray:
        """Return areas of the nodes of facets, (n_facets, nodes), moved to those that carry a pressure."""
        return areas

    def bearing_pulled_back(self, points: np.ndarray, facets: np.ndarray, by_areas: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of `bearing` with respect to the areas, (n_facets, nodes)."""
        return by_areas

    def ends(self, points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of facets to which no area belongs, and the midpoints beside them, (n,) each."""
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)

    def filled(self, facets: np.ndarray, values: np.ndarray, on_axis: np.ndarray) -> np.ndarray:
        """Return values at nodes with those at ends to which no area belongs filled in.

        `on_axis`: marks of nodes.
        """
        return values


#: That of solid and plane bodies.
PLAIN = Measure()
