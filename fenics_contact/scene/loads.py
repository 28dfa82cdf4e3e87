"""Supports and loads, each on one named part of one body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.errors import InvalidInputError

Vector = tuple[float, float, float]


def _require_vector(name: str, value: Vector) -> None:
    if len(value) != 3 or not np.all(np.isfinite(value)):
        raise InvalidInputError(
            f"{name} must be three finite numbers, got {value!r}: give one for x, y and z"
        )


@dataclass(frozen=True)
class Support:
    """Displacement prescribed on a surface, component by component.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Displacement [length] for x, y, z; None leaves a component free.
    """

    body: str
    surface: str
    value: tuple[float | None, float | None, float | None] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse a support that prescribes nothing or something that is no number."""
        given = [component for component in self.value if component is not None]
        if len(self.value) != 3 or not given or not np.all(np.isfinite(given)):
            raise InvalidInputError(
                "Support.value must hold three entries, each a finite number or None, and at least one "
                f"number, got {self.value!r}: use (0.0, 0.0, 0.0) to clamp, (None, None, 0.0) for a roller"
            )

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the prescribed displacements, NaN where free, (n, dim) -> (n, dim), [length]."""
        given = [np.nan if component is None else component for component in self.value]
        return np.tile(np.array(given, dtype=np.float64), (len(points), 1))


@dataclass(frozen=True)
class Traction:
    """Dead surface load.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Force a reference area, [force / length²].
    """

    body: str
    surface: str
    value: Vector

    def __post_init__(self) -> None:
        """Refuse what is no vector."""
        _require_vector("Traction.value", self.value)


@dataclass(frozen=True)
class TotalForce:
    """Dead surface load given by its resultant, spread evenly over the surface of the undeformed body.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Resultant, [force].
    """

    body: str
    surface: str
    value: Vector

    def __post_init__(self) -> None:
        """Refuse what is no vector."""
        _require_vector("TotalForce.value", self.value)


@dataclass(frozen=True)
class BodyForce:
    """Dead load on the volume, such as weight.

    Attributes:
        body: Name of the body.
        value: Force a volume, [force / length³].
    """

    body: str
    value: Vector

    def __post_init__(self) -> None:
        """Refuse what is no vector."""
        _require_vector("BodyForce.value", self.value)


Load = Traction | TotalForce | BodyForce
