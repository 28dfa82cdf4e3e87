"""What loads exchange with bodies, in matrices and vectors of one subdomain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp


class Place(Protocol):
    """A subdomain as loads see it; values at its nodes have the shape (n,)."""

    @property
    def points(self) -> np.ndarray:
        """Its nodes, shape (n, dim), [length]."""

    def volume(self, values: np.ndarray, region: str) -> sp.csr_matrix:
        """Return ∫ s u v over its part of a region, with s at nodes, shape (n, n)."""

    def surface(self, values: np.ndarray, surface: str) -> sp.csr_matrix:
        """Return ∫ s u v over its part of a surface, shape (n, n)."""

    def area(self, surface: str) -> float:
        """Return the area of a whole surface of its body, [length²]."""

    def share(self, nodes: str) -> np.ndarray:
        """Return its share in each of some nodes, zero at others, (n,)."""

    def own(self, values: float | np.ndarray) -> np.ndarray:
        """Return its share of values at the nodes of its body, (n_nodes,), as (n,)."""


@dataclass(frozen=True, eq=False)
class Exchange:
    """The heat f − M T that a load gives to a subdomain: M, shape (n, n), and f, shape (n,)."""

    matrix: sp.csr_matrix
    load: np.ndarray

    def heat(self, temperature: np.ndarray) -> float:
        """Return what the load gives at temperatures, (n,), [power]."""
        return float(self.at_nodes(temperature).sum())

    def at_nodes(self, temperature: np.ndarray) -> np.ndarray:
        """Return what it gives to each node, (n,), [power]."""
        return np.asarray(self.load - self.matrix @ temperature)


def given(load: np.ndarray) -> Exchange:
    """Return the exchange of heat that does not depend on the temperature."""
    return Exchange(sp.csr_matrix((len(load), len(load))), load)
