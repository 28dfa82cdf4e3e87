"""A block of two materials that is heated and drawn by a force that varies in space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    Pressure,
    Scene,
    Surface,
    ThermalStrain,
    TotalForce,
    Tresca,
    Ufl,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, OrthotropicElasticity
from tests.scenes import FLOOR, crowned

WOOD = OrthotropicElasticity(
    (90.0, 60.0, 80.0), (0.2, 0.3, 0.25), (30.0, 35.0, 25.0), thermal_expansion=(1e-3, 2e-3, 0.0)
)


def two_materials() -> Scene:
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3)), 0.02)
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.7
    mesh = replace(mesh, regions={"left": np.flatnonzero(left), "right": np.flatnonzero(~left)})
    materials = {"left": IsotropicElasticity(120.0, 0.3, 1e-3), "right": WOOD}
    return Scene(
        {"block": Body(mesh, materials)},
        loads=[
            Pressure("block", "z1", lambda points: 2.0 + 0.2 * points[:, 0]),
            TotalForce("block", "z1", (0.02, 0.0, -0.1), moment=(0.01, 0.02, 0.05), at=(0.9, 0.6, 1.5)),
            BodyForce("block", Ufl(lambda x: [0.3 * x[2], 0.1, -0.2 * x[0]])),
            ThermalStrain("block", 5.0),
            ThermalStrain("block", Ufl(lambda x: 3.0 * x[2] * x[0])),
        ],
        contacts=[ContactPair(Surface("block", "z0"), FLOOR, Tresca(0.6))],
    )
