"""`fenics-contact info`: the software that this machine computes and draws with, and what slows it down."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fenics_contact import _dolfinx, _requirements
from fenics_contact._libraries import MPI
from fenics_contact.cli.blas import SLOW, loaded_blas, numpy_speed
from fenics_contact.cli.desk import Desk, desk_of, facts
from fenics_contact.display import counted
from fenics_contact.errors import MissingRequirementError
from fenics_contact.io import json_text, versions

if TYPE_CHECKING:
    from collections.abc import Iterator

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command("info", short_help="versions, PETSc, BLAS and its speed, MPI, pictures")(info)


def info(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Write JSON, for programs.")] = False,
) -> None:
    """Show versions, PETSc's packages, the BLAS and its speed, MPI, and whether pictures can be drawn."""
    desk = desk_of(context)
    known = gathered(desk.comm)
    if as_json:
        desk.say(json_text(known).rstrip())
        return
    desk.show(facts(known["versions"], "versions"))
    desk.say()
    desk.show(facts({name: _words(value) for name, value in known["machine"].items()}, "machine"))
    for line in known["advice"]:
        desk.say(f"! {line}")


def _words(value: Any) -> str:
    return "\n".join(value) if isinstance(value, list) else str(value)


def gathered(comm: MPI.Comm) -> dict[str, Any]:
    """Return the rows of `info`. Collective."""
    local = comm.Split_type(MPI.COMM_TYPE_SHARED)
    first = local.rank == 0
    local.Free()
    nodes = comm.allreduce(int(first))
    libraries, speed = loaded_blas(), numpy_speed()
    rates = [library.speed for library in libraries if library.speed is not None]
    machine = {
        "ranks": f"{comm.size} on {counted(nodes, 'node')}, {os.cpu_count()} cores on this one",
        "threads": ", ".join(f"{name}={os.environ.get(name, 'not set')}" for name in THREADS),
        "BLAS": [str(library) for library in libraries] or "not found",
        "NumPy's BLAS": f"{speed:.1f} GFLOP/s",
        "PETSc packages": ", ".join(_packages()),
        "pictures": _pictures(comm),
        "VTX files": "yes (ADIOS2)" if _dolfinx.has_vtx() else "no (dolfinx without ADIOS2)",
    }
    slow = any(library.reference for library in libraries) or (bool(rates) and max(rates) < SLOW)
    return {"versions": versions(), "machine": machine, "advice": list(_advice(comm, slow))}


def _packages() -> Iterator[str]:
    from fenics_contact._libraries import PETSc

    for package in ("cholmod", "mumps"):
        yield f"{package} {'works' if _requirements.factors(PETSc, package) else 'is not there'}"


def _pictures(comm: MPI.Comm) -> str:
    words = ""
    if comm.rank == 0:
        try:
            from fenics_contact.viz import check_renderer

            check_renderer()
            words = "can be drawn"
        except MissingRequirementError as error:
            words = f"cannot be drawn: {error}"
    return str(comm.bcast(words))


def _advice(comm: MPI.Comm, slow: bool) -> Iterator[str]:
    if slow:
        yield (
            "the BLAS is slow: install OpenBLAS (Debian: apt-get install libopenblas0-pthread) and choose it "
            "(update-alternatives --config libblas.so.3-x86_64-linux-gnu); factorisations take a fraction of "
            "the time"
        )
    if comm.size > 1 and all(os.environ.get(name) != "1" for name in THREADS[:2]):
        yield (
            "several ranks, and BLAS may use threads on top: set OPENBLAS_NUM_THREADS=1 and OMP_NUM_THREADS=1"
        )


__all__ = ["Desk", "add_to", "gathered"]
