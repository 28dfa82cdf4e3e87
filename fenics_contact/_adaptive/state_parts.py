"""What errors of quantities are made of, of states of linear materials and of those that deform much."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fenics_contact._accuracy.discretisation import (
    ErrorProducts,
    OfCells,
    discretisation_error,
    error_products,
)
from fenics_contact._adaptive.boundary_errors import Change, LinearChange
from fenics_contact._adaptive.contact_residuals import Faced, at_rest
from fenics_contact.design.adjoint import Adjoint
from fenics_contact.design.objective import Partials
from fenics_contact.results.linear_state import LinearState


@dataclass(frozen=True, eq=False)
class StateParts(ABC):
    """The parts of the errors of quantities of a state that depend on how its bodies deform."""

    state: Any

    #: Why no quantity of the state has an adjoint, in words; empty where some have.
    without_adjoint = ""

    @property
    def faced(self) -> Faced:
        """Where slaves are found between their nodes."""
        return at_rest

    def at_rest(self, partials: Partials) -> Partials:
        """Return derivatives without those by motions that the state does not have. Collective."""
        return partials

    @abstractmethod
    def products(self, adjoint: np.ndarray) -> ErrorProducts:
        """Return products of the errors of the state and of the displacement of an adjoint. Collective."""

    @abstractmethod
    def change_of_work(self) -> Change:
        """Return what the work of stresses changes by when nodes move. Collective."""

    def by_gaps(self, adjoint: Adjoint) -> float:
        """Return ζ·(g* − g), the effect of gaps g* between better known surfaces. Collective; no product."""
        torn = self.state.torn
        if not torn.points.count:
            return 0.0
        weight = torn.numbering.gather(adjoint.multiplier, torn.normal_rows)
        return float(weight @ (torn.finer_gap() - torn.points.gap))

    @abstractmethod
    def indicators(self) -> OfCells:
        """Return what says of each cell that it is too large where there is no adjoint. Collective."""


class LinearParts(StateParts):
    """Those of a state of linear materials: by energies."""

    state: LinearState

    def at_rest(self, partials: Partials) -> Partials:
        """A state has no mean motion where nothing resists it, and the load of its adjoint none either."""
        along = self.state.dual.at_rest_transposed(partials.by_displacement)
        return replace(partials, by_displacement=along)

    def products(self, adjoint: np.ndarray) -> ErrorProducts:
        return error_products(self.state.torn, self.state.conforming_displacement, adjoint)

    def change_of_work(self) -> Change:
        return LinearChange.of(self.state.torn)

    def indicators(self) -> OfCells:
        state = self.state
        return discretisation_error(state.torn, state.conforming_displacement).own_cells
