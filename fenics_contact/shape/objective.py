"""What an objective is: a function of the state with the partial derivatives that the adjoint needs."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.contact import State
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, collective
from fenics_contact.shape.forms import ShapeForms


@displayed
@dataclass(frozen=True, eq=False)
class Partials:
    """An objective J(u, λ, X) at a state, with its partial derivatives.

    What an objective depends on through the contact points need not be differentiated by the nodes: it gives
    its derivative by their areas, and by the distances and slips B u − c, whose rows turn with the surfaces.

    Attributes:
        value: J, the same on every rank.
        by_displacement: ∂J/∂u on this rank's torn dofs, shape (torn_size,).
        by_multiplier: ∂J/∂λ, owned, shape (n_owned,).
        by_shape: ∂J/∂X at fixed u, λ, areas and B, this rank's share, shape (n_nodes, dim) for the nodes of
            all bodies; undefined at nodes that no design moves.
        by_motion: ∂J/∂q for the free motions of rigid surfaces, `FreeMotions`, replicated, shape (n_free,);
            None where J depends on them through u alone.
        by_area: ∂J/∂A by the areas of the contact points, replicated, shape (n_points,), or zero.
        by_jump: ∂J/∂(B u − c), owned, shape (n_owned,), or zero: it serves the derivative by the shape, what
            it means for u is part of ``by_displacement``.
    """

    value: float
    by_displacement: np.ndarray
    by_multiplier: np.ndarray
    by_shape: np.ndarray
    by_motion: np.ndarray | None = None
    by_area: np.ndarray | float = 0.0
    by_jump: np.ndarray | float = 0.0

    @classmethod
    def of(cls, state: State, value: float, **known: Any) -> Partials:
        """Return an objective of which only some derivatives do not vanish.

        Args:
            value: J.
            **known: Derivatives by their names, the others are zero.
        """
        torn = state.torn
        zeros = {
            "by_displacement": np.zeros(len(state.torn_displacement)),
            "by_multiplier": np.zeros(len(torn.numbering.owned)),
            "by_shape": np.zeros((torn.decomposition.tearing.n_nodes, torn.dim)),
        }
        return cls(float(value), **{**zeros, **known})


class Objective(Protocol):
    """A function of the state; the guide to shape optimisation lists those that come with the package.

    These can be added and scaled; own classes can be added to them, or derive from `Weighable`.
    """

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return J alone. Collective."""

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Evaluate J and its partial derivatives. Collective."""


def asking(comm: MPI.Comm) -> AbstractContextManager[None]:
    """Guard a block that evaluates an objective, which may be user code. Collective on ``comm``."""
    return collective(comm, "the objective", closed=True, users=True)


def finite(name: str, numbers: np.ndarray) -> np.ndarray:
    """Return what an objective gave."""
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        raise InvalidInputError(
            f"an objective must have a finite {name}, got {np.ravel(numbers)[bad[0]]} in entry {bad[0]}: "
            "check divisions, roots and logarithms of what may be zero, or raise InvalidDesignError for a "
            "design that has no value"
        )
    return numbers


def require_linear(state: State, objective: Objective) -> None:
    """Reject an objective that knows linear materials alone."""
    if state.scene.is_nonlinear:
        raise InvalidInputError(
            f"{type(objective).__name__} needs linear materials, this state has others: take contact forces "
            "or pressures, Movement, or an objective of your own"
        )


def finite_value(value: float) -> float:
    """Return the value of an objective; raises as `finite` does."""
    return float(finite("value", np.asarray(value, dtype=float)))


def finite_partials(partials: Partials) -> Partials:
    """Return an objective and its derivatives; raises as `finite` does.

    The derivative by the shape may hold anything at nodes that no design moves; it is judged as gradient.
    """
    finite_value(partials.value)
    finite("derivative by displacements", partials.by_displacement)
    finite("derivative by contact forces", partials.by_multiplier)
    finite("derivative by areas", np.asarray(partials.by_area))
    finite("derivative by slips and gaps", np.asarray(partials.by_jump))
    return partials
