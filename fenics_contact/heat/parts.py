"""What holds temperatures, and what heats and cools bodies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import inf, nan
from typing import Any, Self, TypeAlias

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_known, check_not_negative, check_positive
from fenics_contact._scene.fields import OfPosition, evaluate, is_number
from fenics_contact.errors import InvalidInputError
from fenics_contact.heat.exchange import Exchange, Place, given
from fenics_contact.heat.properties import TemperatureTable, property_of, slope_of
from fenics_contact.mesh.body_mesh import BodyMesh

#: A number, or a function of points, shape (n, dim) to (n,).
Value: TypeAlias = float | OfPosition


def _checked(name: str, given: Value) -> Value:
    if callable(given):
        return given
    if not is_number(given):
        raise InvalidInputError(
            f"{name} must be a finite number or a function of points, got {given!r}: give one number, or a "
            "function of points, shape (n, dim), that returns one for each"
        )
    return float(given)


class HeatPart(ABC):
    """What acts on one body.

    Attributes:
        body: Name of the body.
    """

    body: str
    #: Whether its heat is no more than proportional to the temperature.
    is_linear = True
    #: Whether it gives its body a temperature: holds one, or exchanges heat with surroundings that have one.
    gives_temperature = False
    #: A temperature that it was given, not a number where it has none.
    level: Value = nan
    # Temperatures must lie above it.
    absolute_zero: float = -inf
    #: Whether mechanics gives its heat.
    by_mechanics = False

    def worked(self, power: Callable[[str], np.ndarray]) -> Self:
        """Return it with the power of plastic work, at the nodes of a body by its name."""
        return self

    def check(self, meshes: Mapping[str, BodyMesh]) -> None:
        """Reject a body or a place that is not there."""
        kind = type(self).__name__
        check_known(self.body, meshes, f"{kind} names body {self.body!r}, the scene has")
        self._check_place(kind, meshes[self.body])

    @abstractmethod
    def _check_place(self, kind: str, mesh: BodyMesh) -> None:
        """Reject a place that the mesh of its body does not have."""

    @property
    @abstractmethod
    def place(self) -> str:
        """Where it is, in words."""

    def _at(self, given: Value, points: np.ndarray) -> np.ndarray:
        if callable(given):
            return evaluate(f"{type(self).__name__} on {self.place}", given, points, ())
        return np.full(len(points), given)


class OnSurface(HeatPart):
    """What acts on a surface.

    Attributes:
        surface: Name of the surface of its body.
    """

    surface: str

    def _check_place(self, kind: str, mesh: BodyMesh) -> None:
        words = f"{kind} names surface {self.surface!r} of body {self.body!r}, which has"
        check_known(self.surface, mesh.surfaces, words)

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return f"{self.body} {self.surface}"


@dataclass(frozen=True)
@checked("value")
class HeldTemperature(HeatPart):
    """A temperature that a surface, or single nodes, are held at.

    Attributes:
        body: Name of the body.
        surface: Name of its surface, or of a node set of its mesh.
        value: The temperature in degrees, or a function of points, shape (n, dim), that returns one for each.

    Example:
        >>> cooled = HeldTemperature("plate", "z0", 20.0)
    """

    body: str
    surface: str
    value: Value

    gives_temperature = True

    def __post_init__(self) -> None:
        """Reject what is no temperature."""
        object.__setattr__(self, "value", _checked("HeldTemperature.value", self.value))

    def _check_place(self, kind: str, mesh: BodyMesh) -> None:
        known = {*mesh.surfaces, *mesh.node_sets}
        check_known(self.surface, known, f"{kind} names {self.surface!r} of body {self.body!r}, which has")

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return f"{self.body} {self.surface}"

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the temperatures at points, shape (n,)."""
        return self._at(self.value, points)


@dataclass(frozen=True)
@checked("value")
class HeatFlux(OnSurface):
    """Heat that enters through a surface.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Heat per area and time, positive where it enters, [power / length²]; a function of points, or
            a number.
        total: Whether the value is the heat of the whole surface, [power], spread evenly over it.

    Example:
        >>> burner = HeatFlux("pan", "bottom", 0.05)  # W/mm²
        >>> chip = HeatFlux("die", "top", 150.0, total=True)  # W
    """

    body: str
    surface: str
    value: Value
    total: bool = False

    def __post_init__(self) -> None:
        """Reject what is no flux."""
        object.__setattr__(self, "value", _checked("HeatFlux.value", self.value))
        if self.total and callable(self.value):
            raise InvalidInputError("a total heat must be a number, got a function: leave total out")

    def exchange(self, on: Place, temperature: np.ndarray) -> Exchange:
        """Return what it gives to a subdomain."""
        values = self._at(self.value, on.points)
        if self.total:
            values = values / on.area(self.surface)
        return given(on.surface(np.ones(len(values)), self.surface) @ values)


@dataclass(frozen=True)
@checked("value")
class HeatSource(HeatPart):
    """Heat that arises in a volume: of currents, reactions, radiation that is absorbed.

    Attributes:
        body: Name of the body.
        value: Heat per volume and time, [power / length³]; a function of points, or a number.
        region: Name of the region of its mesh that is heated; all of the body by default.

    Example:
        >>> wire = HeatSource("coil", 2e-3)  # W/mm³
    """

    body: str
    value: Value
    region: str = ""

    def __post_init__(self) -> None:
        """Reject what is no source."""
        object.__setattr__(self, "value", _checked("HeatSource.value", self.value))

    def _check_place(self, kind: str, mesh: BodyMesh) -> None:
        if self.region:
            words = f"{kind} names region {self.region!r} of body {self.body!r}, which has"
            check_known(self.region, mesh.regions, words)

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return f"{self.body} {self.region}".rstrip()

    def exchange(self, on: Place, temperature: np.ndarray) -> Exchange:
        """Return what it gives to a subdomain."""
        values = self._at(self.value, on.points)
        return given(on.volume(np.ones(len(values)), self.region) @ values)


@dataclass(frozen=True)
@checked("value")
class HeatAtNodes(HeatPart):
    """Heat that enters at single nodes, as point sources and the nodal fluxes of other programs.

    Attributes:
        body: Name of the body.
        nodes: Name of a node set of its mesh, or of a surface.
        value: Heat at each node, [power].
    """

    body: str
    nodes: str
    value: float

    def __post_init__(self) -> None:
        """Reject what is no heat."""
        object.__setattr__(self, "value", _checked("HeatAtNodes.value", self.value))

    def _check_place(self, kind: str, mesh: BodyMesh) -> None:
        known = {*mesh.surfaces, *mesh.node_sets}
        check_known(self.nodes, known, f"{kind} names {self.nodes!r} of body {self.body!r}, which has")

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return f"{self.body} {self.nodes}"

    def exchange(self, on: Place, temperature: np.ndarray) -> Exchange:
        """Return what it gives to a subdomain."""
        return given(self.value * on.share(self.nodes))


@dataclass(frozen=True, eq=False)
class PlasticHeat(HeatPart):
    """Heat of plastic work, of the mean power in each step of time, see `solve_heated` and `heated_in_time`.

    Steady states have none.

    Attributes:
        body: Name of the body.
        share: Part of the work that becomes heat, in [0, 1]; metals give 0.8 to 1 (G. I. Taylor, H. Quinney,
            Proc. R. Soc. A 143 (1934) 307-326).
        power: Plastic work in time at the nodes of the body, (n_nodes,), which mechanics gives, [power].
    """

    body: str
    share: float = 0.9
    power: float | np.ndarray = field(default=nan, repr=False)

    by_mechanics = True

    def __post_init__(self) -> None:
        """Reject a share of more than all."""
        if not 0.0 <= self.share <= 1.0:
            raise InvalidInputError(
                f"PlasticHeat.share must lie between 0 and 1, got {self.share!r}: it is a part of the work"
            )

    def worked(self, power: Callable[[str], np.ndarray]) -> Self:
        """Return it with the power at the nodes of its body."""
        return replace(self, power=power(self.body))

    def _check_place(self, kind: str, mesh: BodyMesh) -> None:
        """It is in all of the body."""

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return self.body

    def exchange(self, on: Place, temperature: np.ndarray) -> Exchange:
        """Return what it gives to a subdomain."""
        if not np.isfinite(self.power).all():
            words = f"PlasticHeat of body {self.body!r} needs the work of mechanics, got heat alone"
            raise InvalidInputError(f"{words}: take heated_in_time, or leave it out")
        return given(self.share * on.own(self.power))


class Film(OnSurface):
    """What a surface exchanges with surroundings of a known temperature."""

    ambient: Value
    gives_temperature = True

    @property
    def level(self) -> Value:  # type: ignore[override]
        """The temperature of the surroundings."""
        return self.ambient

    def exchange(self, on: Place, temperature: np.ndarray) -> Exchange:
        """Return what it gives to a subdomain, linearised at temperatures of its nodes, (n,)."""
        ambient = self._at(self.ambient, on.points)
        h, slope = self.coefficients(on.points, temperature, ambient)
        secant = on.surface(h, self.surface)
        if self.is_linear:
            return Exchange(secant, secant @ ambient)
        tangent = on.surface(slope, self.surface)
        return Exchange(tangent, secant @ ambient + (tangent - secant) @ temperature)

    def beyond(self, on: Place, temperature: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the derivative of wᵀ M(h) (T − T_a) by T at nodes, less that of `exchange`; `along`: w."""
        points, ambient = on.points, self._at(self.ambient, on.points)
        h, tangent = self.coefficients(points, temperature, ambient)
        by = slope_of(lambda T: self.coefficients(points, T, ambient)[0], temperature)
        film = on.surface(h, self.surface) - on.surface(tangent, self.surface)
        return np.asarray(film @ along + by * (on.surface(temperature - ambient, self.surface) @ along))

    @abstractmethod
    def coefficients(
        self, points: np.ndarray, temperature: np.ndarray, ambient: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return h of the flux h (T − T_a) and its slope by T, at points, shape (n,) each."""


@dataclass(frozen=True)
@checked("coefficient", "ambient")
class Convection(Film):
    """A surface that gives heat to a fluid: q = h (T − T_a).

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        coefficient: h ≥ 0, [power / (length² · degree)]: a number or a function of points, or a
            `TemperatureTable` by the temperature of the surface.
        ambient: Temperature T_a of the fluid in degrees, a number or a function of points.

    Example:
        >>> still_air = Convection("fin", "sides", 8e-6, ambient=20.0)  # W/(mm² K)
    """

    body: str
    surface: str
    coefficient: Value | TemperatureTable
    ambient: Value

    def __post_init__(self) -> None:
        """Reject films that heat what is warmer."""
        given: Any = self.coefficient
        if isinstance(given, int | float):
            remedy = "still air has about 8 W/(m² K), which is 8e-6 W/(mm² K); omit it for none"
            check_not_negative("Convection.coefficient", given, remedy)
            object.__setattr__(self, "coefficient", float(given))
        elif not callable(given):
            property_of("Convection.coefficient", given, "give a number, a function or a table")
        object.__setattr__(self, "ambient", _checked("Convection.ambient", self.ambient))

    @property
    def gives_temperature(self) -> bool:  # type: ignore[override]
        """Whether there is a film."""
        return self.coefficient != 0.0

    @property
    def is_linear(self) -> bool:  # type: ignore[override]
        """Whether it does not depend on the temperature of the surface."""
        return not isinstance(self.coefficient, TemperatureTable)

    def coefficients(
        self, points: np.ndarray, temperature: np.ndarray, ambient: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return h, and h + h' (T − T_a), or half of h where that is less."""
        given: Any = self.coefficient
        if self.is_linear:
            h = self._at(given, points)
            if (h < 0.0).any():
                raise InvalidInputError(
                    f"Convection.coefficient on {self.place} must not be negative, got {h.min():g}: correct "
                    "the function"
                )
            return h, h
        h = given.at(temperature)
        return h, np.maximum(h + given.slope(temperature) * (temperature - ambient), 0.5 * h)


@dataclass(frozen=True)
@checked("emissivity", "ambient")
class Radiation(Film):
    """A surface that radiates to large surroundings: q = ε σ (T⁴ − T_a⁴), temperatures above absolute zero.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        emissivity: ε in (0, 1].
        ambient: Temperature of the surroundings, a number or a function of points.
        absolute_zero: Absolute zero on the scale of all temperatures: 0 in kelvin, −273.15 in °C.
        constant: σ in the units of the scene: 5.670374419e-8 W/(m² K⁴), with lengths in mm 5.67e-14
            W/(mm² K⁴), in N and mm (power in N mm/s) 5.67e-11.

    Example:
        >>> furnace = Radiation("slab", "top", 0.8, ambient=1200.0, absolute_zero=-273.15)
    """

    body: str
    surface: str
    emissivity: float
    ambient: Value
    absolute_zero: float = 0.0
    constant: float = 5.670374419e-8

    is_linear = False

    def __post_init__(self) -> None:
        """Reject surfaces that no body has, and surroundings below absolute zero."""
        if not 0.0 < self.emissivity <= 1.0:
            raise InvalidInputError(
                f"Radiation.emissivity must lie above 0 and up to 1, got {self.emissivity!r}: polished metal "
                "has about 0.05, paint 0.9; omit radiation for none"
            )
        remedy = "give 5.670374419e-8 in W, m and K"
        check_positive("Radiation.constant", self.constant, remedy)
        object.__setattr__(self, "ambient", _checked("Radiation.ambient", self.ambient))
        if not callable(self.ambient):
            self._above_zero("the surroundings", np.array([self.ambient]))

    def coefficients(
        self, points: np.ndarray, temperature: np.ndarray, ambient: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return ε σ (T² + T_a²) (T + T_a), and the slope 4 ε σ T³."""
        T = self._above_zero("the body", temperature)
        around = self._above_zero("the surroundings", ambient)
        factor = self.emissivity * self.constant
        return factor * (T**2 + around**2) * (T + around), 4.0 * factor * T**3

    def _above_zero(self, what: str, temperature: np.ndarray) -> np.ndarray:
        """Return absolute temperatures."""
        absolute = temperature - self.absolute_zero
        if (absolute <= 0.0).any():
            raise InvalidInputError(
                f"Radiation on {self.place} needs temperatures above absolute zero, "
                f"{self.absolute_zero:g} on this scale, got {temperature.min():g} of {what}: give "
                "absolute_zero=-273.15 with degrees Celsius, or correct the temperatures"
            )
        return absolute


#: What heats and cools bodies.
HeatLoad: TypeAlias = HeatFlux | HeatSource | HeatAtNodes | PlasticHeat | Convection | Radiation
