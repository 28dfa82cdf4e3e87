"""Lengths, areas and volumes of half a section that is turned around an axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact._kinematics.measure import Measure
from fenics_contact.mesh.faces import computed_rounding


@dataclass(frozen=True)
class RevolvedMeasure(Measure):
    """Each is that of a full revolution; the first coordinate is the radius."""

    varies = True

    def around(self, first: Any) -> Any:
        """Return the circumference."""
        return 2 * np.pi * first

    def weights(self, weight: np.ndarray, functions: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Return weights with the circumference in them."""
        return np.asarray(2 * np.pi * weight * np.einsum("nqk,nk->nq", functions, first))

    def density(
        self, value: np.ndarray, by_place: np.ndarray, first: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return a density times the circumference, and its derivative by the place."""
        outwards = np.stack([value, np.zeros_like(value)], axis=1)
        return self.around(first) * value, 2 * np.pi * (first[:, None] * by_place + outwards)

    def bearing(self, points: np.ndarray, facets: np.ndarray, areas: np.ndarray) -> np.ndarray:
        """Return the areas with those of ends of quadratic edges on the axis moved to their midpoints."""
        if facets.shape[1] != 3:
            return areas
        ends = np.where(_on_axis(points, facets), areas[:, :2], 0.0)
        areas[:, :2] -= ends
        areas[:, 2] += ends.sum(axis=1)
        return areas

    def bearing_pulled_back(self, points: np.ndarray, facets: np.ndarray, by_areas: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of `bearing`."""
        if facets.shape[1] == 3:
            by_areas[:, :2] = np.where(_on_axis(points, facets), by_areas[:, 2:], by_areas[:, :2])
        return by_areas

    def ends(self, points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of quadratic edges on the axis, and their midpoints.

        A uniform pressure makes no force at such an end, but a tip that presses there does.
        """
        if facets.shape[1] != 3:
            return super().ends(points, facets)
        facet, end = np.nonzero(_on_axis(points, facets))
        return facets[facet, end], facets[facet, 2]

    def filled(self, facets: np.ndarray, values: np.ndarray, on_axis: np.ndarray) -> np.ndarray:
        """Return values with those at ends of quadratic edges on the axis: those of an even parabola.

        Larger values stay: a tip that presses there has no neighbour that does.
        """
        result = values.copy()
        if facets.shape[1] == 3:
            for here, there in ((0, 1), (1, 0)):
                edges = facets[on_axis[facets[:, here]]]
                even = (4 * values[edges[:, 2]] - values[edges[:, there]]) / 3
                result[edges[:, here]] = np.maximum(values[edges[:, here]], even)
        return result


def _on_axis(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return which ends of quadratic edges lie on the axis, (n_facets, 2)."""
    return np.asarray(points[facets[:, :2], 0] <= computed_rounding(points))
