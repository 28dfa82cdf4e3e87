"""A small scene, functions that fail or differ on the last rank, and the table of cases."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import bisection_partition

MESH = block((0.1, 0.2, 0.0), (1.1, 0.9, 0.7), (3, 3, 3))
STEEL = IsotropicElasticity(210.0, 0.3)
FLOOR = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
#: Four subdomains: each of up to four ranks has one.
CUT = {"block": bisection_partition(MESH, 4)}

Case = Callable[[MPI.Comm], Any]
Function = Callable[..., Any]
CASES: dict[str, Case] = {}


def case(function: Case) -> Case:
    """Add a case under its name."""
    CASES[function.__name__] = function
    return function


def is_last(comm: MPI.Comm) -> bool:
    return bool(comm.rank == comm.size - 1)


def fails_on_last(comm: MPI.Comm, value: Any, error: type[BaseException] = RuntimeError) -> Function:
    """A function that raises on the last rank, and does elsewhere what ``value`` does."""

    def function(*given: Any, **named: Any) -> Any:
        if is_last(comm):
            raise error("a bug on one rank")
        return value(*given, **named)

    return function


def differs_on_last(comm: MPI.Comm, value: Function, other: Function) -> Function:
    """A function that does something else on the last rank, and looks the same."""

    def function(*given: Any) -> Any:
        return other(*given) if is_last(comm) else value(*given)

    return function


def scene(mesh: BodyMesh = MESH, **parts: Any) -> Scene:
    """A block pressed on a floor, held on one side."""
    material = parts.pop("material", STEEL)
    given: dict[str, Any] = {
        "supports": [Support("block", "x0")],
        "loads": [Traction("block", "z1", (0.0, 0.1, -1.0))],
        "contacts": [ContactPair(Surface("block", "z0"), FLOOR, Coulomb(0.3))],
    }
    return Scene({"block": Body(mesh, material)}, **{**given, **parts})


def solve(comm: MPI.Comm, given: Scene, **more: Any) -> State:
    return solve_scene(given, comm, partitions=more.pop("partitions", CUT), **more)
