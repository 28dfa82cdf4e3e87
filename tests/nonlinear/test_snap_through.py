"""A shallow arch snaps through: under a prescribed displacement it is followed past its largest load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact.contact import ContactProblem, DeformedState, solve_steps
from fenics_contact.gallery import rectangle
from fenics_contact.mesh import quadratic
from fenics_contact.scene import Body, LoadStep, NeoHooke, Scene, Support, TotalForce


def arch() -> Body:
    """Half of a clamped arch, its crown at x = 10 in a plane of symmetry."""
    mesh = quadratic(rectangle((0, 0), (10, 0.5), (8, 1)))
    x, y = mesh.points.T
    return Body(
        replace(mesh, points=np.column_stack([x, y + 1.5 * np.sin(np.pi * x / 20)])), NeoHooke(100.0, 0.3)
    )


def crown(sunk: float | None) -> list[Support]:
    return [Support("arch", "x0"), Support("arch", "x1", (0.0, None if sunk is None else -sunk))]


def test_a_prescribed_displacement_goes_through_the_snap() -> None:
    body = arch()
    problem = ContactProblem(Scene({"arch": body}, crown(0.0)), MPI.COMM_SELF)
    sunk = (0.3, 0.6, 1.0, 1.5, 2.0, 2.6, 3.2)
    states = solve_steps(problem, [LoadStep(f"{d}", supports=crown(d)) for d in sunk])
    force = np.array([-state.reactions()[1].force[1] for state in states])
    assert force[1] > force[0] > 0.0
    assert np.all(np.diff(force[1:5]) < 0.0), "the load falls while the arch sinks"
    assert force[-1] > 2.0 * force[1], "turned over it is stiff again"
    assert all(len(state.solution.history) <= 6 for state in states)
    # Under a load control a load beyond the largest one is met far away: the arch has snapped.
    pushed = [TotalForce("arch", "x1", (0.0, -1.05 * float(force[-1])))]
    loaded = ContactProblem(Scene({"arch": body}, crown(None)), MPI.COMM_SELF)
    (snapped,) = solve_steps(loaded, [LoadStep("push", loads=pushed)])
    assert isinstance(snapped, DeformedState)
    assert snapped.gather_displacement("arch")[:, 1].min() < -3.2
