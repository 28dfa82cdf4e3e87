"""Cases of MOOSE's gap_heat_transfer_mortar, by their numbers.

Geometry, constants and printed temperatures are those of modules/heat_transfer/test/tests in MOOSE (LGPL);
nothing else of it is here.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Surface
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    Conductance,
    ConductingBody,
    Conductor,
    Convection,
    GapConductance,
    GapRadiation,
    HeatFlux,
    HeatScene,
    HeatSource,
    HeatState,
    HeldTemperature,
    ThermalContact,
    solve_heat,
)
from fenics_contact.mesh import quadratic


def displaced(law: Conductance) -> HeatState:
    """Two blocks of k 0.01 and 0.005 at 100 and 0, the left one moved towards the other: a gap of 0.1."""
    bodies = {
        "left": ConductingBody(rectangle((0.1, 0.0), (0.5, 1.0), (4, 5)), Conductor(0.01)),
        "right": ConductingBody(rectangle((0.6, 0.0), (1.0, 1.0), (4, 7)), Conductor(0.005)),
    }
    held = [HeldTemperature("left", "x0", 100.0), HeldTemperature("right", "x1", 0.0)]
    gap = ThermalContact(Surface("left", "x1"), Surface("right", "x0"), law, discretisation="mortar")
    return solve_heat(HeatScene(bodies, held, contacts=[gap]), MPI.COMM_SELF)


def test_displaced_blocks_radiate_into_each_other():
    # bc_gap_heat_transfer_displaced_radiation: σ is 5.669e-8 there, which the fifth digit shows.
    (gap,) = displaced(GapRadiation(1.0, 1.0)).contacts
    assert gap.slave == pytest.approx(70.621675, abs=2e-3)
    assert gap.master == pytest.approx(58.756649, abs=4e-3)


def test_displaced_blocks_conduct_across_their_gap():
    (gap,) = displaced(GapConductance(100.0)).contacts  # bc_gap_heat_transfer_displaced_conduction
    assert gap.slave == pytest.approx(66.666944442, rel=1e-8)
    assert gap.master == pytest.approx(66.666111116, rel=1e-8)


@pytest.mark.parametrize("order", [1, 2])
def test_quadratic_blocks_whose_faces_do_not_match(order: int):
    # gap_heat_transfer_3D_mortar: 5000 degrees across a gap of one.
    left = block((-1.0, -0.5, -0.5), (-0.5, 0.5, 0.5), (2, 3, 3))
    right = block((0.5, -0.5, -0.5), (1.0, 0.5, 0.5), (2, 4, 4))
    meshes = {"left": left, "right": right}
    bodies = {
        name: ConductingBody(quadratic(mesh) if order == 2 else mesh, Conductor(34.6))
        for name, mesh in meshes.items()
    }
    loads = [HeatSource("left", 50e3), Convection("right", "x1", 10.0, ambient=300.0)]
    gap = ThermalContact(Surface("left", "x1"), Surface("right", "x0"), GapConductance(5.0))
    state = solve_heat(HeatScene(bodies, loads=loads, contacts=[gap]), MPI.COMM_SELF)
    assert state.contacts[0].slave == pytest.approx(8161.2716763, rel=1e-9)
    assert state.contacts[0].master == pytest.approx(3161.2716763, rel=1e-9)
    assert state.balance.error < 1e-12


def reactor(law: Conductance, gap: float = 0.2) -> HeatState:
    """A heated core in a vessel, a section of both around their axis."""
    bodies = {
        "core": ConductingBody(
            rectangle((0.0, 0.0), (2.0, 1.0), (40, 1)), Conductor(34.6), axisymmetric=True
        ),
        "vessel": ConductingBody(
            rectangle((2.0 + gap, 0.0), (2.5 + gap, 1.0), (30, 1)), Conductor(34.6), axisymmetric=True
        ),
    }
    loads = [HeatSource("core", 50e3), Convection("vessel", "x1", 10.0, ambient=300.0)]
    contact = ThermalContact(Surface("vessel", "x0"), Surface("core", "x1"), law)
    return solve_heat(HeatScene(bodies, loads=loads, contacts=[contact]), MPI.COMM_SELF)


def test_a_core_radiates_into_its_vessel():
    # large_gap_heat_transfer_test_rz_cylinder prints 4595.595 of the vessel, and 4598.837 of the core, with a
    # flux between plane surfaces on the mean of both radii; grey concentric cylinders differ by more.
    state = reactor(GapConductance(0.1) + GapRadiation(0.8, 0.8))
    (gap,) = state.contacts
    assert gap.slave == pytest.approx(4595.5949, rel=1e-5)
    heat, emitted = 50e3 * np.pi * 4.0, 1.0 / (1.0 / 0.8 + 2.0 / 2.2 * (1.0 / 0.8 - 1.0))
    assert -gap.total == pytest.approx(heat, rel=1e-10)
    core, vessel = gap.master.mean(), gap.slave.mean()
    radiated = 4.0 * np.pi * emitted * 5.670374419e-8 * (core**4 - vessel**4)
    conducted = 2.0 * np.pi * 0.1 * (core - vessel) / np.log(1.1)
    assert radiated + conducted == pytest.approx(heat, rel=1e-6)
    assert gap.master == pytest.approx(4598.8368, rel=5e-5)


def shell(inner: float, outer: float, cells: int) -> ConductingBody:
    """Return half the section of a hollow sphere, quadratic."""
    flat = quadratic(rectangle((inner, -np.pi / 2), (outer, np.pi / 2), (2, cells)))
    return ConductingBody(flat.moved(_polar(flat.points)), Conductor(34.6), axisymmetric=True)


def _polar(points: np.ndarray) -> np.ndarray:
    across = np.maximum(points[:, 0] * np.cos(points[:, 1]), 0.0)
    return np.column_stack([np.where(across < 1e-12, 0.0, across), points[:, 0] * np.sin(points[:, 1])])


@pytest.mark.parametrize("slave", ["core", "vessel"])
def test_a_heated_ball_in_a_hollow_one(slave: str):
    # large_gap_heat_transfer_test_sphere: 2232.13 and 565.47 in closed form; meshes of MOOSE print 2231.9 to
    # 2232.2 and 561.7 to 565.7.
    heat = 4.0 / 3.0 * np.pi * 50e3
    bodies = {"core": shell(0.5, 1.0, 24), "vessel": shell(2.0, 3.0, 34)}
    loads = [
        HeatFlux("core", "x0", heat, total=True),
        Convection("vessel", "x1", 10.0, ambient=300.0),
    ]
    sides = {"core": Surface("core", "x1"), "vessel": Surface("vessel", "x0")}
    other = next(name for name in sides if name != slave)
    law = GapConductance(5.0)
    contact = ThermalContact(sides[slave], sides[other], law, discretisation="node")
    (gap,) = solve_heat(HeatScene(bodies, loads=loads, contacts=[contact]), MPI.COMM_SELF).contacts
    outside = 300.0 + heat / (4.0 * np.pi * 9.0 * 10.0)
    vessel = outside + heat / (4.0 * np.pi * 34.6) * (1.0 / 2.0 - 1.0 / 3.0)
    core = vessel + heat / (4.0 * np.pi * 5.0) * (1.0 - 1.0 / 2.0)
    hot, cold = (gap.slave, gap.master) if slave == "core" else (gap.master, gap.slave)
    assert (core, vessel) == pytest.approx((2232.13, 565.47), abs=0.01)
    across = np.average(hot - cold, weights=gap.heat / gap.flux)
    assert across == pytest.approx(core - vessel, rel=1e-6)
    assert hot == pytest.approx(core, rel=2e-3)
    assert cold == pytest.approx(vessel, rel=8e-3)  # of MOOSE's in space, too
    assert abs(gap.total) == pytest.approx(heat, rel=1e-9)
