"""Quantities by their names in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact._adaptive.resultants import PairForce, StickArea, SupportForce, TouchingArea
from fenics_contact._base.checks import naming_arguments
from fenics_contact._scene.pairs import pair_number
from fenics_contact._scene.scene import Scene
from fenics_contact.design.near import MovementNear, StressNear
from fenics_contact.design.objective import Objective
from fenics_contact.design.objectives import (
    ContactArea,
    FrictionWork,
    LargestStress,
    Movement,
    StrainEnergy,
    TotalPotential,
)
from fenics_contact.design.peak_pressure import PeakPressure
from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True)
class _Where:
    """What was given with a name, by the names of arguments."""

    scene: Scene
    given: Mapping[str, Any]

    def pair(self) -> int | None:
        """Return the number of the pair that was named by a surface, None for all."""
        return pair_number(self.scene.contacts, self.given["surface"]) if "surface" in self.given else None

    def one_pair(self) -> int:
        """Return the number of a pair; the only one needs no name."""
        contacts = self.scene.contacts
        if "surface" not in self.given and len(contacts) == 1:
            return 0
        return pair_number(contacts, self._given("surface", [pair.place for pair in contacts]))

    def _given(self, name: str, known: Sequence[str]) -> str:
        if name not in self.given:
            raise InvalidInputError(
                f"this quantity needs a {name}, one of {', '.join(map(repr, known)) or 'none'}: "
                f"give {name}=..."
            )
        return str(self.given[name])

    def body_and_surface(self) -> tuple[str, str]:
        """Return both, of a surface in words such as "block top"."""
        known = {
            f"{body} {surface}": (body, surface)
            for body, each in self.scene.bodies.items()
            for surface in each.mesh.surfaces
        }
        words = self._given("surface", list(known))
        if words not in known:
            raise InvalidInputError(
                f"a quantity needs a surface of the scene, got {words!r}, which has "
                f"{', '.join(map(repr, known))}: name the body and its surface"
            )
        return known[words]

    def one_body(self) -> str:
        """Return the name of a body; the only one needs none."""
        bodies = list(self.scene.bodies)
        name = bodies[0] if "body" not in self.given and len(bodies) == 1 else self._given("body", bodies)
        if name not in bodies:
            raise InvalidInputError(
                f"a quantity needs a body of the scene, got {name!r}, which has "
                f"{', '.join(map(repr, bodies))}: name one of them"
            )
        return name

    def along(self) -> tuple[float, ...]:
        """Return the direction."""
        if "direction" not in self.given:
            axes = np.eye(self.scene.dim, dtype=int).tolist()
            raise InvalidInputError(
                f"this quantity needs a direction, such as {tuple(axes[0])} or {tuple(axes[-1])}: give "
                "direction=..."
            )
        return tuple(map(float, np.ravel(np.array(self.given["direction"]))))

    def near(self, fraction: float = 0.05) -> tuple[str, tuple[float, ...], float]:
        """Return body, place and radius of a mean; `fraction`: of the longest side of the body's box."""
        body = self.one_body()
        size = float(np.ptp(self.scene.bodies[body].mesh.points, axis=0).max())
        return body, tuple(map(float, self.given["at"])), self.given.get("radius", fraction * size)


def _displacement(where: _Where) -> Objective:
    if "at" not in where.given:
        return Movement(*where.body_and_surface(), where.along())
    return MovementNear(*where.near(), direction=where.along())


def _stress(where: _Where) -> Objective:
    if "at" not in where.given:
        return LargestStress(where.one_body())
    return StressNear(*where.near(), where.given.get("component") or "von_mises")


#: Name -> what it takes, and the quantity.
QUANTITIES: dict[str, tuple[tuple[str, ...], Callable[[_Where], Objective]]] = {
    "peak_pressure": (("surface",), lambda where: PeakPressure(where.pair())),
    "contact_force": (("surface", "direction"), lambda where: PairForce(where.one_pair(), where.along())),
    "contact_area": (("surface",), lambda where: TouchingArea(where.pair())),
    "effective_area": (("surface",), lambda where: ContactArea(where.pair())),
    "stick_area": (("surface",), lambda where: StickArea(where.one_pair())),
    "friction_work": (("surface",), lambda where: FrictionWork(where.pair())),
    "reaction": (
        ("surface", "direction"),
        lambda where: SupportForce(*where.body_and_surface(), where.along()),
    ),
    "displacement": (("surface", "body", "at", "direction", "radius"), _displacement),
    "stress": (("body", "at", "component", "radius"), _stress),
    "strain_energy": ((), lambda where: StrainEnergy()),
    "potential": ((), lambda where: TotalPotential()),
}


@naming_arguments
def quantity(
    name: str,
    scene: Scene,
    *,
    surface: str | None = None,
    body: str | None = None,
    at: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    component: str | None = None,
    radius: float | None = None,
) -> Objective:
    """Return a quantity by its name.

    ==================  ===================================================================================
    ``peak_pressure``   `PeakPressure` of a pair, by default of all
    ``contact_force``   Force of a pair on its slave along a direction
    ``contact_area``    Area in which a pair touches, by default all; without an adjoint
    ``effective_area``  Smooth effective area of a pair, see `ContactArea`, by default of all
    ``stick_area``      Area of a pair that sticks; without an adjoint
    ``friction_work``   Work of friction of a pair, by default of all
    ``reaction``        Force of the supports of a surface along a direction
    ``displacement``    Mean along a direction, of a surface, or near a place of a body
    ``stress``          Near a place of a body, von Mises or a component; without a place `LargestStress`
    ``strain_energy``   Strain energy of all bodies
    ``potential``       Total potential energy
    ==================  ===================================================================================

    Args:
        name: The name.
        scene: The scene.
        surface: A surface in words, such as "block top"; of a pair its slave, or both surfaces. The only pair
            needs none.
        body: Name of a body; the only one needs none.
        at: A place, shape (dim,), [length].
        direction: A direction of any length, shape (dim,).
        component: "von_mises", or "xx", "xy", ...
        radius: Radius of the mean near a place, [length]; by default a twentieth of the body's size.

    Raises:
        InvalidInputError: If the name is unknown, something that it needs is missing or not in the scene, or
            something is given that it does not take.

    Example:
        >>> quantity("contact_force", scene, direction=(0, 1))  # doctest: +SKIP
        PairForce(pair=0, direction=(0.0, 1.0))
    """
    if name not in QUANTITIES:
        raise InvalidInputError(
            f"a quantity needs a name out of {', '.join(QUANTITIES)}, or an objective of its own such as "
            f"LargestPressure(), got {name!r}"
        )
    taken, made = QUANTITIES[name]
    arguments: dict[str, Any] = {
        "surface": surface, "body": body, "at": at, "direction": direction, "component": component,
        "radius": radius,
    }  # fmt: skip
    given = {key: value for key, value in arguments.items() if value is not None}
    unused = [key for key in given if key not in taken]
    if unused:
        raise InvalidInputError(
            f"{name} takes {' and '.join(taken) or 'nothing else'}, got {' and '.join(unused)}: leave it out"
        )
    return made(_Where(scene, given))
