"""Constants that are hardly meant: conductivities and radiation in other units than lengths and moduli."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._scene.plausible import LONG, METALS
from fenics_contact._scene.scene import Scene
from fenics_contact.errors.kinds import safe_log
from fenics_contact.heat.parts import Radiation
from fenics_contact.heat.scene import HeatScene
from fenics_contact.materials.elastic import isotropic_constants

if TYPE_CHECKING:
    from fenics_contact.heat.state import HeatState

_LOG = logging.getLogger(__name__)


def odd_values(
    scene: HeatScene, metals: tuple[float, float] = (15.0, 430.0), cold: float = 100.0
) -> Iterator[str]:
    """Return words on constants in W and m in bodies that are measured in mm, and radiation in °C.

    `metals`: conductivities of metals, [W/(m K)], which are the same in N mm/s; capacities are a millionth;
    `cold`: temperature of surroundings below which °C were meant, [K].
    """
    sizes = {name: float(np.ptp(body.mesh.points, axis=0).max()) for name, body in scene.bodies.items()}
    for name, material in ((n, each) for n, body in scene.bodies.items() for each in body.materials):
        k, capacity = material.typical(20.0), material.heat_capacity
        small = isinstance(capacity, float) and capacity < 1e4
        if sizes[name] >= LONG and metals[0] <= k <= metals[1] and not small:
            yield (
                f"odd units in body {name!r}? a conductivity of {k:g} is that of a metal in W/(m K), the "
                f"body is {sizes[name]:.4g} long: in W and mm it would be {1e-3 * k:g}; it is right where "
                "lengths are in m, or in mm with power in N mm/s"
            )
    for load in scene.loads:
        if isinstance(load, Radiation) and not callable(load.ambient):
            above = load.ambient - load.absolute_zero
            if above < cold:
                yield (
                    f"odd temperatures in Radiation {load.place}? its surroundings are at {above:g} degrees "
                    "above absolute zero; temperatures in °C need absolute_zero=-273.15"
                )
        if sizes[load.body] >= LONG and getattr(load, "constant", 0.0) == Radiation.constant:
            yield (
                f"odd units in Radiation {load.place}? its constant is in W/(m² K⁴), the body is "
                f"{sizes[load.body]:.4g} long: in W and mm give constant=5.67e-14, in N mm/s 5.67e-11"
            )


def blocked(state: HeatState) -> Iterator[str]:
    """Return words on contacts whose law needs a pressure, and that have none."""
    for contact, each in zip(state.scene.contacts, state.contacts, strict=True):
        if len(each.conductance) and not each.conductance.any():
            yield (
                f"no heat passes through {contact.place}: its conductance is zero at the pressures and gaps "
                "of the scene; give ThermalContact(..., pressure=...), add a GapConductance, or take "
                "solve_heated"
            )


def odd_power(scene: Scene, heat: HeatScene, metals: tuple[float, float] = (0.015, 0.43)) -> Iterator[str]:
    """Return words on conductivities of metals in W and mm, `metals`, where moduli are in N/mm²."""
    for name in [each for each in heat.bodies if each in scene.bodies]:
        young = max((isotropic_constants(each) or (0.0,))[0] for each in scene.bodies[name].materials)
        k = max(each.typical(20.0) for each in heat.bodies[name].materials)
        if METALS[0] <= 1e-3 * young <= METALS[1] and metals[0] <= k <= metals[1]:
            yield (
                f"odd units in body {name!r}? a conductivity of {k:g} is that of a metal in W/(mm K), its "
                f"Young's modulus {young:g} is in N/mm²: power is then in N mm/s and the conductivity "
                f"{1e3 * k:g}"
            )


def warn_of(words: Iterable[str], comm: MPI.Comm) -> None:
    """Log words on constants that are hardly meant, on one rank."""
    for each in words:
        if comm.rank == 0:
            safe_log(_LOG.warning, "%s", each)
