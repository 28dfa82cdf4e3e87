"""The plan of a scene of heat holds what is built for it."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import Surface, Tie
from fenics_contact.gallery import rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    HeatScene,
    HeldTemperature,
    TemperatureTable,
    ThermalContact,
    solve_heat,
)


def test_a_plan_counts_what_is_built() -> None:
    steel = Conductor(TemperatureTable((0.0, 100.0), (0.05, 0.04)))
    spans = {"a": (0.0, 1.0), "b": (1.0, 2.0), "c": (2.0, 3.0)}
    bodies = {
        name: ConductingBody(rectangle((x, 0), (y, 1), (4, 4)), steel) for name, (x, y) in spans.items()
    }
    scene = HeatScene(
        bodies,
        held=[HeldTemperature("a", "x0", 20.0)],
        loads=[Convection("c", "x1", 1e-3, 50.0)],
        contacts=[ThermalContact(Surface("b", "x0"), Surface("a", "x1"), 0.1, discretisation="node")],
        ties=[Tie(Surface("c", "x0"), Surface("b", "x1"), discretisation="node")],
    )
    assert scene.effects() == {
        "conducting body": 3, "held temperature": 1, "convection": 1, "thermal contact": 1, "tie": 1,
        "law that depends on the temperature": 3,
    }  # fmt: skip
    cut = {name: (np.arange(16) >= 8).astype(int) for name in bodies}
    plan = scene.plan(cut)
    torn = solve_heat(scene, MPI.COMM_SELF, partitions=cut).torn
    assert plan.subdomains == 6
    assert plan.unknowns == sum(each.size for each in torn.decomposition.meshes) == 90
    assert plan.multipliers == {"gluing": 15, "held": 5, "tied": 5, "passing heat": 5}
    assert sum(plan.multipliers.values()) == len(torn.numbering.owned)
    assert 5e6 < plan.memory < 5e7
    assert "conducting body (3); held temperature (1)" in str(plan)
    assert "joint 0         b x0 - a x1; flat on flat; node" in str(plan)
