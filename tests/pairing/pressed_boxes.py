"""Boxes of quadratic cells that are pressed on each other evenly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import Body, BodyMesh, ContactPair, Pressure, Scene, Support, Surface
from fenics_contact._scene.pairs import AnyDiscretisation
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic

PRESSURE = 100.0


def boxes(cell: str, above: int, below: int, wide: float = 1.0, order: int = 2) -> dict[str, BodyMesh]:
    """A cube on a box, or squares in the plane, with so many cells along their edges of length one."""
    if cell in ("quadrilateral", "triangle"):
        a = rectangle((0.0, 1.0), (1.0, 2.0), (above, above), cell)
        b = rectangle((0.0, 0.0), (wide, 1.0), (round(wide * below), below), cell)
    else:
        a = block((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (above,) * 3, cell)
        b = block((0.0, 0.0, 0.0), (wide, 1.0, 1.0), (round(wide * below), below, below), cell)
    return {"a": quadratic(a), "b": quadratic(b)} if order == 2 else {"a": a, "b": b}


def pressed(meshes: dict[str, BodyMesh], slave: str = "a", stiff: float = 1.0) -> Scene:
    """Press a on b evenly, without lateral strain; a is stiffer by a factor."""
    dim = meshes["a"].dim
    material = PlaneStrain if dim == 2 else IsotropicElasticity
    low, high = ("y0", "y1") if dim == 2 else ("z0", "z1")
    bodies = {
        "a": Body(meshes["a"], material(stiff * 1e3, 0.0)),
        "b": Body(meshes["b"], material(1e3, 0.0)),
    }
    rollers = dict(zip(("x0", "y0", "z0"), np.where(np.eye(3, dtype=bool), 0.0, None)[:, :dim], strict=True))
    held = [(body, side) for body in "ab" for side in ("x0", "y0")[: dim - 1]]
    supports = [Support(body, side, tuple(rollers[side])) for body, side in [*held, ("b", low)]]
    sides = [Surface("a", low), Surface("b", high)]
    return Scene(
        bodies,
        supports,
        [Pressure("a", high, PRESSURE)],
        [ContactPair(*(sides if slave == "a" else sides[::-1]), discretisation="node")],
    )


def chosen(scene: Scene, discretisation: AnyDiscretisation = "best") -> Scene:
    """The scene by nodes with another discretisation."""
    return replace(scene, contacts=[replace(pair, discretisation=discretisation) for pair in scene.contacts])


def unevenly() -> Scene:
    """A square on a wider one, which is the slave."""
    return chosen(pressed(boxes("triangle", 3, 4, wide=1.6), "b"), "mortar")
