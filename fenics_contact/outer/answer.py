"""The result of a response."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Answer:
    """Quantities of interest at one set of parameters, bitwise equal on all ranks.

    Attributes:
        parameters: Every parameter with its value.
        values: Quantity to value; nan where there is no state.
        subgradients: Quantity to a subgradient by the parameters, shape (n_parameters,), where it is known.
        failure: Why there is no state; empty where there is one.
        products: Number of products with the dual operator.
    """

    parameters: Mapping[str, float]
    values: Mapping[str, float]
    subgradients: Mapping[str, np.ndarray] = field(default_factory=dict)
    failure: str = ""
    products: int = 0

    def __getitem__(self, quantity: str) -> float:
        """Return the value of a quantity."""
        return self.values[quantity]

    @property
    def array(self) -> np.ndarray:
        """Values in the order of the quantities, shape (n_quantities,)."""
        return np.array(list(self.values.values()), dtype=float)
