"""Problems of steady heat."""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.others.rows import Row
from fenics_contact import RigidPlane, Surface
from fenics_contact.gallery import rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    GapConductance,
    HeatObjective,
    HeatOfHeld,
    HeatScene,
    HeldTemperature,
    PressureConductance,
    TemperatureMean,
    ThermalContact,
    harmonic_mean,
    solve_heat_to,
)


def _row(scene: HeatScene, objective: HeatObjective, scale: float = 1.0, **row: Any) -> Row:
    """Return a quantity to 1e-6 of its size, or as far as 20 thousand unknowns reach."""
    began = process_time()
    found = solve_heat_to(scene, objective, 1e-5, MPI.COMM_SELF)
    rounding = 1e-9 * abs(found.value)
    levels = tuple((scale * level.value, level.products) for level in found.levels)
    return Row(
        value=scale * found.value, error=abs(scale) * max(found.error, rounding), levels=levels,
        unknowns=found.levels[-1].unknowns, products=max(level.products for level in found.levels),
        seconds=process_time() - began, **row,
    )  # fmt: skip


def joint() -> HeatScene:
    """A block of steel at 800 K pressed on one of aluminium at 250 K, each 1 x 0.5 m, by 100 N/m²."""
    bodies = {
        "steel": ConductingBody(rectangle((0.0, 0.0), (1.0, 0.5), (8, 4)), Conductor(16.2)),
        "aluminium": ConductingBody(rectangle((1.0, 0.0), (2.0, 0.5), (5, 3)), Conductor(210.0)),
    }
    held = [HeldTemperature("steel", "x0", 800.0), HeldTemperature("aluminium", "x1", 250.0)]
    law = PressureConductance(harmonic_mean(16.2, 210.0), harmonic_mean(129.0, 15.0))
    pair = ThermalContact(Surface("steel", "x1"), Surface("aluminium", "x0"), law, pressure=100.0)
    return HeatScene(bodies, held, contacts=[pair])


def joint_rows() -> list[Row]:
    """closed_gap_prescribed_pressure of MOOSE."""
    conductance = harmonic_mean(16.2, 210.0) * 100.0 / harmonic_mean(129.0, 15.0)
    flux = 550.0 / (1.0 / 16.2 + 1.0 / 210.0 + 1.0 / conductance)
    others = {"flux": "MOOSE 7292.0187", "steel": "", "aluminium": "MOOSE 283.856, a cell behind the joint"}
    given: dict[str, Any] = {"source": "closed form", "margin": 1e-9}
    return [
        _row(
            joint(), HeatOfHeld("steel", "x0"), 2.0, quantity="heat flux [W/m²]", reference=flux,
            others=others["flux"], **given,
        ),
        _row(
            joint(), TemperatureMean("steel", "x1"), quantity="steel at the joint [K]",
            reference=800.0 - flux / 16.2, others=others["steel"], **given,
        ),
        _row(
            joint(), TemperatureMean("aluminium", "x0"), quantity="aluminium at the joint [K]",
            reference=250.0 + flux / 210.0, others=others["aluminium"], **given,
        ),
    ]  # fmt: skip


def annulus() -> HeatScene:
    """A cylinder of radius 1 at 200 in one of inner radius 2 at 100, whose gap conducts."""
    bodies = {
        "inner": ConductingBody(rectangle((0.0, 0.0), (1.0, 1.0), (4, 4)), Conductor(1e6), axisymmetric=True),
        "outer": ConductingBody(rectangle((2.0, 0.0), (3.0, 1.0), (4, 4)), Conductor(1e6), axisymmetric=True),
    }
    held = [HeldTemperature("inner", "x0", 200.0), HeldTemperature("outer", "x1", 100.0)]
    pair = ThermalContact(Surface("inner", "x1"), Surface("outer", "x0"), GapConductance(1.0))
    return HeatScene(bodies, held, contacts=[pair])


def annulus_rows() -> list[Row]:
    """cyl3D of MOOSE, as a section."""
    return [
        _row(
            annulus(), HeatOfHeld("outer", "x1"), -1.0, quantity="heat across the gap [W]",
            reference=2.0 * np.pi * 100.0 / np.log(2.0),
            source="closed form", margin=1e-5, others="MOOSE 906.5",
        )
    ]  # fmt: skip


def obstacle() -> HeatScene:
    """A unit block at 100 above a gap of conductance 10, whose other side is held at 50."""
    body = ConductingBody(rectangle((0.0, 0.0), (1.0, 1.0), (2, 2)), Conductor(1.0))
    floor = ThermalContact(Surface("block", "y0"), RigidPlane((0, 0), (0, 1)), 10.0, temperature=50.0)
    return HeatScene({"block": body}, [HeldTemperature("block", "y1", 100.0)], contacts=[floor])


def obstacle_rows() -> list[Row]:
    """gapheattrans_c of Abaqus's Verification Manual."""
    given: dict[str, Any] = {"source": "closed form", "margin": 1e-9, "others": ""}
    return [
        _row(obstacle(), TemperatureMean("block", "y0"),
        quantity="temperature at the gap", reference=50 + 50 / 11, **given),
        _row(obstacle(), HeatOfHeld("block", "y1"), quantity="heat flux", reference=500 / 11, **given),
    ]  # fmt: skip
