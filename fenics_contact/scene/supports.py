"""Supports: displacements prescribed on surfaces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene.values import OfPosition, evaluate

#: What a support does with one component: leave it free (None), or prescribe a number or a function of the
#: points.
Component = float | OfPosition | None


@dataclass(frozen=True)
@checked()
class Support:
    """Displacement prescribed on a surface, component by component.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Displacement [length] for x, y, z (for x, y on a plane body), by default zero in all directions
            of the body's space. None leaves a component free; a function receives points, shape (n, dim), and
            returns the component there, shape (n,).

    Raises:
        InvalidInputError: If nothing is prescribed, or something other than a finite number or a function.

    Example:
        >>> clamped = Support("block", "x0")
        >>> roller = Support("block", "z0", (None, None, 0.0))
        >>> pushed = Support("block", "x1", (0.5, None, None))  # mm
    """

    body: str
    surface: str
    value: tuple[Component, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Reject a support that prescribes nothing or something other than a number."""
        given = [component for component in self.value if component is not None]
        numbers = [component for component in given if not callable(component)]
        if len(self.value) not in (2, 3) or not given or not np.all(np.isfinite(numbers)):
            raise InvalidInputError(
                "Support.value must hold three entries (two for a plane body), each a finite number, a "
                f"function of the points or None, and at least one that is not None, got {self.value!r}: use "
                "(0.0, 0.0, 0.0) to clamp, (None, None, 0.0) for a roller"
            )
        object.__setattr__(self, "value", tuple(self.value))

    def held_in(self, dim: int) -> Support:
        """Return the support of a body of a dimension: zeros for three directions hold a plane body, too."""
        plane = dim == 2 and self.value == (0.0, 0.0, 0.0)
        return replace(self, value=(0.0, 0.0)) if plane else self

    @property
    def in_words(self) -> str:
        """Where it is and what it prescribes."""
        given = ("free" if v is None else "function" if callable(v) else f"{v:g}" for v in self.value)
        return f"{self.body} {self.surface} ({', '.join(given)})"

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the prescribed displacement, NaN where a component is free.

        Args:
            points: Coordinates of nodes on the surface, shape (n, dim), [length].

        Returns:
            Shape (n, dim), [length].

        Raises:
            InvalidInputError: If a function does not return one finite number per point.
        """
        result = np.full(points.shape, np.nan)
        for component, given in enumerate(self.value):
            if callable(given):
                name = f"component {component} of the support of surface {self.surface!r}"
                result[:, component] = evaluate(name, given, points, ())
            elif given is not None:
                result[:, component] = given
        return result
