"""Loads, each on one named body or on one of its surfaces.

Loads are dead: they keep direction and size while the body deforms; `Pressure` alone follows the surface of a
body that deforms much. Values are numbers, functions of position
(evaluated at the nodes and interpolated) or `Ufl`. Loads are values: two with the same numbers, or with the
same function object, are equal, and a vector assembled for one is reused for the other. A function must
therefore always return the same values for the same points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import GivenVector, checked, floats
from fenics_contact._scene.fields import ScalarValue, VectorValue, checked_scalar, checked_vector
from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True)
@checked("value")
class Traction:
    """Dead surface load.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Force per reference area, [force / length²] (in the plane: per unit of thickness). A function
            receives points, shape (n, dim), and returns the traction there, shape (n, dim).

    Example:
        >>> even = Traction("block", "z1", (200.0, 0.0, -500.0))  # N/mm²
        >>> rising = Traction("block", "z1", lambda x: -10.0 * x[:, :1] * (0.0, 0.0, 1.0))
    """

    body: str
    surface: str
    value: VectorValue

    def __post_init__(self) -> None:
        """Reject a value that is not a vector."""
        object.__setattr__(self, "value", checked_vector("Traction.value", self.value))


@dataclass(frozen=True)
@checked("value")
class TotalForce:
    """Dead surface load given by its resultant, spread over the surface of the undeformed body.

    Without ``moment`` and ``at`` it is an even traction. With them the traction is a + b × (x − c), c being
    the centroid of the surface, with a and b such that the resultant is exactly the force at the point and
    the moment: even from the force, linear across the surface from the moment. The surface may deform;
    for one that moves as a rigid piece see `RigidSurface`.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Resultant, [force] (in the plane: per unit of thickness).
        moment: Moment besides that of the force, three numbers in space, in the plane one, positive from x to
            y, [force·length]; none by default.
        at: Point at which the force acts, [length]; by default the centroid of the surface.

    Example:
        >>> torque = TotalForce("shaft", "end", (0.0, 0.0, 0.0), moment=(0.0, 0.0, 2e4))  # N, N mm
        >>> eccentric = TotalForce("bracket", "plate", (0.0, 0.0, -500.0), at=(40.0, 0.0, 10.0))
    """

    body: str
    surface: str
    value: GivenVector
    moment: GivenVector | float | None = None
    at: GivenVector | None = None

    def __post_init__(self) -> None:
        """Reject a force, a moment or a point that is not made of finite numbers."""
        for name in ("moment", "at"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, _numbers(f"TotalForce.{name}", given))
        value = checked_vector("TotalForce.value", self.value)
        if not isinstance(value, tuple):
            raise InvalidInputError(
                f"TotalForce.value must be numbers, got {self.value!r}: a resultant cannot depend "
                "on position; give a Traction as a function of position"
            )
        object.__setattr__(self, "value", value)


def _numbers(name: str, given: GivenVector | float) -> GivenVector | float:
    """Return finite numbers as plain ones."""
    numbers = np.asarray(given, dtype=np.float64)
    if not np.isfinite(numbers).all():
        raise InvalidInputError(f"{name} must be finite numbers, got {given!r}: correct it")
    return floats(numbers) if numbers.ndim else float(numbers)


@dataclass(frozen=True)
@checked("value")
class Pressure:
    """Load normal to a surface; positive presses on the body, traction = −p n.

    On a body of a material for large deformations it follows the surface, f = −p cof F N per undeformed area:
    it stays normal to the surface as it lies now, and grows with its area. Elsewhere surfaces keep their
    places.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Pressure p, [force / length²]; a function of position is one of the undeformed body.
        dead: Whether it keeps the direction and size that it has on the undeformed surface.

    Example:
        >>> gas = Pressure("tyre", "inside", 0.2)  # N/mm²
        >>> weight_of_snow = Pressure("membrane", "top", 1e-3, dead=True)
    """

    body: str
    surface: str
    value: ScalarValue
    dead: bool = False

    def __post_init__(self) -> None:
        """Reject a value that is not a scalar."""
        object.__setattr__(self, "value", checked_scalar("Pressure.value", self.value))


@dataclass(frozen=True)
@checked("value")
class BodyForce:
    """Dead load on the volume; for weight see `gravity`.

    Attributes:
        body: Name of the body.
        value: Force per volume, [force / length³].
    """

    body: str
    value: VectorValue

    def __post_init__(self) -> None:
        """Reject a value that is not a vector."""
        object.__setattr__(self, "value", checked_vector("BodyForce.value", self.value))


@dataclass(frozen=True)
@checked("temperature_change")
class ThermalStrain:
    """A temperature change that would strain the body if it were free: σ = C : (ε(u) − ΔT α).

    Its work is ∫ ΔT (C : α) : ε(v). Several on one body add up. The energy of a state counts it as the work
    of a load, so that a freely expanding body has the strain energy of its expansion although it is free of
    stress.

    Attributes:
        body: Name of the body, whose materials must have a thermal expansion.
        temperature_change: ΔT relative to the stress-free temperature, in degrees.
    """

    body: str
    temperature_change: ScalarValue

    def __post_init__(self) -> None:
        """Reject a value that is not a scalar."""
        value = checked_scalar("ThermalStrain.temperature_change", self.temperature_change)
        object.__setattr__(self, "temperature_change", value)

    @property
    def value(self) -> ScalarValue:
        """ΔT, under the name that all loads have."""
        return self.temperature_change


#: What acts on a surface.
SurfaceLoad = Traction | TotalForce | Pressure
#: What acts in the volume of a body.
VolumeLoad = BodyForce | ThermalStrain
#: Any load of a scene.
Load = SurfaceLoad | VolumeLoad


def gravity(body: str, density: float, acceleration: Sequence[float]) -> BodyForce:
    """Return the weight of a body.

    Args:
        body: Name of the body.
        density: Mass per volume, in the scene's units, for steel in N, mm, s: 7.85e-9.
        acceleration: Acceleration of gravity, [length / time²], for instance (0, 0, -9810).
    """
    mass, direction = checked_scalar("density", density), checked_vector("acceleration", acceleration)
    if callable(mass) or callable(direction):
        raise InvalidInputError(
            f"gravity needs numbers, got {density!r} and {acceleration!r}: give a BodyForce for what "
            "varies with position"
        )
    return BodyForce(body, tuple(mass * component for component in direction))
