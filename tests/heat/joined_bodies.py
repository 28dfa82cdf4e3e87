"""Two bodies with a joint, by variables: numbers, laws and shape."""

from __future__ import annotations

import numpy as np

from fenics_contact import RigidPlane, Surface, Tie, Ufl
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    EvenConductance,
    FrictionHeat,
    GapRadiation,
    HeatFlux,
    HeatScene,
    HeatSource,
    HeldTemperature,
    Radiation,
    TemperatureTable,
    ThermalContact,
)
from fenics_contact.heat.friction import NO_FRICTION_HEAT
from fenics_contact.mesh import quadratic, refined
from fenics_contact.mesh.body_mesh import BodyMesh

#: Conductance, power, film, conductivity, temperature that is held, and how far nodes move.
START = np.array([1.3, 200.0, 0.7, 4.0, 320.0, 0.05])
NAMES = ("conductance", "power", "film", "conductivity", "held", "shape")


def moved(mesh: BodyMesh, far: float, along: float) -> BodyMesh:
    """Move all nodes, of sides in and out, of the joint to its curved image and, by `along`, along it."""
    points, (across, up) = mesh.points.copy(), mesh.points[:, [0, -1]].T
    across = across + along * far * across * (1.0 - across)
    points[:, 0] = across + far * across * (1.0 + up) + 0.1 * far * (1.0 + np.sin(3.0 * up))
    points[:, -1] += 0.3 * far * np.sin(2.0 * across)
    return mesh.moved(points)


def meshes(dim: int, kind: str) -> tuple[BodyMesh, BodyMesh]:
    make, zeros, ones = (rectangle, block)[dim - 2], (0.0,) * (dim - 1), (1.0,) * (dim - 1)
    lower = make((*zeros, 0.0), (*ones, 1.0), (3,) * dim)
    upper = make((*zeros, 1.0), (*ones, 2.0), (2,) * dim)
    if kind == "hanging":
        return refined(lower, np.arange(lower.n_cells) == lower.n_cells - 1).mesh, upper
    return quadratic(lower), quadratic(upper)


def scene(
    p: np.ndarray, dim: int = 2, kind: str = "quadratic", joint: str = "film", **given: bool
) -> HeatScene:
    """Return two bodies with a joint, `laws`: that depend on temperatures, `revolved`: around an axis."""
    (h, power, film, k, held, far), up = p, "yz"[dim - 2]
    lower, upper = (moved(mesh, far, own) for mesh, own in zip(meshes(dim, kind), (0.0, 2.0), strict=True))
    laws, revolved = given.get("laws", False), given.get("revolved", False)
    below = TemperatureTable((0.0, 1000.0), (2.0, 3.0)) if laws else 2.0
    above = Ufl(lambda x, T: k * (1.0 + x[0]) + 1e-5 * T * T) if laws else k
    slave, master = Surface("upper", f"{up}0"), Surface("lower", f"{up}1")
    loads = [
        HeatFlux("upper", "x1", lambda x: power * (1.0 + x[:, -1])),
        Convection("lower", "x1", film, 300.0),
        HeatSource("upper", power),
    ]
    if laws:
        films = TemperatureTable((200.0, 900.0), (film, 3.0 * film))
        loads += [Radiation("upper", "x1", 0.9, ambient=300.0), Convection("lower", "x0", films, 250.0)]
    law = EvenConductance(h) + GapRadiation(0.8, 0.7) if laws else h
    falling = TemperatureTable((200.0, 900.0), (0.5, 0.1))
    rubbing = FrictionHeat(falling, speed=20.0, share=0.3) if laws else NO_FRICTION_HEAT
    floor = RigidPlane((0.0,) * dim, (*(0.0,) * (dim - 1), 1.0))
    how = "mortar" if joint == "film" else "node"
    contacts = {
        "tie": [],
        "obstacle": [ThermalContact(Surface("lower", f"{up}0"), floor, h, temperature=held)],
    }.get(joint, [ThermalContact(slave, master, law, pressure=3.0, friction=rubbing, discretisation=how)])
    return HeatScene(
        {
            "lower": ConductingBody(
                lower, Conductor(below), revolved, 1.5 if dim == 2 and not revolved else 1.0
            ),
            "upper": ConductingBody(
                upper, Conductor(above), revolved, 1.5 if dim == 2 and not revolved else 1.0
            ),
        },
        [] if joint == "obstacle" else [HeldTemperature("lower", f"{up}0", lambda x: held + 10.0 * x[:, 0])],
        loads,
        contacts,
        [Tie(slave, master, discretisation="mortar")] if joint in ("tie", "obstacle") else [],
    )
