"""Fluid that enters between surfaces where their contact opens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_not_negative
from fenics_contact._scene.fields import OfPosition
from fenics_contact._scene.part import Around, require_surface
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code


@dataclass(frozen=True)
@checked()
class FluidPressure:
    """A fluid under pressure that enters a contact from its wetted side, as far as it is open: a seal.

    It presses both surfaces apart at all contact points that are open and connected, facet by facet, with a
    point where it enters. The front is found by solving again until it stays where it is: from the dry
    contact on, or from where the load step before left it. A slave of a material for large deformations is
    pressed normal to its surface as it lies, as by `Pressure`, and so are masters of such materials.

    Attributes:
        pressure: Pressure of the fluid, ≥ 0, [force / length²].
        enters: Where it enters: a surface of the slave's body that shares nodes with the slave surface, or a
            function of points of the slave, shape (n, dim), that returns whether they are at the inlet, shape
            (n,).
        critical: Contact pressure, ≥ 0, up to which a point counts as open, [force / length²]; or
            ``"pressure"``, that of the fluid, also where load steps change it. Where there is fluid already
            it is what the contact presses in addition to the fluid: a front that moved on moves back late.
        name: What load steps call it, see `LoadStep`; all of its inlets have one pressure.

    Raises:
        InvalidInputError: If a pressure is negative or not finite.

    Example:
        >>> FluidPressure(5.0, enters="x0").pressure
        5.0
    """

    pressure: float
    enters: str | OfPosition
    critical: float | Literal["pressure"] = 0.0
    name: str = "fluid"

    def __post_init__(self) -> None:
        """Reject negative pressures."""
        for name in ("pressure", "critical"):
            given = getattr(self, name)
            if given != "pressure":
                check_not_negative(f"FluidPressure.{name}", given, "suction does not enter a contact")

    def check(self, scene: Around, body: str, place: str) -> None:
        """Reject an unknown inlet, and bodies of nonlinear materials; `body`: that of the slave."""
        if isinstance(self.enters, str):
            require_surface(scene, body, self.enters, "FluidPressure.enters")
        if scene.is_nonlinear and not scene.bodies[body].deforms_much:
            raise InvalidInputError(
                f"the fluid between {place} needs linear materials in all bodies, or a slave of a material "
                f"for large deformations, got body {body!r} of another: make the softer body the slave, "
                "or give NeoHooke or FinitePlasticity"
            )

    @property
    def opens_at(self) -> float:
        """The contact pressure up to which a point counts as open, [force / length²]."""
        return self.pressure if self.critical == "pressure" else self.critical

    def inlet(self, points: np.ndarray, shared: np.ndarray) -> np.ndarray:
        """Return which slave nodes are at the inlet, shape (n,).

        Args:
            points: Their coordinates, shape (n, dim), [length].
            shared: Which of them the surface of that name has, if it is a name, shape (n,).

        Raises:
            InvalidInputError: If there is no such node, or a function returns something else.
        """
        found = shared
        if callable(self.enters):
            with user_code("FluidPressure.enters"):
                found = np.asarray(self.enters(points))
            if found.shape != (len(points),) or found.dtype != bool:
                raise InvalidInputError(
                    f"FluidPressure.enters must return True or False for each point, shape ({len(points)},), "
                    f"got {found.dtype} of shape {found.shape}: return a comparison such as x[:, 0] < 1"
                )
        if not found.any():
            raise InvalidInputError(
                "FluidPressure.enters must name a place at the slave surface, got none of its nodes: give a "
                "surface of the slave's body with which it shares an edge, or another function"
            )
        return found
