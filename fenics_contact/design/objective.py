"""What an objective is: a function of the state with its partial derivatives; sums and maxima of them."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass, fields
from typing import Any, Protocol, cast

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact.design.forms import ShapeForms
from fenics_contact.errors import InvalidInputError, collective
from fenics_contact.results.state import State


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
            or zero, where J depends on them through u alone.
        by_area: ∂J/∂A by the areas of the contact points, replicated, shape (n_points,), or zero.
        by_jump: ∂J/∂(B u − c), owned, shape (n_owned,), or zero: it serves the derivative by the shape, what
            it means for u is part of ``by_displacement``.
        by_sliding: The same by slips of the contact points without friction, which have no rows, replicated,
            shape (n_frictionless, dim − 1), or zero.
        by_worn: ∂J/∂w by the depth that has been worn off contact points, replicated, shape (n_points,), or
            zero; what it means for u, λ and X is no part of the others.
    """

    value: float
    by_displacement: np.ndarray
    by_multiplier: np.ndarray
    by_shape: np.ndarray
    by_motion: np.ndarray | float = 0.0
    by_area: np.ndarray | float = 0.0
    by_jump: np.ndarray | float = 0.0
    by_sliding: np.ndarray | float = 0.0
    by_worn: np.ndarray | float = 0.0

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
            "by_shape": np.zeros((torn.decomposition.tearing.n_nodes, torn.components)),
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


def guarded_user_call(comm: MPI.Comm) -> AbstractContextManager[None]:
    """Guard a block that evaluates an objective, which may be user code. Collective on ``comm``."""
    return collective(comm, "the objective", closed=True, users=True)


def finite(name: str, numbers: np.ndarray) -> np.ndarray:
    """Return what an objective gave."""
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        raise InvalidInputError(
            f"an objective must have a finite {name}, got {np.ravel(numbers)[bad[0]]} in entry {bad[0]}: "
            "check divisions, roots and logarithms, or raise InvalidDesignError where it has none"
        )
    return numbers


def require_linear(state: State, objective: object) -> None:
    """Reject an objective that knows linear materials alone."""
    if state.scene.is_nonlinear:
        raise InvalidInputError(
            f"{type(objective).__name__} needs linear materials, got others: take contact forces or Movement"
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
    finite("derivative by worn depths", np.asarray(partials.by_worn))
    return partials


class Weighable:
    """An objective that can be added to others and scaled: ``TotalPotential() + 2.0 * penalty``."""

    #: NumPy's numbers leave products to this class.
    __array_ufunc__ = None

    #: Shares s and l of ½ a(u, u) and of the work −L(u) in it, beside which it depends on the state alone.
    energies = (0.0, 0.0)
    #: Whether it is made of slip.
    is_of_slip = False

    @property
    def can_be_infinite(self) -> bool:
        """Whether it may grow without limit as cells get smaller, as stresses at sharp corners do.

        Areas, forces, movements and energies never do; nobody knows it of an objective that does not say.
        """
        return True

    def __mul__(self, weight: float) -> WeightedSum:
        """Return the objective times a number."""
        return WeightedSum(((weight, cast(Objective, self)),))

    __rmul__ = __mul__

    def __add__(self, other: Objective) -> WeightedSum:
        """Return the sum of two objectives."""
        return WeightedSum((*_terms(self), *_terms(other)))

    def __radd__(self, other: Objective) -> WeightedSum:
        """Return the sum with an objective that defines no sum itself."""
        return WeightedSum((*_terms(other), *_terms(self)))

    def __neg__(self) -> WeightedSum:
        """Return the objective with the other sign."""
        return -1.0 * self

    def __sub__(self, other: Objective) -> WeightedSum:
        """Return the difference of two objectives."""
        return self + -1.0 * WeightedSum(_terms(other))


@dataclass(frozen=True)
class WeightedSum(Weighable):
    """J = Σ w_k J_k, what sums and multiples of objectives are.

    Attributes:
        terms: Weights w_k and objectives J_k, at least one.

    Raises:
        InvalidInputError: If there is no term, a weight is no finite number, or a term no objective.

    Example:
        >>> from fenics_contact.design import TotalPotential, VolumeIntegral
        >>> light = TotalPotential() + 2.0 * VolumeIntegral("area", lambda u, x, stress: u[0] ** 2, "link")
        >>> [weight for weight, _ in light.terms]
        [1.0, 2.0]
    """

    terms: tuple[tuple[float, Objective], ...]

    def __post_init__(self) -> None:
        """Check weights and objectives."""
        if not self.terms:
            raise InvalidInputError("WeightedSum needs a term, got none: give (weight, objective)")
        for weight, objective in self.terms:
            if not isinstance(weight, int | float | np.number) or not np.isfinite(weight):
                raise InvalidInputError(
                    f"an objective's weight must be a finite number, got {weight!r}: write 2.0 * objective"
                )
            _require_objective(objective, "WeightedSum")

    @property
    def energies(self) -> tuple[float, float]:  # type: ignore[override]
        """The sums of those of the terms."""
        known = [(weight, getattr(each, "energies", (0.0, 0.0))) for weight, each in self.terms]
        strain, load = (float(sum(weight * each[k] for weight, each in known)) for k in (0, 1))
        return strain, load

    @property
    def is_of_slip(self) -> bool:  # type: ignore[override]
        """Whether one of the terms is."""
        return any(getattr(each, "is_of_slip", False) for _, each in self.terms)

    @property
    def can_be_infinite(self) -> bool:
        """Whether one of the terms can."""
        return any(can_be_infinite(objective) for _, objective in self.terms)

    def __mul__(self, weight: float) -> WeightedSum:
        """Return the sum times a number."""
        return WeightedSum(tuple((weight * own, objective) for own, objective in self.terms))

    __rmul__ = __mul__

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the sum alone. Collective."""
        return float(sum(weight * objective.value(state, forms) for weight, objective in self.terms))

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Add the partial derivatives. Collective."""
        parts = [(weight, objective.partials(state, forms)) for weight, objective in self.terms]

        def total(name: str) -> Any:
            return sum(weight * getattr(part, name) for weight, part in parts)

        return Partials(*(total(each.name) for each in fields(Partials)))


def can_be_infinite(objective: Objective) -> bool:
    """Return whether an objective, which need not derive from `Weighable`, may grow without limit."""
    return bool(getattr(objective, "can_be_infinite", True))


def _require_objective(given: object, user: str) -> None:
    """Reject a part of a compound objective that is none."""
    if not callable(getattr(given, "partials", None)):
        raise InvalidInputError(
            f"{user} needs objects with value and partials, got {type(given).__name__}: try LargestPressure()"
        )


def _terms(objective: Any) -> tuple[tuple[float, Objective], ...]:
    return objective.terms if isinstance(objective, WeightedSum) else ((1.0, objective),)


@dataclass(frozen=True)
class Maximum(Weighable):
    """J = max J_k, such as the largest stress of several bodies; scale objectives of different units.

    The subgradient is that of the largest, of the first one where several are equal. A bundle method joins
    those of both sides of such a kink.

    Attributes:
        objectives: J_k, at least one.

    Raises:
        InvalidInputError: If there is none, or one is no objective.

    Example:
        >>> from fenics_contact.design import LargestPressure
        >>> len(Maximum((LargestPressure(0), LargestPressure(1))).objectives)
        2
    """

    objectives: tuple[Objective, ...]

    def __post_init__(self) -> None:
        """Check the objectives; any sequence becomes a tuple."""
        given = self.objectives
        if not isinstance(given, list | tuple) or not given:
            raise InvalidInputError(
                f"Maximum needs a tuple of objectives, got {given!r}: write Maximum((first, second))"
            )
        for objective in given:
            _require_objective(objective, "Maximum")
        object.__setattr__(self, "objectives", tuple(given))

    @property
    def can_be_infinite(self) -> bool:
        """Whether one of the objectives can."""
        return any(map(can_be_infinite, self.objectives))

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the largest value. Collective."""
        return self._active(state, forms)[0]

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate the largest one. Collective."""
        return self._active(state, forms)[1].partials(state, forms)

    def _active(self, state: State, forms: ShapeForms) -> tuple[float, Objective]:
        """Return the largest value and its objective, the same on all ranks. Collective."""
        values = [objective.value(state, forms) for objective in self.objectives]
        value, place = state.torn.decomposition.comm.bcast((max(values), int(np.argmax(values))))
        return float(value), self.objectives[place]
