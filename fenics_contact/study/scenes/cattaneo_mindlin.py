"""Cattaneo and Mindlin: two equal cylinders pressed, then sheared until the edges of the contact slip.

The bodies are mirror images of the same material: their surfaces deform symmetrically under pressure and
shear, so that pressing causes no friction and shearing changes no pressure, also in bodies other than half
planes and on mirrored meshes. The finite size of the bodies, 30 times the contact, only adds a curvature of
the surfaces over the contact, (1/30)², of about a thousandth. Far edges are displaced, not loaded. The
displacement depends on the size of the bodies, as a line load shifts a half plane without bound; tractions do
not, so theory uses the measured forces P and Q:

    a² = 2 P R / (π E*),  p0 = 2 P / (π a),  c = a √(1 − Q / (μ P)),
    q(x) = μ p0 [√(1 − x²/a²) − c/a √(1 − x²/c²)].

The radius is a thousand times the contact, as pressure acts along one direction in theory and along the
normals in the computation. Both a and c coincide with nodes of all meshes to within a thousandth, so that
errors fall at clean rates.

References:
    K. L. Johnson, Contact Mechanics, Cambridge 1985, section 7.2. M. L. Williams, Stress singularities
    resulting from various boundary conditions in angular corners of plates in extension, J. Appl. Mech. 19
    (1952).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._scene.body import Body
from fenics_contact._scene.pairs import ContactPair, Coulomb, Surface
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene.supports import Support
from fenics_contact.materials.elastic import PlaneStrain
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.mesh.quadratic import quadratic
from fenics_contact.results.contact import Status
from fenics_contact.results.state import State
from fenics_contact.study.scenes.nested_box import mirrored, nested_half
from fenics_contact.study.study import BALANCED, Outcome, Parameters, Problem, Quantity, StudyScene, Sweep

YOUNG = 1000.0
POISSON = 0.3
FRICTION = 0.4
RADIUS = 2000.0
SIZE = 30.0
#: Half the width of the region of equal cells; the half contact is 1.
CORE = 1.25
PRESS = 0.00205
SHEAR = 0.000735
#: Displacements vary as r^0.711 at the corners between free and held edges, with ν = 0.3 in plane strain:
#: sin²(λπ/2) = (4 (1 − ν)² − λ²) / (3 − 4ν) [Williams 1952].
CORNER = 0.711


def half(side: float, n: int, cell: str = "quadrilateral") -> BodyMesh:
    """Mesh the upper body (side 1) or its mirror image (side −1), n cells on the half contact."""
    curved = CELL_TYPES[cell].order == 2
    mesh = nested_half(CORE, SIZE, round(CORE * n), "quadrilateral" if curved else cell)
    mesh = mesh if side > 0 else mirrored(mesh)
    mesh = quadratic(mesh) if curved else mesh
    x, y = mesh.points.T
    return mesh.moved(np.column_stack([x, y + side * x**2 / (2 * RADIUS) * (1 - np.abs(y) / SIZE)]))


def build(parameters: Parameters, comm: MPI.Comm | None = None) -> Problem:
    """Return the bodies and the two steps: pressed, sheared."""
    del comm  # every rank builds the same mesh
    material = PlaneStrain(YOUNG, POISSON)
    bodies = {
        name: Body(half(side, parameters.size, parameters.cell), material)
        for name, side in (("upper", 1.0), ("lower", -1.0))
    }
    pair = ContactPair(
        Surface("upper", "y0"), Surface("lower", "y1"), Coulomb(FRICTION), parameters.discretisation
    )
    base = Support("lower", "y0", (0.0, 0.0))
    steps = [
        LoadStep(f"{shift:g}", supports=[base, Support("upper", "y1", (shift, -PRESS))])
        for shift in (0.0, SHEAR)
    ]
    return Problem(Scene(bodies, contacts=[pair]), steps)


@dataclass(frozen=True)
class Theory:
    """Theoretical a, c (stick) and p0 (peak) for the measured forces P and Q of a state."""

    half_width: float
    stick: float
    peak: float

    def traction(self, x: np.ndarray) -> np.ndarray:
        """Return q(x), shape (n,), [force / length²]."""
        a, c = self.half_width, self.stick
        return np.asarray(FRICTION * self.peak * (ellipse(x, a) - c / a * ellipse(x, c)))


def theory(state: State) -> Theory:
    """Return Cattaneo's and Mindlin's solution for the forces of a state."""
    contact = state.contact
    force, shear = contact.normal_force.sum(), np.abs(contact.friction_force.sum())
    a = np.sqrt(2 * force * RADIUS / np.pi * 2 * (1 - POISSON**2) / YOUNG)
    c = a * np.sqrt(max(0.0, 1 - shear / (FRICTION * force)))
    return Theory(float(a), float(c), float(2 * force / (np.pi * a)))


def ellipse(x: np.ndarray, a: float) -> np.ndarray:
    """Return √(1 − x²/a²), zero outside."""
    return np.sqrt(np.maximum(0.0, 1 - (x / a) ** 2))


def tractions(outcome: Outcome) -> tuple[np.ndarray, np.ndarray]:
    """Return x and |q| of every contact point."""
    contact = outcome.state.contact
    return outcome.slave_points()[:, 0], np.abs(contact.friction_force[:, 0]) / contact.points.area


def stick_half_width(outcome: Outcome) -> float:
    """Fit c: where it sticks (μp − q)² = (μ p0 / a)² (c² − x²), a line over x² that ends at c²."""
    contact, (x, traction) = outcome.state.contact, tractions(outcome)
    sticks = contact.status == Status.STICK
    if np.count_nonzero(sticks) < 2:
        return 0.0
    reserve = FRICTION * contact.pressure - traction
    slope, start = np.polyfit(x[sticks] ** 2, reserve[sticks] ** 2, 1)
    return float(np.sqrt(max(0.0, -start / slope)))


def weighted_traction(outcome: Outcome) -> np.ndarray:
    """Return q times the root of the nodal area: its Euclidean norm is that of q in L²."""
    return np.asarray(tractions(outcome)[1] * np.sqrt(outcome.state.contact.points.area))


def exact_traction(outcome: Outcome) -> np.ndarray:
    """Return the exact `weighted_traction`."""
    exact = theory(outcome.state).traction(outcome.slave_points()[:, 0])
    return np.asarray(exact * np.sqrt(outcome.state.contact.points.area))


def middle_pressure(outcome: Outcome) -> float:
    """Return the pressure at x = 0."""
    return float(outcome.state.contact.pressure[np.argmin(np.abs(outcome.slave_points()[:, 0]))])


def friction_force(outcome: Outcome) -> float:
    """Return Q, the sum of all friction forces."""
    return float(abs(outcome.state.contact.friction_force.sum()))


BASE = Parameters(16, cell="quadrilateral", discretisation="node")
SWEEP = Sweep(
    BASE,
    sizes=(4, 8, 16, 32),
    tolerances=(1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, BALANCED),
    cells=("triangle", "quadrilateral9"),
    discretisations=("mortar",),
    fixed_points=(1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8),
    subdomains=(2, 4, 8, 16, 32),
)
QUICK = replace(
    SWEEP, base=replace(BASE, size=8), sizes=(4, 8, 16), tolerances=(1e-2, 1e-8, BALANCED),
    fixed_points=(1e-2, 1e-6), subdomains=(4,),
)  # fmt: skip

study = StudyScene(
    name="cattaneo_mindlin",
    title="Cattaneo and Mindlin, sheared cylinders",
    build=build,
    quantities=(
        Quantity(
            "stick half width", "mm", stick_half_width, lambda outcome: theory(outcome.state).stick, rate=1.0
        ),
        Quantity("peak pressure", "MPa", middle_pressure, lambda outcome: theory(outcome.state).peak),
        Quantity("tangential traction", "MPa √mm", weighted_traction, exact_traction, rate=1.0),
        Quantity("total friction force", "N/mm", friction_force, rate=2 * CORNER),
        Quantity(
            "potential energy", "N", lambda outcome: outcome.state.energies.total_potential, rate=2 * CORNER
        ),
    ),
    sweep=SWEEP,
    quick=QUICK,
    size_name="cells on the half contact",
    spacing_unit="half width of the contact",
    energy_rate=CORNER,
    about=(
        "Two mirrored bodies in plane strain are pressed together, then sheared, with Coulomb friction. "
        "Theory uses the measured forces; tangential traction is compared in L². Friction force and energy "
        "at the given displacements depend on the size of the bodies and are extrapolated."
    ),
)
