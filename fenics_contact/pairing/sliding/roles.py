"""Which nodes are slaves where a surface meets itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.pairing.sliding.patches import SmoothPatches
from fenics_contact.surfaces import Projection

#: What decides where ways between places that meet do not, along the axes of the surface: square to no side
#: that meshes usually have.
LEANING = np.array([0.4796, 0.7311, 0.4853])
#: Lengths that differ by less than this part count as the same: which node is first among them may not depend
#: on rounding, nor on how the body lies in space.
ALIKE = 1e-6
#: Its weight beside one way, of length one.
LIGHT = 0.1


@dataclass(frozen=True)
class Roles:
    """Slaves and masters on a surface that meets itself: one of two places that meet, never both.

    Both would be kept out twice, by forces that are not unique. A node that has a point keeps it. Nodes that
    begin to meet others are masters where these are slaves already. Else the ways count that lead from them
    to their points in the undeformed body: all nodes whose ways go forward along the axis to which most ways
    are parallel are slaves. So those of one side of a fold are, as a whole.

    Attributes:
        patches: The surface.
        places: Its nodes in the undeformed body, shape (n_nodes, dim), [length].
        candidates: Its nodes that may be slaves, shape (n_candidates,).
        touched: Whether a candidate moves a patch, shape (n_facets, n_candidates).
    """

    patches: SmoothPatches
    places: np.ndarray
    candidates: np.ndarray
    touched: sp.csr_matrix

    def are_slaves(self, found: Projection, last: np.ndarray) -> np.ndarray:
        """Return which closest points make their candidates slaves, shape (n,).

        Args:
            found: Closest points; ``point`` counts the candidates.
            last: Last facets of all candidates, −1 where there is none, shape (n_candidates,).
        """
        known = last[found.point] >= 0
        return known | (self._go_forward(found, known) & ~self._are_masters(found, last))

    def _go_forward(self, found: Projection, known: np.ndarray) -> np.ndarray:
        """Return which ways to closest points go forward, those of known slaves mostly do, shape (n,)."""
        weights = self.patches.weights(found.facet, self.patches.functions(found.local).value)
        way = weights @ self.places - self.places[self.candidates[found.point]]
        way /= np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)[:, None]
        leaning = LIGHT * self._leaning
        _, axes = np.linalg.eigh(way.T @ way / max(len(way), 1) + np.outer(leaning, leaning))
        along = way @ axes[:, ::-1] * np.sign((way[known].sum(axis=0) + leaning) @ axes[:, ::-1])
        chosen = np.argmax(np.abs(along) >= 0.5, axis=1)  # in space one of three is, in the plane one of two
        return np.asarray(along[np.arange(len(way)), chosen] > 0.0)

    @cached_property
    def _leaning(self) -> np.ndarray:
        """Return a direction that turns with the body, shape (dim,): nodes decide, by their numbers."""
        arms = self.places - self.places.mean(axis=0)
        direction = np.zeros(arms.shape[1])
        for share in LEANING[: arms.shape[1]]:
            lengths = np.linalg.norm(arms, axis=1)
            if lengths.max() == 0.0:
                break
            first = int(np.argmax(lengths >= (1.0 - ALIKE) * lengths.max()))
            axis = arms[first] / lengths[first]
            direction += share * axis
            arms = arms - np.outer(arms @ axis, axis)
        return direction

    def _are_masters(self, found: Projection, last: np.ndarray) -> np.ndarray:
        """Return which candidates move the patches of slaves that move their own, shape (n,)."""
        met = np.flatnonzero(last >= 0)
        slaves = self.touched[found.facet][:, met]
        theirs = self.touched[last[met]][:, found.point]
        return np.asarray(slaves.multiply(theirs.T).sum(axis=1)).ravel() > 0.0
