"""Objectives: energies, contact forces and pressures, work of friction, stresses and movements."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact._base.checks import GivenVector, checked, unit_vector
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.parts import surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact.design.adjoint import on_owned
from fenics_contact.design.forms import Density, ShapeForms
from fenics_contact.design.load_derivatives import strain_work_by_shape, work_by_shape
from fenics_contact.design.motion import BodyIntegral, require_body
from fenics_contact.design.objective import Partials, Weighable, require_linear
from fenics_contact.design.sensitivity import by_true_areas
from fenics_contact.design.surface_derivatives import areas_pulled_back
from fenics_contact.errors import InvalidDesignError, InvalidInputError, together
from fenics_contact.errors.kinds import user_code
from fenics_contact.feti.averages import nodal_mean_at, nodal_mean_transposed
from fenics_contact.results.contact import ContactResult
from fenics_contact.results.state import State

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
        with user_code("ContactForces.function"):
            value, normal, tangential = self.function(state.contact)
            return float(value), np.asarray(normal), np.asarray(tangential)

    def _differentiated(self, state: State) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the checked result of the user's function."""
        count, width = state.torn.points.count, state.torn.components - 1
        value, normal, tangential = self._asked(state)
        if normal.shape != (count,) or tangential.shape != (count, width):
            raise InvalidInputError(
                f"ContactForces.function must return derivatives of shapes ({count},) and ({count}, "
                f"{width}), got {normal.shape} and {tangential.shape}: one row for each contact point"
            )
        return _finite(value, normal, tangential)

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Map the user's derivatives to the contact rows; raises as the function's call does."""
        with together(state.torn.decomposition.comm):
            value, normal, tangential = self._differentiated(state)
        return Partials.of(state, value, by_multiplier=on_rows(state, normal, tangential))


def on_rows(state: State, normal: np.ndarray, tangential: np.ndarray) -> np.ndarray:
    """Return values at the contact points in the owned rows of B, zero in all others, shape (n_owned,)."""
    return on_normal_rows(state, normal) + on_tangential_rows(state, tangential)


def on_normal_rows(state: State, values: np.ndarray) -> np.ndarray:
    """Return values in the owned normal rows, zero in all others, shape (n_owned,)."""
    return on_owned(state.torn, state.torn.normal_rows, values)


def on_tangential_rows(state: State, values: np.ndarray) -> np.ndarray:
    """Return values in the points' tangents in the owned tangential rows, shape (n_owned,).

    Those of points without friction, which have no such rows, are left out.
    """
    torn = state.torn
    return on_owned(torn, torn.tangential_rows.ravel(), values[torn.frictional].ravel())


def _finite(value: float, *derivatives: np.ndarray) -> tuple[Any, ...]:
    """Return the result of a function of contact forces if it is finite, else raise."""
    if not (np.isfinite(value) and all(np.isfinite(numbers).all() for numbers in derivatives)):
        raise InvalidInputError(
            "ContactForces.function must return finite numbers, got others: check divisions by forces"
        )
    return value, *derivatives


@dataclass(frozen=True)
class TotalPotential(Weighable):
    """J = ½ uᵀK u − fᵀu, less the work of loads at the points of rigid surfaces, [force · length].

    Not with fluid in contacts.
    """

    energies = (1.0, 1.0)

    can_be_infinite = False

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the total potential energy; raises as `require_linear` does, and with fluid."""
        require_linear(state, self)
        if state.torn.fluid.wet is not None:
            raise InvalidInputError(
                "TotalPotential needs contacts without fluid, whose front has no potential: take StrainEnergy"
            )
        return state.energies.total_potential

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂u = K u − f, ∂J/∂q = −g, ∂J/∂X from UFL: half of a(u, u), all of L(u)."""
        torn, u = state.torn, state.torn_displacement
        by_shape = work_by_shape(forms, torn, 0.5 * u, u)
        # In equilibrium K u − f = −Bᵀλ.
        return Partials.of(
            state,
            self.value(state, forms),
            by_displacement=-torn.force(state.solution.multiplier),
            by_motion=-torn.free.load,
            by_shape=by_shape,
        )


@dataclass(frozen=True)
class StrainEnergy(Weighable):
    """J = ½ uᵀK u, [force · length]: the compliance of the bodies, without the way that a load gains.

    Without friction and prescribed displacements, with dead loads, the total potential is

        ½ uᵀK u − fᵀu = −½ uᵀK u − Σ λ_N g,

    g the gaps before deformation. A surface that gives way opens the gaps along the load, and lowers the
    potential by the load times the way that the body follows, however soft the bodies become. Minimising the
    strain energy makes them stiff under a given load; under prescribed displacements it makes them soft.

    Raises:
        InvalidInputError: If the scene has a `ThermalStrain`: a part of the strain is then without stress,
            and ½ uᵀK u is no stored energy.
    """

    energies = (1.0, 0.0)

    can_be_infinite = False

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the strain energy; raises as `require_linear` does."""
        require_linear(state, self)
        if any(load.temperatures for load in state.scene.loads):
            raise InvalidInputError(
                "StrainEnergy needs loads without ThermalStrain, got one: integrate yours by VolumeIntegral"
            )
        return state.energies.strain

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂u = K u, ∂J/∂X half of that of a(u, u)."""
        value, torn, u = self.value(state, forms), state.torn, state.torn_displacement
        # In equilibrium K u = f − Bᵀλ.
        by_displacement = torn.load - torn.force(state.solution.multiplier)
        by_shape = strain_work_by_shape(forms, torn, 0.5 * u, u)
        return Partials.of(state, value, by_displacement=by_displacement, by_shape=by_shape)


#: Value, derivative by forces and by areas of the points, shape (n,) each.
OfPoints = tuple[float, np.ndarray, np.ndarray]


@dataclass(frozen=True)
@checked()
class OfPressures(Weighable, ABC):
    """J = φ(λ_N, A), a function of normal forces and areas of the slave's nodes.

    A node's pressure is its force over its area, that of the deformed slave where it deforms much, as of
    `ContactResult.pressure`. Nodes on the rim of a surface have small areas: where facets are wide, their
    pressure is less certain than that of the others.

    Attributes:
        pair: Number of the contact pair in the scene; None for the points of all pairs.
    """

    pair: int | None = None

    @abstractmethod
    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return φ and its derivatives.

        Args:
            force: λ_N, shape (n,), [force], some positive.
            area: A, shape (n,), [length²].
        """

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return φ.

        Raises:
            InvalidInputError: If there is no such pair.
            InvalidDesignError: If nothing touches.
        """
        return self._evaluated(state)[0]

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Return the derivatives by forces and areas; raises as `value` does. Collective."""
        value, by_force, by_area = self._evaluated(state)
        by_areas = by_true_areas(state, by_area)
        return Partials.of(state, value, by_multiplier=on_normal_rows(state, by_force), **by_areas)

    def _evaluated(self, state: State) -> OfPoints:
        contact = state.contact
        mine = points_of(state, type(self).__name__, self.pair)
        force, area = contact.normal_force[mine], contact.area[mine]
        if not (force > 0.0).any():
            raise nothing_touches(self, self.pair)
        value, *derivatives = self.of_points(force, area)
        by_force, by_area = np.zeros((2, contact.points.count))
        by_force[mine], by_area[mine] = derivatives
        return value, by_force, by_area


def points_of(state: State, what: str, pair: int | None) -> np.ndarray:
    """Return the numbers of the contact points of a pair, of all pairs if it is None."""
    if pair is None:
        return np.arange(state.contact.points.count)
    require_pair(state.scene, what, pair)
    return state.contact.on_pair(pair)


def nothing_touches(objective: Weighable, pair: int | None) -> InvalidDesignError:
    """Return the failure of an objective that needs contact forces."""
    where = "no contact pair" if pair is None else f"not contact pair {pair}"
    return InvalidDesignError(
        f"{type(objective).__name__} needs surfaces that touch, but {where} of this design transmits a "
        "force: press the bodies together, or keep the design closer to one that touches"
    )


def require_pair(scene: Scene, what: str, pair: int) -> None:
    """Check the number of a pair."""
    count = len(scene.contacts)
    if not 0 <= pair < count:
        known = f"0 to {count - 1}" if count else "but it has none"
        raise InvalidInputError(
            f"{what}.pair must be the number of a contact pair of the scene, {known}, got {pair!r}: "
            "leave it out for all pairs"
        )


@dataclass(frozen=True)
@checked()
class LargestPressure(OfPressures):
    """J = max p_i, the largest pressure of a node, [force / length²].

    The subgradient is that of the node with the largest pressure; where several are equal, to rounding, that
    of the first. While one node after the other is lowered J has kinks, which the bundle method knows how to
    deal with; `PressureNorm` has none.

    Example:
        >>> LargestPressure(pair=0)
        LargestPressure(pair=0)
    """

    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the largest pressure; only its node has derivatives."""
        pressure = force / area
        first = int(np.argmax(pressure >= (1.0 - ROUNDING) * pressure.max()))
        by_force, by_area = np.zeros((2, len(force)))
        by_force[first] = 1.0 / area[first]
        by_area[first] = -pressure[first] / area[first]
        return float(pressure[first]), by_force, by_area


@dataclass(frozen=True)
@checked()
class PressureNorm(OfPressures):
    """J = (Σ A_i p_i^p / Σ A_i)^(1/p), a smooth bound of the largest pressure from below, [force / length²].

    The sums are over all slave nodes, open ones included, so that nothing jumps where points open or close.
    With the node of the largest pressure p_max and its area A_k

        J ≤ p_max ≤ J (Σ A_i / A_k)^(1/p).

    The larger p, the closer, and the more J behaves like the maximum with its kinks.

    Attributes:
        p: Exponent from 2 to 100; the mean, p = 1, is given by the load, not by the shape.

    Raises:
        InvalidInputError: If p is out of its range.

    Example:
        >>> PressureNorm(p=12.0).p
        12.0
    """

    p: float = 8.0

    def __post_init__(self) -> None:
        """Check the exponent."""
        require_exponent("PressureNorm", self.p)

    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the norm; pressures are divided by the largest one first, as powers overflow."""
        pressure, total, p = force / area, area.sum(), self.p
        scale = pressure.max()
        value = scale * float(area @ (pressure / scale) ** p / total) ** (1.0 / p)
        ratio = pressure / value
        return value, ratio ** (p - 1.0) / total, value / (p * total) * ((1.0 - p) * ratio**p - 1.0)


def require_exponent(what: str, p: float) -> None:
    """Check the exponent of a smooth bound of a largest value, of which powers must not overflow."""
    if not 2.0 <= p <= 100.0:
        raise InvalidInputError(
            f"{what}.p must be from 2 to 100, got {p!r}: the larger, the closer to the largest value, try 8"
        )


@dataclass(frozen=True)
@checked()
class PressureNonuniformity(OfPressures):
    """J = Σ A_i (p_i − m)² / (m² Σ A_i), m = Σ A_i p_i / Σ A_i: zero where the pressure is even, no unit.

    It is the square of the relative standard deviation over the whole slave surface. Open points count with
    p = 0: a mean over closed points only would jump where one opens. So J also rewards a large area in
    contact, J = Σ A_i / A_c − 1 with the area A_c of `ContactArea`.
    """

    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the unevenness."""
        spread, by_force, by_area = _effective_area(force, area)
        total = area.sum()
        by_spread = -total / spread**2
        return float(total / spread - 1.0), by_spread * by_force, 1.0 / spread + by_spread * by_area


@dataclass(frozen=True)
@checked()
class ContactArea(OfPressures):
    """J = (Σ A_i p_i)² / Σ A_i p_i², the area in contact, smooth, [length²].

    The area on which an even pressure has the same resultant and the same mean square. Where the pressure is
    even it is the area in contact; it is 8/9 of that of Hertz' elliptic spot and 0.925 of that of his strip.
    `contact_area` locates the rim between nodes; its derivative is infinite where nodes open. Here
    the pressures of all nodes are differentiated and their areas, not the place of the rim.

    To enlarge it, minimise ``-ContactArea()`` or `PressureNonuniformity`.
    """

    can_be_infinite = False

    def of_points(self, force: np.ndarray, area: np.ndarray) -> OfPoints:
        """Return the area."""
        return _effective_area(force, area)


def _effective_area(force: np.ndarray, area: np.ndarray) -> OfPoints:
    """Return (Σ λ)² / Σ λ² / A and its derivatives."""
    total, pressure = force.sum(), force / area
    squares = force @ pressure
    value = total**2 / squares
    return float(value), 2.0 * value * (1.0 / total - pressure / squares), value * pressure**2 / squares


@dataclass(frozen=True)
@checked()
class FrictionWork(Weighable):
    """J = Σ τ_i · s_i, the work dissipated by friction in one load step, [force · length].

    Friction acts along the slip since the step before, so that each point's work is the product of its force
    and the length of its slip, and zero where it sticks. By Archard's law the volume worn off is proportional
    to it. The force is that at the end of the step. `ShapeProblem` applies the whole load in one step from
    rest; `LoadPath` adds up the work of several steps.

    Attributes:
        pair: Number of the contact pair in the scene; None for all.
    """

    is_of_slip = True

    can_be_infinite = False

    pair: int | None = None

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the work.

        Raises:
            InvalidInputError: If there is no such pair or it has no friction.
        """
        force, slip = self._vectors(state)
        return float((force * slip).sum())

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂τ = s, ∂J/∂s = τ with the slips s = B_T u − Q_T q − c_T. Collective; raises as `value` does."""
        force, slip = self._vectors(state)
        value, by_force, torn = float((force * slip).sum()), slip, state.torn
        by_area: np.ndarray | float = 0.0
        if torn.groups.slips.is_elastic:
            elastic = np.zeros(torn.points.count)
            elastic[torn.frictional] = torn.groups.slips.elastic_slip
            by_force = slip - elastic[:, None] * force
            by_area = elastic / torn.points.area * np.einsum("na,na->n", force, force)
        by_slip, free = on_tangential_rows(state, force), state.torn.free
        by_motion = -np.asarray(state.torn.decomposition.comm.allreduce(free.columns.T @ by_slip))
        return Partials.of(
            state,
            value,
            by_displacement=state.torn.force(by_slip),
            by_multiplier=on_tangential_rows(state, by_force),
            by_motion=by_motion,
            by_area=by_area,
            by_jump=by_slip,
        )

    def _vectors(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return friction forces and slips of the points with friction, zero elsewhere."""
        require_linear(state, self)
        contact = state.contact
        mine = np.intersect1d(points_of(state, "FrictionWork", self.pair), state.torn.frictional)
        if len(mine) == 0:
            where = "contact pairs have" if self.pair is None else f"contact pair {self.pair} has"
            raise InvalidInputError(
                f"FrictionWork needs friction, but the scene's {where} none: give Coulomb or Tresca friction"
            )
        chosen = np.zeros((contact.points.count, 1))
        chosen[mine] = 1.0
        return chosen * contact.friction_force, chosen * contact.slip


@dataclass(frozen=True)
@checked()
class LargestStress(Weighable):
    """J = (∫ σ^p dx / V)^(1/p), σ the von Mises stress, a smooth bound of its largest, [force / length²].

    J lies below the largest stress in the points of quadrature. Where that stress σ_max prevails in a volume
    V_c, such as that of a cell,

        J ≤ σ_max ≤ J (V / V_c)^(1/p):

    a peak in a thousandth of the body is at most 2.4 J with p = 8, 1.4 J with p = 20. The larger p, the
    closer, and the more J behaves like the maximum with its kinks. `largest` shows how far off it is. Thermal
    stress counts.

    Attributes:
        body: Name of the body.
        p: Exponent from 2 to 100: below, J has kinks where nothing is stressed.

    Raises:
        InvalidInputError: If p is out of its range.

    Example:
        >>> LargestStress("link 1", p=12.0).body
        'link 1'
    """

    body: str
    p: float = 8.0

    def __post_init__(self) -> None:
        """Check the exponent."""
        require_exponent("LargestStress", self.p)

    def largest(self, state: State) -> float:
        """Return the largest mean of the von Mises stress over a cell, not smoothed. Collective.

        Raises:
            InvalidInputError: If there is no such body.
        """
        require_body(state, "LargestStress", self.body)
        return float(state.gather_von_mises(self.body).max())

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the smoothed stress. Collective; raises as `largest` does."""
        return self._evaluated(state, forms)[0]

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate by UFL. Collective; raises as `largest` does."""
        value, stressed, volume, numbers = self._evaluated(state, forms)
        if value == 0.0:
            return Partials.of(state, 0.0)
        # δJ = J/p (δI/I − δV/V): a single integral with these factors.
        by_powers, by_volume = value / (self.p * stressed), value / (self.p * volume)
        integral = BodyIntegral(state, forms, _DENSITY, self.body)
        return Partials.of(state, value, **integral.derivatives(*numbers, by_powers, -by_volume))

    def _evaluated(self, state: State, forms: ShapeForms) -> tuple[float, float, float, tuple[float, float]]:
        """Return J, I = ∫ (σ/σ_r)^p dx, the volume, and the constants 1/σ_r² and p/2. Collective.

        Any σ_r gives the same J. That of a smaller p is near enough to the largest stress, whatever the unit,
        for powers not to overflow: first the root mean square, then that of 16.
        """
        require_linear(state, self)
        require_body(state, "LargestStress", self.body)
        integral = BodyIntegral(state, forms, _DENSITY, self.body)
        volume, value = integral(0.0, 1.0, 0.0, 1.0), 1.0
        for p in (2.0, min(self.p, 16.0), self.p):
            numbers = (value**-2.0, 0.5 * p)
            stressed = integral(*numbers, 1.0, 0.0)
            value *= (stressed / volume) ** (1.0 / p)
            if value == 0.0:
                break
        return value, stressed, volume, numbers


def _powers(u: Expr, x: Expr, stress: Expr, *numbers: Expr) -> Expr:
    """Return a (σ²/σ_r²)^(p/2) + b."""
    scale, half, by_powers, by_volume = numbers
    deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
    return by_powers * (1.5 * scale * ufl.inner(deviator, deviator)) ** half + by_volume


_DENSITY = Density("powers of the von Mises stress", _powers, constants=4, in_space=True)


@dataclass(frozen=True)
@checked()
class Movement(Weighable):
    """J = d · ∫ u dA / A, the mean displacement of a surface along a direction, or that of a node, [length].

    On each facet the mean is that of its corners. A small movement of a loaded surface is a stiff part; as a
    constraint it keeps a part from giving way.

    Attributes:
        body: Name of the body.
        at: Name of a surface of the body, or number of one of its nodes.
        direction: d, of any length: it is divided by it.

    Example:
        >>> Movement("link 2", "grip", (1, 0, 0)).at
        'grip'
    """

    can_be_infinite = False

    body: str
    at: str | int
    direction: GivenVector

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the movement. Collective.

        Raises:
            InvalidInputError: If the scene has no such body, surface or node.
        """
        return self.partials(state, forms).value

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate by displacements, and by the areas that weigh them. Collective; raises as `value`."""
        nodes, weights, surface = self._weighed(state)
        direction = unit_vector("Movement.direction", self.direction, state.scene.dim)
        decomposition = state.torn.decomposition
        along = nodal_mean_at(decomposition, state.torn_displacement, nodes) @ direction
        value = float(weights @ along)
        by_displacement = nodal_mean_transposed(decomposition, nodes, np.outer(weights, direction))
        partials = Partials.of(state, value, by_displacement=by_displacement)
        if surface is not None and decomposition.comm.rank == 0:
            partials.by_shape[nodes] = areas_pulled_back(surface, (along - value) / surface.areas.sum())
        return partials

    def _weighed(self, state: State) -> tuple[np.ndarray, np.ndarray, FacetedSurface | None]:
        """Return the nodes among those of all bodies, their weights, which sum to one, and the surface."""
        require_body(state, "Movement", self.body)
        mesh, tearing = state.scene.bodies[self.body].mesh, state.torn.decomposition.tearing
        if isinstance(self.at, str) and self.at in mesh.surfaces:
            surface = surface_of(state.scene, Surface(self.body, self.at), "faceted")
            nodes = tearing.global_nodes(self.body, surface.nodes)
            return nodes, surface.areas / surface.areas.sum(), surface
        if not isinstance(self.at, str) and 0 <= self.at < mesh.n_nodes:
            return tearing.global_nodes(self.body, np.array([self.at])), np.ones(1), None
        raise InvalidInputError(
            f"Movement.at must be a surface of body {self.body!r}, one of {sorted(mesh.surfaces)}, or the "
            f"number of a node, 0 to {mesh.n_nodes - 1}, got {self.at!r}"
        )
