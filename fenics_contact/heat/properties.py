"""Properties that may depend on the temperature, and what conducts heat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_positive
from fenics_contact._scene.fields import Ufl, finite_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code


@dataclass(frozen=True)
@checked()
class TemperatureTable:
    """A property by temperature: straight between values, constant beyond the ends.

    Attributes:
        temperature: Temperatures, ascending, in degrees.
        value: The property at each of them.

    Raises:
        InvalidInputError: If the numbers do not fit each other.

    Example:
        >>> steel = TemperatureTable((20.0, 800.0), (54.0, 27.3))  # W/(m K)
        >>> steel(np.array([410.0]))
        array([40.65])
    """

    temperature: Sequence[float]
    value: Sequence[float]

    def __post_init__(self) -> None:
        """Reject incomplete tables."""
        at, values = finite_numbers(self.temperature), finite_numbers(self.value)
        if at.ndim != 1 or at.shape != values.shape or not len(at) or (np.diff(at) <= 0).any():
            raise InvalidInputError(
                "a TemperatureTable must have ascending temperatures and as many values, all finite, got "
                f"{self.temperature!r} and {self.value!r}: correct it"
            )
        object.__setattr__(self, "temperature", tuple(at.tolist()))
        object.__setattr__(self, "value", tuple(values.tolist()))

    def __call__(self, temperature: np.ndarray) -> np.ndarray:
        """Return the property at temperatures, of the same shape."""
        return np.interp(temperature, self.temperature, self.value)


#: A number, a table or a function of temperatures, or UFL of coordinates and temperature.
Property: TypeAlias = float | TemperatureTable | Callable[[np.ndarray], np.ndarray] | Ufl


def checked_property(name: str, given: Property, remedy: str) -> Property:
    """Return a property, a number as a float; reject numbers that are not positive."""
    if isinstance(given, TemperatureTable):
        if min(given.value) <= 0.0:
            raise InvalidInputError(
                f"{name} must be positive at all temperatures, got {min(given.value):g}: {remedy}"
            )
        return given
    if callable(given) or isinstance(given, Ufl):
        return given
    check_positive(name, given, remedy)
    return float(given)


def varies(given: Property) -> bool:
    """Return whether a property may depend on the temperature."""
    return not isinstance(given, float)


def at_temperatures(name: str, given: Property, temperature: np.ndarray) -> np.ndarray:
    """Return positive values of a property that is no UFL at temperatures, shape (n,)."""
    if isinstance(given, float):
        return np.full(temperature.shape, given)
    assert not isinstance(given, Ufl)
    with user_code(f"the function given as {name}"):
        values = finite_numbers(given(temperature.copy()))
    if values.shape != temperature.shape or not (values > 0.0).all():
        least = f", the least is {values.min():g}" if values.shape == temperature.shape else ""
        raise InvalidInputError(
            f"{name} must be finite and positive at each temperature from {temperature.min():g} to "
            f"{temperature.max():g}, got values of shape {values.shape}{least}: return one for each"
        )
    return values


@dataclass(frozen=True)
@checked("conductivity", "heat_capacity")
class Conductor:
    """What conducts and stores heat.

    Attributes:
        conductivity: k > 0, [power / (length · degree)]: a number, a `TemperatureTable`, a function of
            temperatures, shape (n,) to (n,), or `Ufl` whose function takes coordinates and temperature. A
            sequence of these, one for each axis, conducts along the axes differently; a symmetric matrix of
            numbers does so along axes of its own. Around an axis of revolution nothing flows.
        heat_capacity: Heat that a volume takes up per degree, density times specific heat, [energy /
            (length³ · degree)], likewise a number, table, function or `Ufl`; for changes in time.

    Raises:
        InvalidInputError: If a number is not positive, or a matrix not symmetric and positive.

    Example:
        >>> steel = Conductor(50e-3, 3.7e-3)  # W/(mm K), J/(mm³ K)
        >>> board = Conductor((0.8, 0.8, 0.3))
        >>> hot = Conductor(TemperatureTable((20.0, 800.0), (54.0, 27.3)))
    """

    conductivity: Property | Sequence[Property] | np.ndarray
    heat_capacity: Property | None = None

    def __post_init__(self) -> None:
        """Reject what does not conduct."""
        given, remedy = self.conductivity, "steel has about 50 W/(m K), which is 0.05 W/(mm K)"
        name = "Conductor.conductivity"
        if not isinstance(given, TemperatureTable) and isinstance(given, Sequence | np.ndarray):
            given = _tensor(name, given, remedy)
        else:
            given = checked_property(name, given, remedy)  # type: ignore[arg-type]
        object.__setattr__(self, "conductivity", given)
        if self.heat_capacity is not None:
            remedy = "steel has about 3.7e6 J/(m³ K), which is 3.7e-3 J/(mm³ K)"
            capacity = checked_property("Conductor.heat_capacity", self.heat_capacity, remedy)
            object.__setattr__(self, "heat_capacity", capacity)

    @property
    def along_axes(self) -> tuple[Property, ...]:
        """The conductivities along the axes, or the one in all directions."""
        given = self.conductivity
        if isinstance(given, tuple) and isinstance(given[0], tuple):
            return ()
        return given if isinstance(given, tuple) else (given,)  # type: ignore[return-value]

    @property
    def matrix(self) -> np.ndarray:
        """The matrix of conductivities where that was given, else none, (0, 0)."""
        return np.array(self.conductivity) if not self.along_axes else np.zeros((0, 0))

    @property
    def is_linear(self) -> bool:
        """Whether nothing depends on the temperature."""
        capacity = () if self.heat_capacity is None else (self.heat_capacity,)
        return not any(map(varies, (*self.along_axes, *capacity)))

    def conducted(self, temperature: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """Return k ∇T at points, shape (..., dim), by temperatures, (...), of properties that are no UFL."""
        if not self.along_axes:
            return gradient @ self.matrix
        name, flat = "Conductor.conductivity", temperature.ravel()
        k = [at_temperatures(name, each, flat).reshape(temperature.shape) for each in self.along_axes]
        return gradient * (k[0][..., None] if len(k) == 1 else np.stack(k, axis=-1))

    def typical(self, temperature: float) -> float:
        """Return a conductivity for comparison with those of other bodies."""
        if not self.along_axes:
            return float(np.trace(self.matrix)) / len(self.matrix)
        at = np.array([temperature])
        known = [k for k in self.along_axes if not isinstance(k, Ufl)]
        values = [float(at_temperatures("Conductor.conductivity", k, at)[0]) for k in known]
        return float(np.mean(values)) if values else 1.0


def _tensor(name: str, given: Sequence[Property] | np.ndarray, remedy: str) -> Any:
    numbers = finite_numbers(given)
    if numbers.ndim == 2 and numbers.shape in ((2, 2), (3, 3)):
        values = np.linalg.eigvalsh(0.5 * (numbers + numbers.T))
        if not np.allclose(numbers, numbers.T, rtol=1e-12, atol=0.0) or values[0] <= 0.0:
            raise InvalidInputError(
                f"{name} must be a symmetric matrix with positive eigenvalues, got {numbers.tolist()}, which "
                f"has {values.tolist()}: {remedy}"
            )
        return tuple(map(tuple, numbers.tolist()))
    if len(given) not in (2, 3) or (numbers.ndim == 2):
        raise InvalidInputError(
            f"{name} must be one property, one for each axis or a matrix, got {given!r}: give 2 in the "
            "plane, 3 in space"
        )
    return tuple(checked_property(name, each, remedy) for each in given)
