"""Scenes and settings that are other ones on the last rank."""

from __future__ import annotations

from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, Scene, Support, Surface, Traction
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton
from tests.ranks.given import (
    CUT,
    FLOOR,
    MESH,
    STEEL,
    case,
    is_last,
    scene,
    solve,
)


@case
def load_differs(comm: MPI.Comm) -> None:
    solve(comm, scene(loads=[Traction("block", "z1", (0.0, 0.0, -1.0 - is_last(comm)))]))


@case
def friction_differs(comm: MPI.Comm) -> None:
    law = Coulomb(0.3 + 0.1 * is_last(comm))
    solve(comm, scene(contacts=[ContactPair(Surface("block", "z0"), FLOOR, law)]))


@case
def modulus_differs(comm: MPI.Comm) -> None:
    solve(comm, scene(material=IsotropicElasticity(210.0 + is_last(comm), 0.3)))


@case
def coordinates_differ(comm: MPI.Comm) -> None:
    solve(comm, scene(MESH.moved(MESH.points * (1.0 + 1e-12 * is_last(comm)))))


@case
def topology_differs(comm: MPI.Comm) -> None:
    mesh = block((0.1, 0.2, 0.0), (1.1, 0.9, 0.7), (3, 3, 3 + is_last(comm)))
    solve(comm, scene(mesh), partitions={"block": bisection_partition(mesh, 4)})


@case
def partition_differs(comm: MPI.Comm) -> None:
    part = CUT["block"]
    solve(comm, scene(), partitions={"block": 3 - part if is_last(comm) else part})


@case
def tolerance_differs(comm: MPI.Comm) -> None:
    solve(comm, scene(), tolerance=1e-4 if is_last(comm) else 1e-8)


@case
def solver_differs(comm: MPI.Comm) -> None:
    solve(comm, scene(), solver=FaceNewton(max_products=7 if is_last(comm) else 900))


@case
def bodies_are_in_another_order(comm: MPI.Comm) -> None:
    other = block((0.1, 0.2, 0.8), (1.1, 0.9, 1.5), (3, 3, 3))
    named = {"block": Body(MESH, STEEL), "other": Body(other, STEEL)}
    bodies = dict(reversed(named.items())) if is_last(comm) else named
    held = [Support("block", "x0"), Support("other", "x0")]
    cut = {"block": CUT["block"], "other": bisection_partition(other, 4)}
    solve(comm, Scene(bodies, supports=held), partitions=cut)


@case
def scene_is_refused(comm: MPI.Comm) -> None:
    """A mistake that all ranks make."""
    solve(comm, scene(), partitions={"block": CUT["block"][:-1]})
