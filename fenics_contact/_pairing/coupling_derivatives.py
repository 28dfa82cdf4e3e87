"""Derivatives of a scalar by the results of a mortar coupling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._base.display import displayed


@displayed
@dataclass(frozen=True)
class CouplingDerivatives:
    """Derivatives of a scalar by the results of a mortar coupling.

    The derivative by the weight of master node j at slave node i is left_i · right_j.

    Attributes:
        area: By the areas, shape (n,).
        left: Factors of the derivatives by the weights at each slave node, shape (n, r).
        right: Factors at each node of the master, shape (len(master.nodes), r).
        normal: By the normals, shape (n, dim).
        gap: By the gaps, shape (n,).
        own: Factors at each node of the slave, shape (len(slave.nodes), r): the derivative by its weight in
            the slave's mean at point i is −left_i · own_j. Needed where such means have several nodes.
        relief: By the reliefs beside what the gaps have of them, shape (n, dim).
    """

    area: np.ndarray
    left: np.ndarray
    right: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    own: np.ndarray | None = None
    relief: np.ndarray | None = None
