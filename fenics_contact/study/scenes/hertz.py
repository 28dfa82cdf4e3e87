"""Hertz: two round bodies pressed together without friction, on meshes that do not match.

Both are quarters of blocks, 40 contact radii large, with a spherical face of a radius a thousand times that
of the contact. They are of the same material and guided along their sides. The force is chosen for a contact
radius of 1, a node of every mesh:

    p0 = 3 F / (2 π a²),   a³ = 3 F R* / (4 E*),   R* = R / 2,   E* = E / (2 (1 − ν²)).

The cells of the upper body, the slave, are 4/5 as large as those of the lower one. Both bodies have the same
number of cells along their cores of equal cells, so that meshes are similar.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._scene.body import Body
from fenics_contact._scene.loads import TotalForce
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.supports import Support
from fenics_contact.materials.elastic import IsotropicElasticity
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.study.scenes.nested_box import mirrored, nested_box
from fenics_contact.study.study import BALANCED, Outcome, Parameters, Problem, Quantity, StudyScene, Sweep

YOUNG = 1000.0
POISSON = 0.3
RADIUS = 1000.0
SIZE = 40.0
CONTACT_MODULUS = YOUNG / (2 * (1 - POISSON**2))
FORCE = 4 * CONTACT_MODULUS / (3 * (RADIUS / 2))
PEAK = 3 * FORCE / (2 * np.pi)
#: Cells of the master relative to those of the slave.
COARSER = 1.25


def round_block(side: float, core: float, size: int, cell: str) -> BodyMesh:
    """Mesh the upper block (side 1) or the lower one (side −1), with ``size`` equal cells on ``core``."""
    mesh = nested_box(core, SIZE, size, cell)
    mesh = mesh if side > 0 else mirrored(mesh)
    x, y, z = mesh.points.T
    lift = side * (x**2 + y**2) / (2 * RADIUS) * (1 - np.abs(z) / SIZE)
    return mesh.moved(np.column_stack([x, y, z + lift]))


def build(parameters: Parameters, comm: MPI.Comm) -> Problem:
    """Return the scene of a run."""
    del comm  # every rank builds the same mesh
    size, cell = parameters.size, parameters.cell
    material = IsotropicElasticity(YOUNG, POISSON)
    meshes = {"upper": round_block(1.0, 1.0, size, cell), "lower": round_block(-1.0, COARSER, size, cell)}
    guides: dict[str, tuple[float | None, ...]] = {side: (0.0, None, None) for side in ("x0", "x1")}
    guides |= {side: (None, 0.0, None) for side in ("y0", "y1")}
    supports = [Support(body, side, value) for body in meshes for side, value in guides.items()]
    pair = ContactPair(
        Surface("upper", "z0"), Surface("lower", "z1"), discretisation=parameters.discretisation
    )
    scene = Scene(
        bodies={name: Body(mesh, material) for name, mesh in meshes.items()},
        supports=[*supports, Support("lower", "z0", (None, None, 0.0))],
        loads=[TotalForce("upper", "z1", (0.0, 0.0, -FORCE / 4))],
        contacts=[pair],
    )
    return Problem(scene)


def peak_pressure(outcome: Outcome) -> float:
    """Return the pressure at the first point of contact."""
    distance = np.linalg.norm(outcome.slave_points()[:, :2], axis=1)
    return float(outcome.state.contact.pressure[np.argmin(distance)])


def contact_radius(outcome: Outcome) -> float:
    """Return the radius from the second moment of the forces, Σ λ r² = 2/5 a² Σ λ."""
    force = outcome.state.contact.normal_force
    square = (outcome.slave_points()[:, :2] ** 2).sum(axis=1)
    return float(np.sqrt(2.5 * (force @ square) / force.sum()))


def potential(outcome: Outcome) -> float:
    """Return the total potential energy."""
    return outcome.state.energies.total_potential


BASE = Parameters(4, discretisation="mortar")
SWEEP = Sweep(
    BASE,
    sizes=(2, 3, 4, 6, 8),
    tolerances=(1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, BALANCED),
    cells=("tetrahedron",),
    discretisations=("node",),
    subdomains=(2, 4, 8, 16, 32),
)
QUICK = replace(
    SWEEP, base=replace(BASE, size=3), sizes=(2, 3, 4), tolerances=(1e-2, 1e-8, BALANCED), subdomains=(4,)
)

study = StudyScene(
    name="hertz",
    title="Hertz, two round bodies",
    build=build,
    quantities=(
        Quantity("peak pressure", "MPa", peak_pressure, PEAK),
        Quantity("contact radius", "mm", contact_radius, 1.0, rate=2.0),
        Quantity("potential energy", "N mm", potential, rate=2.0),
    ),
    sweep=SWEEP,
    quick=QUICK,
    size_name="cells on the contact radius",
    spacing_unit="contact radius",
    about=(
        "Two quarters of round blocks are pressed together without friction, on meshes that do not match. "
        "Peak pressure and contact radius are known; the energy depends on the size of the blocks and is "
        "extrapolated."
    ),
)
