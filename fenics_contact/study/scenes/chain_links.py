"""Two links of a chain, the published experiment: link 1 is held, link 2 is pulled.

There is no exact solution; values on meshes of up to 1.6 million unknowns replace it. All meshes use contact
between the smooth crowns.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._scene.body import Body
from fenics_contact._scene.loads import TotalForce
from fenics_contact._scene.pairs import ContactPair, Coulomb, Surface
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.supports import Support
from fenics_contact.design.design import SurfaceDesign
from fenics_contact.gallery.links import TwoLinks, two_links
from fenics_contact.gallery.ring import LinkShape
from fenics_contact.materials.elastic import IsotropicElasticity
from fenics_contact.study.study import BALANCED, Outcome, Parameters, Problem, Quantity, StudyScene, Sweep

FRICTION = 0.3
PULL = 80e3
#: Cells around, through and across a link for each unit of `Parameters.size`; 4 is the published mesh.
CELLS = (12, 2, 5)
#: As in the demo: ten cells of the published mesh lie across the contact.
GRADING = 2.5
#: Energy [N mm] and peak pressure [MPa] to 0.2 %, and their source: the table of
#: `docs/studies/true_surfaces.md`, which also has Hertz's 4384 MPa.
ENERGY, PEAK, FINER = -20260.0, 4350.0, "meshes of up to 1.6 million unknowns"
#: Displacements vary as √r where the held grip ends on the smooth surface of the link.
GRIP = 0.5


def graded_links(cells: tuple[int, int, int], cell: str = "hexahedron", grading: float = GRADING) -> TwoLinks:
    """Mesh the links as in the demo, given the numbers of cells around, through and across."""
    around, through, across = cells
    shape = LinkShape(n_around=around, n_a=through, n_b=across, grading=grading, cell=cell)
    return two_links(shape)


def chain(links: TwoLinks, friction_coefficient: float = FRICTION) -> Scene:
    """Return the published chain: link 1 is held, link 2 is pulled with 80 kN, by nodes, [N, mm]."""
    steel = IsotropicElasticity(2.1e5, 0.3)
    pair = ContactPair(
        slave=Surface("link 2", "contact"),
        master=Surface("link 1", "contact"),
        friction=Coulomb(friction_coefficient),
        discretisation="node",
    )
    return Scene(
        bodies={"link 1": Body(links.first.mesh, steel), "link 2": Body(links.second.mesh, steel)},
        supports=[Support("link 1", "grip")],
        loads=[TotalForce("link 2", "grip", (PULL, 0.0, 0.0))],
        contacts=[pair],
    )


def build(parameters: Parameters, comm: MPI.Comm) -> Problem:
    """Mesh the links and return the scene with its design."""
    around, through, across = (parameters.size * count for count in CELLS)
    links = graded_links((around, through, across), parameters.cell)
    scene = chain(links)
    pairs = [replace(pair, discretisation=parameters.discretisation) for pair in scene.contacts]
    return Problem(replace(scene, contacts=pairs), design=SurfaceDesign("link 1", links.first.crown))


def potential(outcome: Outcome) -> float:
    """Return the total potential energy, the objective of the demo."""
    return outcome.state.energies.total_potential


def peak_pressure(outcome: Outcome) -> float:
    """Return the largest nodal pressure."""
    return float(outcome.state.contact.pressure.max())


def friction_force(outcome: Outcome) -> float:
    """Return the sum of the magnitudes of all friction forces."""
    return float(np.linalg.norm(outcome.state.contact.friction_force, axis=1).sum())


def gradient(outcome: Outcome) -> np.ndarray:
    """Return the derivative of the objective by the control points."""
    return outcome.gradient


BASE = Parameters(4)
SWEEP = Sweep(
    BASE,
    sizes=(2, 3, 4, 5, 6),
    tolerances=(1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, BALANCED),
    cells=("tetrahedron",),
    discretisations=("mortar",),
    fixed_points=(1e-2, 1e-4, 1e-6),
    subdomains=(8, 16, 32, 64, 128),
)
QUICK = replace(
    SWEEP, base=replace(BASE, size=2), sizes=(2, 3, 4), tolerances=(1e-2, 1e-8, BALANCED), cells=(),
    discretisations=(), fixed_points=(1e-4,), subdomains=(8,),
)  # fmt: skip

study = StudyScene(
    name="chain_links",
    title="Two chain links under 80 kN",
    build=build,
    quantities=(
        Quantity("potential energy", "N mm", potential, ENERGY, FINER, rate=2 * GRIP),
        Quantity("peak pressure", "MPa", peak_pressure, PEAK, FINER),
        Quantity("total friction force", "N", friction_force),
        Quantity("gradient", "N", gradient, phases=("objective", "adjoint", "gradient")),
    ),
    sweep=SWEEP,
    quick=QUICK,
    size_name="cells through half the wire",
    spacing=lambda size: 16.0 / (CELLS[1] * size),
    spacing_unit="mm",
    energy_rate=GRIP,
    about=(
        "The chain of the published experiment: two links, Coulomb friction 0.3, 80 kN; size 4 has its "
        "number of cells, here graded towards the spot. Contact is measured between the tori of the crowns. "
        f"Energy and peak pressure are compared with {ENERGY:g} N mm and {PEAK:g} MPa, known to 0.2 % from "
        f"{FINER}; friction is extrapolated where it converges monotonically; the gradient of the energy by "
        "28 control points is compared with that on the finest mesh."
    ),
)
