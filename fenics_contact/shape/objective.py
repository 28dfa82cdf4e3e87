"""Objectives of designs, with the partial derivatives that the adjoint needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Protocol, cast

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI
from fenics_contact.contact import ContactResult, State
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, calling, collective, together
from fenics_contact.fem import material_sets, temperature_of
from fenics_contact.feti import Subdomain
from fenics_contact.scene import Body
from fenics_contact.shape.forms import (
    Integrand,
    ShapeForms,
    check_differentiable,
    subdomain_fields,
    sum_over_subdomains,
    work_by_shape,
)

Functions = Sequence["_dolfinx.fem.Function"]
Spaces = Sequence["_dolfinx.fem.FunctionSpace"]
#: Binds a functional to a subdomain, with Functions for its fields and spaces for its arguments.
Bind = Callable[[Subdomain, Functions, Spaces], "_dolfinx.fem.Form"]


@displayed
@dataclass(frozen=True, eq=False)
class Partials:
    """An objective J(u, λ, X) at a state, with its partial derivatives.

    Attributes:
        value: J, the same on every rank.
        by_displacement: ∂J/∂u on this rank's torn dofs, shape (torn_size,).
        by_multiplier: ∂J/∂λ, owned, shape (n_owned,).
        by_shape: ∂J/∂X at fixed u and λ, this rank's share, shape (n_nodes, dim) for the nodes of all bodies;
            undefined at nodes that no design moves.
        by_motion: ∂J/∂q for the free motions of rigid surfaces, `FreeMotions`, replicated, shape (n_free,);
            None where J depends on them through u alone.
    """

    value: float
    by_displacement: np.ndarray
    by_multiplier: np.ndarray
    by_shape: np.ndarray
    by_motion: np.ndarray | None = None


class Weighable:
    """An objective that can be added to others and scaled: ``TotalPotential() + 2.0 * penalty``."""

    #: NumPy's numbers leave products to this class.
    __array_ufunc__ = None

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


class Objective(Protocol):
    """A function of the state; `TotalPotential`, `VolumeIntegral`, `ContactForces` come with the package.

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
    """Return what an objective gave.

    Raises:
        InvalidInputError: If an entry is no finite number.
    """
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        raise InvalidInputError(
            f"an objective must have a finite {name}, got {np.ravel(numbers)[bad[0]]} in entry {bad[0]}: "
            "check divisions, roots and logarithms of what may be zero, or raise InvalidDesignError for a "
            "design that has no value"
        )
    return numbers


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
    return partials


@dataclass(frozen=True)
class WeightedSum(Weighable):
    """J = Σ w_k J_k, what sums and multiples of objectives are.

    Attributes:
        terms: Weights w_k and objectives J_k, at least one.

    Raises:
        InvalidInputError: If there is no term, a weight is no finite number, or a term no objective.

    Example:
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
                    f"an objective can be multiplied by a finite number, got {weight!r}: give its weight, "
                    "such as 2.0 * objective"
                )
            if not callable(getattr(objective, "partials", None)):
                raise InvalidInputError(
                    f"an objective can be added to another one, got {type(objective).__name__}: add an "
                    "object with value and partials, such as TotalPotential()"
                )

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
            terms = [weight * values for weight, part in parts if (values := getattr(part, name)) is not None]
            return np.sum(terms, axis=0) if terms else None

        return Partials(*(total(each.name) for each in fields(Partials)))


def _terms(objective: Any) -> tuple[tuple[float, Objective], ...]:
    return objective.terms if isinstance(objective, WeightedSum) else ((1.0, objective),)


@dataclass(frozen=True)
class TotalPotential(Weighable):
    """J = ½ uᵀK u − fᵀu, less the work of loads at the points of rigid surfaces, [force · length]."""

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the total potential energy."""
        return state.energies.total_potential

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂u = K u − f, ∂J/∂q = −g, ∂J/∂X from UFL: half of a(u, u), all of L(u)."""
        system, u = state.dual, state.torn_displacement
        by_shape = work_by_shape(forms, system.torn, 0.5 * u, u)
        nothing = np.zeros(len(system.torn.numbering.owned))
        # In equilibrium K u − f = −Bᵀλ.
        by_displacement = -system.force(state.solution.multiplier)
        return Partials(self.value(state, forms), by_displacement, nothing, by_shape, -system.torn.free.load)


@dataclass(frozen=True)
class VolumeIntegral(Weighable):
    """J = ∫ integrand(u, x, σ) dx over one body.

    Attributes:
        name: Its name among compiled forms.
        integrand: Takes displacement, coordinates and stress (UFL; without thermal stress), returns a UFL
            scalar.
        body: Name of the body.

    Example:
        >>> import ufl
        >>> VolumeIntegral("motion", lambda u, x, stress: ufl.inner(u, u), "link2").body
        'link2'
    """

    name: str
    integrand: Integrand
    body: str

    def value(self, state: State, forms: ShapeForms) -> float:
        """Integrate. Collective."""
        bind = self._prepare(state, forms, "value")
        total = 0.0
        for subdomain, functions in subdomain_fields(state.torn, [state.torn_displacement]):
            if subdomain.mesh.body == self.body:
                total += _dolfinx.assemble_scalar(bind(subdomain, functions, []))
        return float(state.dual.problem.comm.allreduce(total))

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate the integral by UFL."""
        torn, u = state.torn, state.torn_displacement
        check_differentiable(temperature_of(torn.scene.loads, self.body).loads)
        by_shape, by_displacement = (self._prepare(state, forms, by) for by in ("shape", "displacement"))

        def assemble(bind: Bind, subdomain: Subdomain, functions: Functions) -> np.ndarray:
            if subdomain.mesh.body != self.body:
                return np.zeros(subdomain.mesh.size)
            return _dolfinx.assemble_vector(bind(subdomain, functions, [subdomain.mesh.space]))

        gradient = [assemble(by_displacement, *each) for each in subdomain_fields(torn, [u])]
        nothing = np.zeros(len(torn.numbering.owned))
        return Partials(
            self.value(state, forms),
            np.concatenate(gradient),
            nothing,
            sum_over_subdomains(torn, [u], partial(assemble, by_shape), forms.moving),
        )

    def _prepare(self, state: State, forms: ShapeForms, by: str) -> Bind:
        """Compile the integral or a derivative, return a function that binds it to subdomains. Collective."""
        body = self._body(state)
        cell_type, temperature = body.mesh.cell_type, temperature_of(state.scene.loads, self.body)
        for materials in material_sets(body):
            forms.functional(self.name, self.integrand, materials, cell_type, by, temperature)

        def bind(subdomain: Subdomain, functions: Functions, spaces: Spaces) -> _dolfinx.fem.Form:
            parts, mesh = subdomain.material, subdomain.mesh.space.mesh
            template = forms.functional(
                self.name, self.integrand, parts.materials, cell_type, by, temperature
            )
            points = body.mesh.points[np.sort(subdomain.mesh.nodes)]
            fields = [*functions, *temperature.fields(mesh, points)]
            numbers = (*temperature.numbers, *parts.parameters)
            return template.bind(spaces, numbers, fields, mesh=mesh, cells=parts.cells)

        return bind

    def _body(self, state: State) -> Body:
        bodies = state.scene.bodies
        if self.body not in bodies:
            raise InvalidInputError(
                f"VolumeIntegral.body must name a body of the scene, got {self.body!r}, there are "
                f"{sorted(bodies)}"
            )
        return bodies[self.body]


#: Returns value, derivative by normal forces (n,), derivative by friction forces (n, dim − 1).
ForceFunction = Callable[[ContactResult], tuple[float, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class ContactForces(Weighable):
    """J = φ(λ_N, τ), a function of the contact forces alone, [any].

    Attributes:
        function: Takes the contact result; returns φ, ∂φ/∂λ_N of shape (n,) and ∂φ/∂τ of shape (n, dim − 1),
            the latter in the points' tangents. Must be invariant under rotation of the tangents to be smooth.

    Example:
        >>> def largest(contact):
        ...     k = int(contact.normal_force.argmax())
        ...     by_normal = np.zeros(len(contact.normal_force))
        ...     by_normal[k] = 1.0
        ...     return contact.normal_force[k], by_normal, np.zeros_like(contact.friction_force)
        >>> objective = ContactForces(largest)
    """

    function: ForceFunction

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return φ. Collective."""
        with together(state.torn.decomposition.comm):
            return _finite(self._asked(state)[0])[0]

    def _asked(self, state: State) -> tuple[float, np.ndarray, np.ndarray]:
        with calling("ContactForces.function"):
            value, normal, tangential = self.function(state.contact)
            return float(value), np.asarray(normal), np.asarray(tangential)

    def _differentiated(self, state: State) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the checked result of the user's function.

        Raises:
            InvalidInputError: If that is not finite numbers of the right shapes.
        """
        count, width = state.torn.points.count, state.torn.dim - 1
        value, normal, tangential = self._asked(state)
        if normal.shape != (count,) or tangential.shape != (count, width):
            raise InvalidInputError(
                f"ContactForces.function must return derivatives of shapes ({count},) and ({count}, "
                f"{width}), got {normal.shape} and {tangential.shape}: one row for each contact point"
            )
        return _finite(value, normal, tangential)

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Map the user's derivatives to the contact rows; raises as the function's call does."""
        system, torn = state.dual, state.torn
        with together(torn.decomposition.comm):
            value, normal, tangential = self._differentiated(state)
        by_multiplier = np.zeros(len(torn.numbering.owned))
        for rows, values in (
            (torn.normal_rows, normal),
            (torn.tangential_rows.ravel(), tangential[torn.frictional].ravel()),
        ):
            position = system.positions(rows)
            by_multiplier[position[position >= 0]] = values[position >= 0]
        by_shape = np.zeros((int(torn.decomposition.tearing.node_offset[-1]), torn.scene.dim))
        return Partials(float(value), np.zeros(len(state.torn_displacement)), by_multiplier, by_shape)


def _finite(value: float, *derivatives: np.ndarray) -> tuple[Any, ...]:
    """Return the result of a function of contact forces if it is finite, else raise."""
    if not (np.isfinite(value) and all(np.isfinite(numbers).all() for numbers in derivatives)):
        raise InvalidInputError(
            "ContactForces.function must return finite numbers, got NaN or infinity: check divisions by "
            "forces that may be zero"
        )
    return value, *derivatives
