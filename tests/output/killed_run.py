"""Runs that write everything and may be killed: ``killed_run.py KIND FOLDER [MOMENT COUNT RANK]``.

With a moment the process of that rank kills itself there, the COUNT-th time that it comes to it, or after
COUNT milliseconds.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
from mpi4py import MPI

from fenics_contact import Checkpoint, write_result
from fenics_contact._dolfinx.loading import dolfinx
from fenics_contact.output import ResultSeries, write_optimisation_result
from fenics_contact.qp.problem import CountedOperator
from tests.design.resumed_cases import minimised, posed
from tests.equilibrium.step_cases import sequence, shears

FORMATS = ("vtu", "xdmf")


def load_steps(folder: Path, comm: MPI.Comm) -> None:
    """Shear a block to and fro; every step goes to a series."""
    history = sequence(Checkpoint(folder / "run.npz"), comm)
    series = ResultSeries(folder, "steps", comm, formats=FORMATS)
    for number, step in enumerate(shears()):
        state = history.advance(step)
        series.add(state, number, step.name)
    contact = state.contact
    more = {
        "force": contact.force,
        "slip": contact.total_slip,
        "displacement": state.gather_displacement("block"),
    }
    write_result(state, folder, more=more)


def optimisation(folder: Path, comm: MPI.Comm) -> None:
    """Optimise the crowns of two coarse chain links; every better design goes to a series."""
    problem = posed("chain", comm, 1e-9)
    series = ResultSeries(folder, "designs", comm, formats=FORMATS)
    result = minimised(
        "chain",
        problem,
        Checkpoint(folder / "run.npz"),
        callback=series.follow(problem),
        max_evaluations=8,
        raise_on_failure=False,
    )
    best = problem.best
    assert best is not None
    more = {
        "force": best.state.contact.force,
        "displacement": best.state.gather_displacement("link1"),
    }
    write_optimisation_result(result, problem, folder, more=more)


RUNS = {"steps": load_steps, "optimisation": optimisation}


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def counted(count: int, at_last: Callable[..., Any], function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function, whose ``count``-th call is another one."""
    calls = [0]

    def call(*args: Any, **options: Any) -> Any:
        calls[0] += 1
        return (at_last if calls[0] == count else function)(*args, **options)

    return call


def half_a_checkpoint(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content[: len(content) // 2])
    die()


def half_a_text(path: Path, text: str, *args: Any, **options: Any) -> None:
    path.write_bytes(text.encode()[: len(text) // 2])
    die()


def half_a_mesh(path: Path, mesh: meshio.Mesh, **options: Any) -> None:
    path.write_bytes(b'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid"')
    die()


#: Moment -> where it comes, and what is done instead.
MOMENTS: dict[str, tuple[Any, str, Callable[..., Any]]] = {
    "in a solve": (CountedOperator, "__call__", lambda *args: die()),
    "in a checkpoint": (Path, "write_bytes", half_a_checkpoint),
    "in a VTU file": (meshio, "write", half_a_mesh),
    "in an index": (Path, "write_text", half_a_text),
    "in an HDF5 file": (dolfinx.io.XDMFFile, "write_function", lambda *args: die()),
    "before a file gets its name": (os, "replace", lambda *args: die()),
    "before a file is removed": (Path, "unlink", lambda *args, **options: die()),
}


def armed(moment: str, count: int) -> None:
    if moment == "after a time":
        timer = threading.Timer(count / 1000, die)
        timer.daemon = True
        timer.start()
        return
    owner, name, instead = MOMENTS[moment]
    setattr(owner, name, counted(count, instead, getattr(owner, name)))


if __name__ == "__main__":
    kind, place, *how = sys.argv[1:]
    if how and int(how[2]) == MPI.COMM_WORLD.rank:
        armed(how[0], int(how[1]))
    RUNS[kind](Path(place), MPI.COMM_WORLD)
