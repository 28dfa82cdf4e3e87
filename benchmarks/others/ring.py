"""A ring pressed between plates, SSNP501 and SSNP502: a quarter of it, with and without friction."""

from __future__ import annotations

from functools import partial
from time import process_time

import numpy as np
from mpi4py import MPI

from benchmarks.others.large import Path, rows_by_halving
from benchmarks.others.meshes import ring_part
from benchmarks.others.rows import Row
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    Scene,
    Support,
    Surface,
    solve_steps,
)
from fenics_contact.materials import HyperelasticPlaneStress, Material, NeoHooke, StVenantKirchhoff
from fenics_contact.mesh import quadratic
from fenics_contact.results.deformed_state import AnyState

#: Radii and the way of the plate towards the ring's centre in cm, constants in N/cm².
RADII, WAY = (4.15, 6.35), 2.225
SHEET = HyperelasticPlaneStress(StVenantKirchhoff(407.0, 0.48))
#: Experiment and paper, N for each half of a plate at each quarter of the way: multiples of the first.
MEASURED = (8.00833, 16.01666, 24.02499, 32.03333)
#: How far code_aster lets its values be from them, and its values at the end, by friction.
MARGINS = {0.0: (0.10, 0.05, 0.02, 0.03), 0.4: (0.11, 0.07, 0.04, 0.05)}
PRINTED = {0.0: (8.783, 16.801, 24.496, 32.8559610), 0.4: (8.860, 17.012, 24.884, 33.4798288)}


def ring(mesh: BodyMesh, friction: float, material: Material = SHEET) -> Scene:
    """The quarter with positive coordinates below a plate, which stays where it is."""
    law = Coulomb(friction) if friction else None
    plate = ContactPair(Surface("ring", "outer"), RigidPlane((0.0, RADII[1]), (0.0, -1.0)), law)
    return Scene({"ring": Body(mesh, material)}, held(0.0), contacts=[plate])


def held(way: float) -> list[Support]:
    """Return the supports of both cuts, the lower one moved towards the plate."""
    return [Support("ring", "above", (0.0, None)), Support("ring", "below", (None, way))]


def quarter(counts: tuple[int, int]) -> BodyMesh:
    """Mesh it with as many cells across and around."""
    return ring_part(RADII, (0.0, np.pi / 2), counts)


STEPS = [LoadStep(f"{k}/4", supports=held(k * WAY / 4)) for k in (1, 2, 3, 4)]


def force(state: AnyState) -> float:
    """Return the force on the plate, along its way."""
    return float(abs(state.contact.force[:, 1].sum()))


def force_rows(friction: float, material: Material, *, quantity: str, others: bool) -> list[Row]:
    """Return the force at each quarter of the way, whose bar is what the last halving of cells changed."""

    def scene(fineness: int) -> Scene:
        return ring(quadratic(quarter((fineness, 4 * fineness))), friction, material)

    return rows_by_halving(
        Path(scene, STEPS, force, 8),
        {
            f"{quantity}, μ {friction:g}, {k + 1}/4 of the way [N/cm]": (
                MEASURED[k], "experiment and paper", MARGINS[friction][k],
                f"code_aster {PRINTED[friction][k]:.3f}" if others else "",
            )
            for k in range(4)
        },
    )  # fmt: skip


def printed_row(friction: float) -> Row:
    """Return what code_aster prints at the end, on its mesh: forces of all outer nodes, supported or not."""
    began, scene = process_time(), ring(quarter((6, 40)), friction)
    states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), STEPS)
    points = scene.bodies["ring"].mesh.points
    outside = np.isclose(points, (RADII[1], 0.0)).all(axis=1)
    support = states[-1].gather_internal_forces("ring")[outside, 1].sum()
    value = force(states[-1]) + abs(float(support))
    return Row(
        f"code_aster's sum on its mesh, with the support's node, μ {friction:g} [N/cm]", value, 1e-7 * value,
        PRINTED[friction][3], "code_aster", unknowns=2 * len(points),
        products=sum(state.solution.iterations for state in states), seconds=process_time() - began,
        levels=((force(states[-1]), 0),),
    )  # fmt: skip


def ring_rows() -> list[Row]:
    """The ring as code_aster has it, its sums of forces, and the ring in plane strain of neo-Hooke's law."""
    as_posed = partial(force_rows, material=SHEET, quantity="force on half a plate", others=True)
    strained = force_rows(0.0, NeoHooke(407.0, 0.48), quantity="in plane strain, neo-Hooke", others=False)
    return [*as_posed(0.0), *as_posed(0.4), printed_row(0.0), printed_row(0.4), *strained]
