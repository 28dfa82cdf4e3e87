"""Rubber blocks whose lower side is a design, pressed far."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    RigidSphere,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    box_partition,
)
from fenics_contact.design import (
    ContactArea,
    LargestPressure,
    Objective,
    PressureNonuniformity,
    PressureNorm,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import NeoHooke
from tests.design.quotients import Remembering
from tests.scenes import RigidObstacle

#: True pressures and areas, in every way that an objective has them.
PRESSURES = PressureNorm() + 0.3 * LargestPressure() + 0.2 * ContactArea() + 0.5 * PressureNonuniformity()
RUBBER, HARDER = NeoHooke(1.0, 0.3), NeoHooke(2.0, 0.3)


def crowned(mesh: BodyMesh) -> BodyMesh:
    """A block of height 1 whose lower side hangs in its middle."""
    sides, up = mesh.points[:, :-1], mesh.points[:, -1]
    height = up + 0.05 * ((sides - 1.0) ** 2).sum(axis=1) * (1.0 - up)
    return mesh.moved(np.column_stack([sides, height]))


def pressed(master: str, friction: float, pushed: float, dim: int = 2) -> Scene:
    """A block pressed by 15 % of its height on a plane, a disc or another block, and pushed along it."""
    flat = (0.0,) * (dim - 1)
    cells = (10, 5) if dim == 2 else (5, 4, 3)
    whole = rectangle((0, 0), (2, 1), cells) if dim == 2 else block((0, 0, 0), (2, 2, 1), cells)
    law = Coulomb(friction) if friction else None
    low, high = ("y0", "y1") if dim == 2 else ("z0", "z1")
    bodies = {"block": Body(crowned(whole), RUBBER)}
    supports = [Support("block", high, (pushed, *flat[1:], -0.15))]
    if master == "block":
        wide = (13, 4) if dim == 2 else (6, 5, 2)
        lower = (
            rectangle((-0.5, -1), (2.6, 0), wide)
            if dim == 2
            else block((-0.5, -0.4, -1), (2.6, 2.5, 0), wide)
        )
        bodies["lower"] = Body(lower, HARDER)
        pair = ContactPair(Surface("block", low), Surface("lower", high), law, "node")
        supports.append(Support("lower", low))
    else:
        up = (*flat, 1.0)
        below = (1.1, *(1.0,) * (dim - 2), -2.0)
        obstacle: RigidObstacle = (
            RigidPlane((*flat, 0.0), up) if master == "plane" else RigidSphere(below, 2.0)
        )
        pair = ContactPair(Surface("block", low), obstacle, law)
    return Scene(bodies, supports, contacts=[pair])


def design_problem(
    scene: Scene,
    objective: Objective,
    *,
    tolerance: float | None = None,
    comm: MPI.Comm = MPI.COMM_SELF,
    steps: AutomaticSteps | None = None,
    designs: tuple[SurfaceDesign, ...] = (),
) -> Remembering:
    """The design of the block's lower side, or others, with the block cut in pieces."""
    low, net = ("y0", (4,)) if scene.dim == 2 else ("z0", (3, 3))
    pieces = {name: box_partition(body.mesh, (2,) * scene.dim) for name, body in scene.bodies.items()}
    contact = ContactProblem(scene, comm, partitions=pieces, tolerance=tolerance, steps=steps)
    return Remembering(contact, designs or SurfaceDesign("block", low, net=net), objective)


STEP = 3e-5


def line(problem: ShapeProblem) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(1)
    return 0.01 * random.standard_normal(problem.size), random.uniform(-1.0, 1.0, problem.size)


def miss(problem: ShapeProblem, exact: ShapeProblem, objective: Objective | None = None) -> float:
    """Relative difference of the derivative by the adjoint from the difference quotient."""
    if objective is not None:
        problem.objective = exact.objective = objective
    alpha, along = line(problem)
    by_adjoint = problem.evaluate(alpha).gradient @ along
    quotient = (exact.value_of(alpha + STEP * along) - exact.value_of(alpha - STEP * along)) / (2 * STEP)
    return float(abs(by_adjoint - quotient) / abs(quotient))
