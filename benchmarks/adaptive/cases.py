"""Scenes on coarse meshes that know nothing of their contacts, each with quantities to be found."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    RigidSurface,
    Scene,
    Support,
    Surface,
    TotalForce,
    Traction,
    gallery,
    read_cad,
    readers,
    theory,
)
from fenics_contact.design import Movement, Objective, PeakPressure, TotalPotential
from fenics_contact.materials import IsotropicElasticity, PlaneStrain

E, NU = 2.1e5, 0.3  # N/mm²


@dataclass(frozen=True)
class Case:
    """A scene and its quantities.

    Attributes:
        title: Name of its panels in the figure.
        scene: Makes the scene.
        quantities: Name -> objective.
        accuracy: Relative error that is asked for.
        most: Most unknowns of an adaptive mesh.
        finest: Those of the mesh for the reference.
        largest: Those of a uniform mesh.
        exact: Quantity -> its value by theory; others are found on the finest mesh.
    """

    title: str
    scene: Callable[[], Scene]
    quantities: Mapping[str, Objective]
    accuracy: float
    most: int
    finest: int
    largest: int
    exact: Mapping[str, float] = field(default_factory=dict)


def ball() -> Scene:
    """A quarter of a ball on a block, both from a STEP file, tetrahedra of 4 mm; the contact has 0.34 mm."""
    radius, force = 10.0, 600.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ball.step"
        with readers.gmsh_model("ball") as gmsh:
            cad = gmsh.model.occ
            sphere, box = cad.addSphere(0, 0, radius, radius), cad.addBox(0, 0, 0, radius, radius, radius)
            cad.intersect([(3, sphere)], [(3, box)])
            cad.addBox(0, 0, -radius, radius, radius, radius)
            cad.synchronize()
            gmsh.write(str(path))
        meshes = dict(zip(("ball", "block"), read_cad(path, 4.0).values(), strict=True))
    steel = IsotropicElasticity(E, NU)
    sides = {name: _planes(mesh) for name, mesh in meshes.items()}
    supports = [
        Support(name, side, held)
        for name in meshes
        for side, held in ((sides[name]["x0"], (0.0, None, None)), (sides[name]["y0"], (None, 0.0, None)))
    ]
    (sphere,) = set(meshes["ball"].surfaces) - set(sides["ball"].values())
    return Scene(
        bodies={name: Body(mesh, steel) for name, mesh in meshes.items()},
        supports=[*supports, Support("block", sides["block"]["z0"], (None, None, 0.0))],
        loads=[TotalForce("ball", sides["ball"]["z1"], (0.0, 0.0, -force / 4))],
        contacts=[ContactPair(Surface("ball", sphere), Surface("block", sides["block"]["z1"]))],
    )


def _planes(mesh: BodyMesh) -> dict[str, str]:
    """Return side of the body's box -> name of the surface that lies in it."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    found = {}
    for name, facets in mesh.surfaces.items():
        points = mesh.points[np.unique(facets)]
        for axis, letter in enumerate("xyz"):
            for end, place in enumerate((low, high)):
                if np.allclose(points[:, axis], place[axis], atol=1e-6):
                    found[f"{letter}{end}"] = name
    return found


def discs() -> Scene:
    """Two halves of discs, pressed and sheared by their flat sides; cells of about a millimetre.

    Bodies that mirror each other do not slip when they are pressed, so that one step has the tractions of
    Cattaneo and Mindlin.
    """
    upper = gallery.half_disc(10.0, 6, symmetry="", grading=0.0)
    lower = upper.placed(np.diag([-1.0, -1.0]), np.zeros(2))
    steel = PlaneStrain(E, NU)
    return Scene(
        bodies={"upper": Body(upper, steel), "lower": Body(lower, steel)},
        supports=[Support("upper", "top", (0.004, -0.02)), Support("lower", "top", (0.0, 0.0))],
        contacts=[ContactPair(Surface("upper", "contact"), Surface("lower", "contact"), Coulomb(0.4))],
    )


def punch() -> Scene:
    """Half of a flat rigid punch on a block: pressures grow as 1/√distance towards its edge."""
    stamp = gallery.rectangle((0.0, 0.0), (2.0, 2.0), (2, 2), cell="triangle")
    base = gallery.rectangle((0.0, -6.0), (6.0, 0.0), (6, 6), cell="triangle")
    return Scene(
        bodies={"punch": Body(stamp, PlaneStrain(1e4 * E, NU)), "base": Body(base, PlaneStrain(E, NU))},
        supports=[
            Support("punch", "x0", (0.0, None)),
            Support("base", "x0", (0.0, None)),
            Support("base", "y0", (0.0, 0.0)),
        ],
        loads=[Traction("punch", "y1", (0.0, -100.0))],
        contacts=[ContactPair(Surface("base", "y1"), Surface("punch", "y0"))],
    )


def bracket() -> Scene:
    """An L-shaped body on a floor, its arm pressed down: stress is singular at the re-entrant corner."""
    lattice = gallery.rectangle((0.0, 0.0), (2.0, 2.0), (4, 4), cell="triangle")
    kept = lattice.points[lattice.cells].mean(axis=1)
    cells = lattice.cells[(kept[:, 0] < 1.0) | (kept[:, 1] < 1.0)]
    nodes, local = np.unique(cells, return_inverse=True)
    points = lattice.points[nodes]
    renumbered = np.full(len(lattice.points), -1)
    renumbered[nodes] = np.arange(len(nodes))
    sides = {
        "floor": lattice.surfaces["y0"], "wall": lattice.surfaces["x0"], "end": lattice.surfaces["x1"],
        "top": lattice.surfaces["y1"],
    }  # fmt: skip
    surfaces = {name: renumbered[facets] for name, facets in sides.items()}
    surfaces = {name: facets[(facets >= 0).all(axis=1)] for name, facets in surfaces.items()}
    mesh = BodyMesh(points, local.reshape(-1, 3), surfaces)
    return Scene(
        bodies={"bracket": Body(mesh, PlaneStrain(E, NU))},
        supports=[Support("bracket", "end", (0.0, None))],
        loads=[Traction("bracket", "top", (100.0, -50.0))],
        contacts=[ContactPair(Surface("bracket", "floor"), RigidPlane((0.0, 0.0), (0.0, 1.0)))],
    )


def hub() -> Scene:
    """The clamp hub of the guide, clamped and not turned; quadratic tetrahedra."""
    bore, outer, slot, back, half, hollow = 10.0, 30.0, 26.0, 29.0, 6.0, 4.0
    land = np.radians(25.0)
    with tempfile.TemporaryDirectory() as folder:
        hub_path, shaft_path = Path(folder) / "hub.step", Path(folder) / "shaft.step"
        with readers.gmsh_model("hub") as gmsh:
            cad = gmsh.model.occ
            radii = outer, bore, bore + 1
            disc, hole, relief = ((3, cad.addCylinder(0, 0, 0, 0, 0, half, r)) for r in radii)
            side = bore * np.sin(land)
            corners = [
                (-slot, -1, slot + outer, 2), (-outer, -outer, outer - back, 2 * outer),
                (16, 16, outer, outer), (16, -16 - outer, outer, outer),
            ]  # fmt: skip
            boxes = [(3, cad.addBox(x, y, 0, length, width, half)) for x, y, length, width in corners]
            sides = [(3, cad.addBox(x, -outer, 0, outer, 2 * outer, half)) for x in (side, -side - outer)]
            relieved, _ = cad.intersect([relief], sides)
            cad.cut([disc], [hole, *relieved, *boxes])
            cad.synchronize()
            gmsh.write(str(hub_path))
        with readers.gmsh_model("shaft") as gmsh:
            cad = gmsh.model.occ
            solid, hole = ((3, cad.addCylinder(0, 0, 0, 0, 0, half, r)) for r in (bore, hollow))
            cad.cut([solid], [hole])
            cad.synchronize()
            gmsh.write(str(shaft_path))
        middle = readers.OnPlane((0, 0, 0), (0, 0, 1))
        faces: dict[str, Any] = {
            "middle": middle, "land": readers.OnCylinder(bore),
            "back": readers.OnPlane((-back, 0, 0), (1, 0, 0)),
            "head": readers.OnPlane((0, 16, 0), (0, 1, 0)), "nut": readers.OnPlane((0, -16, 0), (0, 1, 0)),
        }  # fmt: skip
        (clamp,) = read_cad(hub_path, 6.0, surfaces=faces, order=2).values()
        round_faces: dict[str, Any] = {
            "middle": middle,
            "seat": readers.OnCylinder(bore),
            "core": readers.OnCylinder(hollow),
        }
        (shaft,) = read_cad(shaft_path, 5.0, surfaces=round_faces, order=2).values()
    steel, bolt = IsotropicElasticity(E, NU), 5e3
    return Scene(
        bodies={"hub": Body(clamp, steel), "shaft": Body(shaft, steel)},
        supports=[
            Support("hub", "back"),
            Support("hub", "middle", (None, None, 0.0)),
            Support("shaft", "middle", (None, None, 0.0)),
            RigidSurface("shaft", "core", (0, 0, 0), (None, None, 0.0), (0.0, 0.0, 0.0)),
        ],
        loads=[
            TotalForce("hub", "head", (0, -bolt / 2, 0)),
            TotalForce("hub", "nut", (0, bolt / 2, 0)),
        ],
        contacts=[ContactPair(Surface("hub", "land"), Surface("shaft", "seat"), Coulomb(0.15))],
    )


HERTZ = theory.hertz_point(600.0, (0.1, 0.1), theory.contact_modulus(E, NU, E, NU))
CASES = {
    "ball": Case(
        "Ball on a block", ball, {"peak pressure": PeakPressure(), "potential": TotalPotential()},
        0.01, 130_000, 130_000, 300_000, {"peak pressure": HERTZ.peak_pressure},
    ),
    "discs": Case(
        "Sheared discs", discs, {"peak pressure": PeakPressure(), "potential": TotalPotential()},
        0.004, 20_000, 60_000, 700_000,
    ),
    "punch": Case("Flat punch", punch, {"potential": TotalPotential()}, 0.001, 20_000, 60_000, 100_000),
    "bracket": Case("L on a floor", bracket, {"potential": TotalPotential()}, 0.001, 40_000, 80_000, 100_000),
    "hub": Case(
        "Clamp hub", hub, {"closing of the jaw": Movement("hub", "head", (0.0, -1.0, 0.0))},
        0.005, 100_000, 210_000, 120_000,
    ),
}  # fmt: skip
