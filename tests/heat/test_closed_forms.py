"""Steady heat through contacts against closed forms, and against numbers that others publish."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import RigidPlane, Surface, Tie
from fenics_contact.gallery import rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    GapConductance,
    HeatScene,
    HeatState,
    HeldTemperature,
    PressureConductance,
    Radiation,
    ThermalContact,
    harmonic_mean,
    solve_heat,
)


def blocks(contact: ThermalContact) -> HeatState:
    """Solve the two blocks of MOOSE's gap_heat_transfer_mortar, with meshes that do not match."""
    bodies = {
        "steel": ConductingBody(rectangle((0.0, 0.0), (1.0, 0.5), (8, 4)), Conductor(16.2)),
        "aluminium": ConductingBody(rectangle((1.0, 0.0), (2.0, 0.5), (5, 3)), Conductor(210.0)),
    }
    held = [HeldTemperature("steel", "x0", 800.0), HeldTemperature("aluminium", "x1", 250.0)]
    return solve_heat(HeatScene(bodies, held, contacts=[contact]), MPI.COMM_SELF)


def test_a_joint_conducts_by_its_pressure_and_hardness():
    # closed_gap_prescribed_pressure.i of MOOSE, with k_h p / H_h of harmonic means.
    law = PressureConductance(harmonic_mean(16.2, 210.0), harmonic_mean(129.0, 15.0))
    state = blocks(ThermalContact(Surface("steel", "x1"), Surface("aluminium", "x0"), law, pressure=100.0))
    (joint,) = state.contacts
    assert joint.flux == pytest.approx(7292.02, abs=0.005)
    assert joint.slave == pytest.approx(349.875, abs=5e-4)
    assert joint.master == pytest.approx(284.724, abs=5e-4)
    assert state.balance.error < 1e-12


@pytest.mark.parametrize("slave", ["inner", "outer"])
def test_a_gap_between_cylinders_knows_their_curvature(slave: str):
    # cyl3D.i of MOOSE in its section: 2 π h k ΔT / ln(r₂ / r₁) = 906.47 W.
    bodies = {
        "inner": ConductingBody(rectangle((0.0, 0.0), (1.0, 1.0), (4, 4)), Conductor(1e6), axisymmetric=True),
        "outer": ConductingBody(rectangle((2.0, 0.0), (3.0, 1.0), (4, 4)), Conductor(1e6), axisymmetric=True),
    }
    sides = {"inner": Surface("inner", "x1"), "outer": Surface("outer", "x0")}
    other = next(name for name in sides if name != slave)
    contact = ThermalContact(sides[slave], sides[other], GapConductance(1.0))
    held = [HeldTemperature("inner", "x0", 200.0), HeldTemperature("outer", "x1", 100.0)]
    (gap,) = solve_heat(HeatScene(bodies, held, contacts=[contact]), MPI.COMM_SELF).contacts
    assert abs(gap.total) == pytest.approx(2.0 * np.pi * 100.0 / np.log(2.0), rel=1e-5)
    assert abs(gap.total) == pytest.approx(906.47, abs=0.01)


def test_a_block_gives_heat_to_an_obstacle_of_known_temperature():
    # gapheattrans_c of Abaqus's Verification Manual, 1.7.1: 50 + 100/22 at the gap.
    body = ConductingBody(rectangle((0.0, 0.0), (1.0, 1.0), (1, 1)), Conductor(1.0))
    floor = ThermalContact(Surface("block", "y0"), RigidPlane((0, 0), (0, 1)), 10.0, temperature=50.0)
    scene = HeatScene({"block": body}, [HeldTemperature("block", "y1", 100.0)], contacts=[floor])
    state = solve_heat(scene, MPI.COMM_SELF)
    assert state.contacts[0].slave == pytest.approx(54.5455, abs=5e-5)
    assert state.contacts[0].flux == pytest.approx(45.4545, abs=5e-5)


def test_heat_goes_from_the_given_slave_though_the_master_has_the_corner():
    lower, upper = rectangle((0.0, 0.0), (4.0, 1.0), (16, 2)), rectangle((0.0, 0.0), (1.0, 1.0), (4, 2))
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    bodies = {
        "lower": ConductingBody(lower, Conductor(1.0)),
        "upper": ConductingBody(upper.reshaped(upper.points @ turn + (1.5, 1.2)), Conductor(1.0)),
    }
    held = [HeldTemperature("lower", "y0", 0.0), HeldTemperature("upper", "y1", 100.0)]
    sides = Surface("lower", "y1"), Surface("upper", "y0")
    totals = []
    for slave, master in (sides, sides[::-1]):
        scene = HeatScene(bodies, held, contacts=[ThermalContact(slave, master, 1.0)])
        (joint,) = solve_heat(scene, MPI.COMM_SELF).contacts
        assert np.isin(joint.nodes, bodies[slave.body].mesh.nodes_of(slave.name)).all()
        assert np.sign(joint.slave - joint.master) == pytest.approx(np.sign(joint.heat))
        totals.append(joint.total)
    assert totals[0] < 0.0 < totals[1]


@pytest.mark.parametrize("joint", ["contact", "tie"])
def test_heat_is_balanced_where_a_held_node_touches(joint: str):
    bodies = {
        "upper": ConductingBody(rectangle((0.0, 1.0), (1.0, 2.0), (4, 4)), Conductor(2.0)),
        "lower": ConductingBody(rectangle((0.0, 0.0), (1.0, 1.0), (3, 3)), Conductor(1.0)),
    }
    surfaces = Surface("upper", "y0"), Surface("lower", "y1")
    joints = {"contact": {"contacts": [ThermalContact(*surfaces, 5.0)]}, "tie": {"ties": [Tie(*surfaces)]}}
    held = [HeldTemperature("upper", "x0", 100.0), HeldTemperature("lower", "y0", 0.0)]
    state = solve_heat(HeatScene(bodies, held, **joints[joint]), MPI.COMM_SELF)
    assert state.balance.by_part["HeldTemperature lower y0"] < -10.0
    assert state.balance.error < 1e-11


def test_even_temperatures_settle_although_laws_depend_on_them():
    body = ConductingBody(rectangle((0.0, 0.0), (1.0, 1.0), (2, 2)), Conductor(2.0))
    around = Radiation("block", "y0", 0.5, 20.0, constant=1e-6)
    state = solve_heat(HeatScene({"block": body}, loads=[around]), MPI.COMM_SELF)
    assert state.values == pytest.approx(20.0)
