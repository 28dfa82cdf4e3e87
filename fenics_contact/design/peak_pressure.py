"""The peak of a contact pressure, from a polynomial through the pressures of nodes around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import checked
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.parts import surface_of
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.objective import Partials, Weighable
from fenics_contact.design.objectives import nothing_touches, on_normal_rows, require_pair
from fenics_contact.design.sensitivity import by_true_areas
from fenics_contact.errors import InvalidInputError
from fenics_contact.results.state import State


@dataclass(frozen=True)
@checked()
class PeakPressure(Weighable):
    """J = max p*_i with p*_i the recovered pressure at the nodes of a slave, [force / length²].

    The force of a node over its area wavers from node to node, above all where numbers of facets around nodes
    differ: on linear tetrahedra that were halved by 5 % where the mesh has the mean to 1 %. p*_i is the value
    at the node of the quadratic polynomial in the tangential plane that fits, weighted by areas, the
    pressures of the pressing nodes up to a few facets around it, and of their images across planes of
    symmetry. It is exact for pressures of second degree, and for facets of equal areas nearly the mean.

    There is no derivative by the shape: `LargestPressure` and `PressureNorm` have one.

    Attributes:
        pair: Number of the contact pair in the scene; None for the largest of all pairs.

    Example:
        >>> PeakPressure(pair=0)
        PeakPressure(pair=0)
    """

    pair: int | None = None

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the peak.

        Raises:
            InvalidInputError: If there is no such pair.
            InvalidDesignError: If nothing touches.
        """
        return self._weights(state)[0]

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Return the derivatives by forces; raises as `value` does, and for a design that moves nodes."""
        if not forms.nothing_moves:
            raise InvalidInputError(
                "PeakPressure has no derivative by the shape: take LargestPressure or PressureNorm"
            )
        value, by_force = self._weights(state)
        by_area = -by_force * state.contact.normal_force / state.contact.area
        by_multiplier = on_normal_rows(state, by_force)
        return Partials.of(state, value, by_multiplier=by_multiplier, **by_true_areas(state, by_area))

    def _weights(self, state: State) -> tuple[float, np.ndarray]:
        """Return the peak and its derivatives by the normal forces, shape (n_points,)."""
        pairs = range(len(state.scene.contacts))
        if self.pair is not None:
            require_pair(state.scene, "PeakPressure", self.pair)
            pairs = range(self.pair, self.pair + 1)
        found = [found for pair in pairs if (found := _peak_of(state, pair)) is not None]
        if not found:
            raise nothing_touches(self, self.pair)
        return max(found, key=lambda each: each[0])


def _peak_of(state: State, pair: int) -> tuple[float, np.ndarray] | None:
    """Return the peak of a pair and its derivatives by the forces of all points; None where none presses."""
    contact, slave = state.contact, surface_of(state.scene, state.scene.contacts[pair].slave, "faceted")
    mine = contact.on_pair(pair)
    mine = mine[contact.normal_force[mine] > 0.0]
    if not len(mine):
        return None
    first = NodeNumbers.of(state.scene).first_of(state.scene.contacts[pair].slave.body)
    node = np.searchsorted(slave.nodes, contact.points.slave[mine] - first)
    near = _near(slave)[node][:, node]
    force, area = contact.normal_force[mine], contact.area[mine]
    top = int(np.argmax((near @ force) / (near @ area)))
    around = _rings(near, 1 if slave.facets.shape[1] != 3 else 2, top)
    patches = _Patches(slave, node, near, area, contact.points.tangents[mine])
    fits = [(float(weights @ (force / area)[use]), use, weights) for use, weights in patches.fits(around)]
    value, use, weights = max(fits, key=lambda each: each[0])
    by_force = np.zeros(contact.points.count)
    by_force[mine[use]] = weights / area[use]
    return value, by_force


def _near(slave: FacetedSurface) -> sp.csr_matrix:
    """Return which nodes have a facet in common, themselves included, (n, n), entries 1."""
    count, corners = slave.facets.shape
    entries = np.ones(slave.facets.size), slave.facets.ravel(), np.arange(0, slave.facets.size + 1, corners)
    of_facets = sp.csr_matrix(entries, shape=(count, len(slave.nodes)))
    near = (of_facets.T @ of_facets).tocsr()
    near.data[:] = 1.0
    return near


def _rings(near: sp.csr_matrix, rings: int, start: int) -> np.ndarray:
    """Return the nodes up to some facets away from one, ascending."""
    found = np.array([start])
    for _ in range(rings):
        found = np.unique(near[found].indices)
    return found


@dataclass(frozen=True)
class _Patches:
    """Pressing nodes of a slave."""

    slave: FacetedSurface
    node: np.ndarray
    near: sp.csr_matrix
    area: np.ndarray
    tangents: np.ndarray

    def fits(self, nodes: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield for some nodes the nodes around and their weights in the fitted pressure."""
        for centre in nodes:  # a few nodes next to the peak
            use = self._around(int(centre))
            yield use, self._weights(int(centre), use)

    def _around(self, centre: int, largest: float = 0.4) -> np.ndarray:
        """Return the nodes up to three facets away, fewer where they cover more than a part of the contact.

        Towards the edge of a contact pressures fall like no polynomial.
        """
        use = _rings(self.near, 1, centre)
        for _ in range(1 if self.slave.facets.shape[1] != 3 else 2):
            wider = np.unique(self.near[use].indices)
            if self.area[wider].sum() > largest * self.area.sum():
                break
            use = wider
        return use

    def _weights(self, centre: int, use: np.ndarray) -> np.ndarray:
        places = self.slave.points[self.node]
        away, origin = places[use] - places[centre], np.arange(len(use))
        reach = np.linalg.norm(away, axis=1).max()
        if reach == 0.0:
            return np.ones(1)
        for plane in np.flatnonzero(self.slave.mirrored[self.node[use]].any(axis=0)):
            away, origin = self._with_images(int(plane), use, away, origin, reach)
        flat = away @ self.tangents[centre].T / reach
        columns = [np.ones(len(flat)), *flat.T]
        width = flat.shape[1]
        columns += [flat[:, i] * flat[:, j] for i in range(width) for j in range(i, width)]
        share = np.sqrt(self.area[use][origin])
        fitted = np.stack(columns, axis=1) * share[:, None]
        # Where the nodes do not determine a polynomial, the smallest one is taken.
        weights = np.linalg.pinv(fitted, rcond=1e-6)[0] * share
        return np.bincount(origin, weights, len(use))

    def _with_images(
        self, plane: int, use: np.ndarray, away: np.ndarray, origin: np.ndarray, reach: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Add the images of nodes across a plane of symmetry that lie within reach."""
        normal = self.slave.planes[plane]
        on_plane = self.slave.mirrored[self.node[use], plane]
        height = (away - away[np.flatnonzero(on_plane)[0]]) @ normal
        images = away - 2.0 * height[:, None] * normal
        inside = (np.abs(height) > 1e-9 * reach) & (np.linalg.norm(images, axis=1) <= (1.0 + 1e-9) * reach)
        return np.concatenate([away, images[inside]]), np.concatenate([origin, origin[inside]])
