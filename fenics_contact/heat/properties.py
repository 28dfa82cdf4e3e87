"""Properties that may depend on the temperature, and what conducts heat."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._fem.load_forms import FIRST_COUNT
from fenics_contact._scene.checks import check_positive
from fenics_contact._scene.fields import Ufl, finite_numbers, is_number
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code

if TYPE_CHECKING:
    import ufl

    from fenics_contact._kinematics.element import Element

#: Values of fields at nodes, shape (n,) each.
Fields: TypeAlias = tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Symbols:
    """A property as UFL, with its constants and coefficients."""

    expression: Any
    constants: tuple[ufl.Constant, ...] = ()
    coefficients: tuple[ufl.Coefficient, ...] = ()


def slope_of(law: Callable[[np.ndarray], np.ndarray], temperature: np.ndarray) -> np.ndarray:
    """Return the derivative of a law by the temperature at temperatures, of the same shape."""
    step = 1e-5 * np.maximum(np.abs(temperature), 1.0)
    return np.asarray((law(temperature + step) - law(temperature - step)) / (2.0 * step))


class Property(ABC):
    """A positive property of a material, such as its conductivity; by default its form has a nodal field."""

    #: What forms depend on.
    kind: Hashable = "field"
    #: Whether it may depend on the temperature, and on coordinates.
    varies, by_place = True, False
    #: Values of the constants of its form.
    numbers: tuple[float, ...] = ()

    def symbols(self, element: Element, number: int) -> Symbols:
        """Return it on the template of an element; ``number`` distinguishes the properties of one form."""
        import ufl

        field = ufl.Coefficient(element.nodal, count=FIRST_COUNT + number)
        return Symbols(field, (), (field,))

    def by_temperature(self, element: Element, number: int) -> Symbols:
        """Return its derivative by the temperature, likewise; by default that at nodes, a field."""
        return Property.symbols(self, element, number)

    def slopes(self, temperature: np.ndarray) -> Fields:
        """Return the fields of `by_temperature` at temperatures of nodes, shape (n,)."""
        return (slope_of(self.at, temperature),)

    @abstractmethod
    def at(self, temperature: np.ndarray) -> np.ndarray:
        """Return its values at temperatures, of the same shape."""

    def at_points(self, points: np.ndarray, temperature: np.ndarray) -> np.ndarray:
        """Return its values at points, shape (..., dim), and temperatures there, (...)."""
        return self.at(temperature)

    def fields(self, temperature: np.ndarray) -> Fields:
        """Return the fields of its form at temperatures of nodes, shape (n,)."""
        return (self.at(temperature),)

    def mean_fields(self, before: np.ndarray, after: np.ndarray) -> Fields:
        """Return the fields of its mean between two temperatures at each node, by Gauss's quadrature."""
        places, weights = np.polynomial.legendre.leggauss(8)
        between = before[:, None] + 0.5 * (places + 1.0) * (after - before)[:, None]
        return (np.asarray(0.5 * self.at(between) @ weights),)


@dataclass(frozen=True)
class Number(Property):
    """The same at all temperatures."""

    value: float
    kind = "number"
    varies = False

    @property
    def numbers(self) -> tuple[float, ...]:  # type: ignore[override]
        """The number."""
        return (self.value,)

    def symbols(self, element: Element, number: int) -> Symbols:
        """Return a constant."""
        constant = element.constant()
        return Symbols(constant, (constant,))

    def at(self, temperature: np.ndarray) -> np.ndarray:
        """Return the number."""
        return np.full(temperature.shape, self.value)

    def fields(self, temperature: np.ndarray) -> Fields:
        """Return none."""
        return ()

    def mean_fields(self, before: np.ndarray, after: np.ndarray) -> Fields:
        """Return none."""
        return ()


@dataclass(frozen=True)
class ByFunction(Property):
    """A function of temperatures."""

    name: str
    function: Callable[[np.ndarray], np.ndarray]

    def at(self, temperature: np.ndarray) -> np.ndarray:
        """Return what the function does, if that is positive."""
        given = temperature.ravel()
        with user_code(f"the function given as {self.name}"):
            values = finite_numbers(self.function(given.copy()))
        if values.shape != given.shape or not (values > 0.0).all():
            least = f", the least is {values.min():g}" if values.shape == given.shape else ""
            raise InvalidInputError(
                f"{self.name} must be finite and positive at each temperature from {given.min():g} to "
                f"{given.max():g}, got values of shape {values.shape}{least}: return one for each"
            )
        return values.reshape(temperature.shape)


class Written(Property):
    """What is written in UFL, and holds at the points of the quadrature."""

    @abstractmethod
    def written(self, x: Any, temperature: Any, constants: tuple[Any, ...]) -> Any:
        """Return it (UFL) at coordinates and a temperature, by constants for its `numbers`."""

    def symbols(self, element: Element, number: int) -> Symbols:
        """Return it with the temperature as field."""
        return self._symbols(element, number, lambda expression, _: expression)

    def by_temperature(self, element: Element, number: int) -> Symbols:
        """Return its derivative, likewise."""
        import ufl

        return self._symbols(element, number, ufl.diff)

    def _symbols(self, element: Element, number: int, made: Callable[[Any, Any], Any]) -> Symbols:
        import ufl

        field = ufl.Coefficient(element.nodal, count=FIRST_COUNT + number)
        at, constants = ufl.variable(field), tuple(element.constant() for _ in self.numbers)
        return Symbols(made(self.written(element.x, at, constants), at), constants, (field,))

    def fields(self, temperature: np.ndarray) -> Fields:
        """Return the temperature."""
        return (temperature,)

    def slopes(self, temperature: np.ndarray) -> Fields:
        """Return the temperature."""
        return (temperature,)


@dataclass(frozen=True)
class ByUfl(Written):
    """UFL of coordinates and temperature, evaluated at the points of the quadrature."""

    by_place = True
    name: str
    given: Ufl

    @property
    def kind(self) -> Hashable:  # type: ignore[override]
        """The function itself."""
        return self.given

    def written(self, x: Any, temperature: Any, constants: tuple[Any, ...]) -> Any:
        """Return what the function makes of coordinates and temperature."""
        import ufl

        with user_code(f"the function given as {self.name}"):
            return ufl.as_ufl(self.given.function(x, temperature))  # type: ignore[call-arg]

    def at(self, temperature: np.ndarray) -> np.ndarray:
        """Refuse: it is known in forms alone."""
        raise InvalidInputError(
            f"{self.name} is given as Ufl, of which there are no values outside of forms: give a function of "
            "temperatures or a TemperatureTable"
        )

    def at_points(self, points: np.ndarray, temperature: np.ndarray) -> np.ndarray:
        """Return what the function does, point by point: UFL has no arrays."""
        import ufl

        flat = zip(points.reshape(-1, points.shape[-1]).tolist(), temperature.ravel().tolist(), strict=True)
        with user_code(f"the function given as {self.name}"):
            values = [self.given.function(ufl.as_vector(x), ufl.as_ufl(T)) for x, T in flat]  # type: ignore[call-arg]
            return np.array([ufl.as_ufl(each)(()) for each in values]).reshape(temperature.shape)

    def mean_fields(self, before: np.ndarray, after: np.ndarray) -> Fields:
        """Return the temperature in the middle."""
        return (0.5 * (before + after),)


@dataclass(frozen=True)
@checked()
class TemperatureTable(Written):
    """A property by temperature: straight between values, constant beyond the ends.

    Attributes:
        temperature: Temperatures, ascending, in degrees.
        value: The property at each of them.

    Raises:
        InvalidInputError: If the numbers do not fit each other.

    Example:
        >>> steel = TemperatureTable((20.0, 800.0), (54.0, 27.3))  # W/(m K)
        >>> steel.at(np.array([410.0]))
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

    @property
    def kind(self) -> Hashable:  # type: ignore[override]
        """Its length: values at the points of the quadrature follow kinks within cells."""
        return "table", len(self.value)

    @property
    def numbers(self) -> tuple[float, ...]:  # type: ignore[override]
        """Its temperatures, then its values."""
        return (*self.temperature, *self.value)

    def written(self, x: Any, temperature: Any, constants: tuple[Any, ...]) -> Any:
        """Return the first value and what each interval adds to it."""
        import ufl

        count = len(self.value)
        at, values = constants[:count], constants[count:]
        whole = values[0]
        for k in range(count - 1):
            share = ufl.max_value(0.0, ufl.min_value(1.0, (temperature - at[k]) / (at[k + 1] - at[k])))
            whole += share * (values[k + 1] - values[k])
        return whole

    def at(self, temperature: np.ndarray) -> np.ndarray:
        """Return the property at temperatures, of the same shape."""
        return np.interp(temperature, self.temperature, self.value)

    def slope(self, temperature: np.ndarray) -> np.ndarray:
        """Return its derivative at temperatures, zero beyond the ends."""
        slopes = np.diff(self.value) / np.diff(self.temperature)
        return np.concatenate([[0.0], slopes, [0.0]])[np.searchsorted(self.temperature, temperature)]


#: A number, a table or a function of temperatures, or UFL of coordinates and temperature.
GivenProperty: TypeAlias = float | Property | Callable[[np.ndarray], np.ndarray] | Ufl


def property_of(name: str, given: Any, remedy: str) -> Property:
    """Return what was given as a property; reject numbers that are not positive."""
    if isinstance(given, TemperatureTable) and min(given.value) <= 0.0:
        raise InvalidInputError(
            f"{name} must be positive at all temperatures, got {min(given.value):g}: {remedy}"
        )
    if isinstance(given, Property):
        return given
    if isinstance(given, Ufl):
        return ByUfl(name, given)
    if callable(given):
        return ByFunction(name, given)
    if not is_number(given):
        raise InvalidInputError(
            f"{name} must be a number, a TemperatureTable, a function of temperatures or Ufl, got {given!r}: "
            f"{remedy}"
        )
    check_positive(name, given, remedy)
    return Number(float(given))


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

    #: Degrees at which conductivities of bodies are compared, to weigh their shares in preconditioners.
    compared_at: ClassVar[float] = 20.0

    conductivity: GivenProperty | Sequence[GivenProperty] | np.ndarray
    heat_capacity: GivenProperty | None = None

    def __post_init__(self) -> None:
        """Reject what does not conduct."""
        if isinstance(self.conductivity, list | tuple | np.ndarray):
            given = np.asarray(self.conductivity).tolist()
            object.__setattr__(
                self, "conductivity", tuple(tuple(x) if isinstance(x, list) else x for x in given)
            )
        _ = self.tensor, self.capacities

    @cached_property
    def tensor(self) -> np.ndarray:
        """Conductivities as properties: one, shape (), one for each axis, (dim,), or a matrix, (dim, dim)."""
        name, remedy = "Conductor.conductivity", "steel has about 50 W/(m K), which is 0.05 W/(mm K)"
        given = np.empty((), dtype=object)
        if not isinstance(self.conductivity, tuple):
            given[()] = property_of(name, self.conductivity, remedy)
            return given
        given = np.array(self.conductivity, dtype=object)
        if given.shape not in ((2,), (3,), (2, 2), (3, 3)):
            raise InvalidInputError(
                f"{name} must be one property, one for each axis or a matrix, got {self.conductivity!r}: "
                "give 2 in the plane, 3 in space"
            )
        if given.ndim == 2:
            _check_matrix(name, finite_numbers(self.conductivity), remedy)
            return np.vectorize(lambda value: Number(float(value)), otypes=[object])(given)
        return np.vectorize(lambda each: property_of(name, each, remedy), otypes=[object])(given)

    @cached_property
    def capacities(self) -> tuple[Property, ...]:
        """The heat capacity as a property, nothing where it was not given."""
        remedy = "steel has about 3.7e6 J/(m³ K), which is 3.7e-3 J/(mm³ K)"
        name, given = "Conductor.heat_capacity", self.heat_capacity
        if given is None:
            return ()
        found = property_of(name, given, remedy)
        # At nodes, where means over temperatures store the heat of the table exactly.
        return (ByFunction(name, found.at) if isinstance(found, TemperatureTable) else found,)

    @property
    def by_place(self) -> bool:
        """Whether a property may depend on coordinates."""
        return any(each.by_place for each in (*self.tensor.ravel(), *self.capacities))

    @property
    def is_linear(self) -> bool:
        """Whether nothing depends on the temperature."""
        return not any(each.varies for each in (*self.tensor.ravel(), *self.capacities))

    def conducted(self, points: np.ndarray, temperature: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """Return k ∇T at points, shape (..., dim), by temperatures there, (...)."""
        k = np.array([each.at_points(points, temperature) for each in self.tensor.ravel()])
        k = np.moveaxis(k, 0, -1).reshape(*temperature.shape, *self.tensor.shape)
        if self.tensor.ndim == 2:
            return np.asarray(np.einsum("...ij,...j->...i", k, gradient))
        return gradient * (k if self.tensor.ndim else k[..., None])

    def typical(self, temperature: float) -> float:
        """Return a conductivity for comparison with those of other bodies."""
        main = self.tensor.ravel() if self.tensor.ndim < 2 else self.tensor.diagonal()
        known = [each for each in main if not isinstance(each, ByUfl)]
        return float(np.mean([each.at(np.array(temperature)) for each in known])) if known else 1.0


def _check_matrix(name: str, matrix: np.ndarray, remedy: str) -> None:
    """Reject a matrix that is not symmetric and positive."""
    square = matrix.ndim == 2
    values = np.linalg.eigvalsh(0.5 * (matrix + matrix.T)) if square else np.zeros(1)
    if not square or not np.allclose(matrix, matrix.T, rtol=1e-12, atol=0.0) or values[0] <= 0.0:
        raise InvalidInputError(
            f"{name} must be a symmetric matrix of numbers with positive eigenvalues, got {matrix.tolist()}, "
            f"with {values.tolist()}: {remedy}"
        )
