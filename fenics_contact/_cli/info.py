"""`fenics-contact info` and `schema`: the software of this machine, and the JSON schema of scene files."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fenics_contact import _dolfinx
from fenics_contact._base import requirements as _requirements
from fenics_contact._base.display import counted
from fenics_contact._base.libraries import MPI
from fenics_contact._base.threads import SETTINGS, unlimited
from fenics_contact._cli.console import console_of, facts
from fenics_contact._scene_file.validation import json_schema
from fenics_contact.errors import MissingRequirementError
from fenics_contact.output.files import json_text, write_json
from fenics_contact.output.result import versions

if TYPE_CHECKING:
    from collections.abc import Iterator


_REFERENCE = re.compile(r"/blas/libblas|libblas\.so\.3\.\d")


def add_to(app: typer.Typer) -> None:
    """Add both commands to the program."""
    app.command("info", short_help="versions, PETSc, compiler, BLAS, MPI, pictures")(info)
    app.command("schema", short_help="JSON schema of scene files, for editors")(schema)


def info(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Write JSON, for programs.")] = False,
) -> None:
    """Show versions, PETSc's packages, the C compiler, the BLAS, MPI, and whether pictures can be drawn."""
    console = console_of(context)
    known = gathered(console.comm)
    if as_json:
        console.write(json_text(known).rstrip())
        return
    console.write(facts(known["versions"], "versions"))
    console.write()
    console.write(facts(known["machine"], "machine"))
    for line in known["advice"]:
        console.write(f"! {line}")


def gathered(comm: MPI.Comm) -> dict[str, Any]:
    """Return the rows of `info`. Collective."""
    local = comm.Split_type(MPI.COMM_TYPE_SHARED)
    first = local.rank == 0
    local.Free()
    nodes = comm.allreduce(int(first))
    packages = ", ".join(_packages())
    libraries = loaded_blas()  # now with that of PETSc, which may be its own
    machine = {
        "ranks": f"{comm.size} on {counted(nodes, 'node')}, {os.cpu_count()} cores on this one",
        "threads": ", ".join(f"{name}={os.environ.get(name, 'not set')}" for name in SETTINGS),
        "BLAS": ", ".join(libraries) or "not found",
        "PETSc packages": packages,
        "C compiler": comm.bcast(_requirements.compiler_problem() if comm.rank == 0 else "") or "works",
        "pictures": _pictures(comm),
    }
    return {"versions": versions(), "machine": machine, "advice": list(_advice(comm, libraries))}


def loaded_blas() -> list[str]:
    """Return the files of the BLAS libraries in this process, as far as the system reports them."""
    names = "openblas|scipy_openblas|mkl_rt|blis|atlas|satlas|tatlas|blas"
    return _requirements.loaded_libraries(rf"lib(?:{names})[^/\s]*\.so\S*")


def _packages() -> Iterator[str]:
    from fenics_contact._base.libraries import PETSc

    for package in ("cholmod", "mumps"):
        yield f"{package} {'works' if _requirements.factors(PETSc, package) else 'is not there'}"


def _pictures(comm: MPI.Comm) -> str:
    words = ""
    if comm.rank == 0:
        try:
            from fenics_contact.pictures.canvas import check_renderer

            check_renderer()
            words = "can be drawn"
        except MissingRequirementError as error:
            words = f"cannot be drawn: {error}"
    return str(comm.bcast(words))


def _advice(comm: MPI.Comm, libraries: list[str]) -> Iterator[str]:
    if _dolfinx.untested():
        yield _dolfinx.untested()
    if any(map(_REFERENCE.search, libraries)):
        yield (
            "the BLAS is the slow reference one: install OpenBLAS (Debian: apt-get install "
            "libopenblas0-pthread) and choose it (update-alternatives --config "
            "libblas.so.3-x86_64-linux-gnu); factorisations take a fraction of the time"
        )
    if unlimited(comm.size):
        yield unlimited(comm.size)


def schema(
    context: typer.Context,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="File to write; stdout unless given.", show_default=False),
    ] = None,
) -> None:
    """Write the JSON schema of scene files, which editors use for completion and checks.

    A scene file whose first line is "#:schema scene_file.schema.json" is checked while it is edited, by taplo
    or the extension Even Better TOML.
    """
    console = console_of(context)
    if file is None:
        console.write(json_text(json_schema()).rstrip())
        return
    write_json(file, json_schema(), comm=console.comm)
    console.write(f"schema of scene files in {file}")
