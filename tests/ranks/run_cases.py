"""Histories and responses in which something fails on the last rank alone, or differs there."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Checkpoint,
    ContactProblem,
    LoadStep,
    Scene,
    SceneResponse,
    State,
    Traction,
    solve_steps,
    write_vtu,
)
from tests.ranks.given import CUT, case, fails_on_last, is_last, scene


def pressed(load: float = 1.0) -> Scene:
    return scene(loads=[Traction("block", "z1", (0.0, 0.0, -load))])


STEPS = [LoadStep(f"step {k}", loads=[Traction("block", "z1", (0.0, 0.0, -1.0 - k))]) for k in range(2)]


def folder(comm: MPI.Comm) -> Path:
    """A new folder, the same on all ranks."""
    return Path(comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None))


@case
def checkpoint_cannot_be_written(comm: MPI.Comm) -> None:
    """By rank 0, which writes; the others could."""
    path = "/proc/none/here.npz" if comm.rank == 0 else folder(MPI.COMM_SELF) / "here.npz"
    solve_steps(ContactProblem(scene(), comm, partitions=CUT), STEPS, checkpoint=Checkpoint(path))


@case
def checkpoint_on_one_rank_only(comm: MPI.Comm) -> None:
    kept = Checkpoint(folder(comm) / "run.npz")
    solve_steps(
        ContactProblem(scene(), comm, partitions=CUT), STEPS, checkpoint=kept if is_last(comm) else None
    )


@case
def steps_differ(comm: MPI.Comm) -> None:
    other = replace(STEPS[1], loads=[Traction("block", "z1", (0.0, 0.0, -3.0))])
    solve_steps(
        ContactProblem(scene(), comm, partitions=CUT), [STEPS[0], other if is_last(comm) else STEPS[1]]
    )


@case
def a_step_is_missing(comm: MPI.Comm) -> None:
    solve_steps(ContactProblem(scene(), comm, partitions=CUT), STEPS[: 1 if is_last(comm) else 2])


@case
def a_step_is_refused(comm: MPI.Comm) -> None:
    surface = "nowhere" if is_last(comm) else "z1"
    step = LoadStep("step", loads=[Traction("block", surface, (0.0, 0.0, -1.0))])
    solve_steps(ContactProblem(scene(), comm, partitions=CUT), [step])


def response(comm: MPI.Comm, quantity: Callable[[State], Any], build: Any = pressed) -> Any:
    return SceneResponse(build, {"load": 1.0}, {"force": quantity}, comm, partitions=CUT)()["force"]


def force(state: State) -> float:
    return float(state.contact.normal_force.sum())


@case
def quantity_raises(comm: MPI.Comm) -> None:
    response(comm, fails_on_last(comm, force))


@case
def quantity_raises_before_others_gather(comm: MPI.Comm) -> None:
    def largest(state: State) -> float:
        if is_last(comm):
            raise RuntimeError("a bug on one rank")
        return float(np.abs(state.gather_displacement("block")).max())

    response(comm, largest)


@case
def quantity_writes_on_one_rank(comm: MPI.Comm) -> None:
    """Files are written by all ranks; here one of them leaves the quantity first."""
    where = folder(comm)

    def written(state: State) -> float:
        if is_last(comm):
            raise OSError("no space on one rank")
        write_vtu(state, where)
        return 1.0

    response(comm, written)


class Enough(Exception):
    """By this a user stops a run, on all ranks."""


@case
def quantity_stops_the_run(comm: MPI.Comm) -> None:
    def enough(state: State) -> float:
        raise Enough("this will do")

    response(comm, enough)


@case
def quantity_exits(comm: MPI.Comm) -> None:
    response(comm, fails_on_last(comm, force, SystemExit))


@case
def quantity_is_no_number(comm: MPI.Comm) -> None:
    response(comm, lambda state: "none" if is_last(comm) else 1.0)


@case
def response_is_not_built(comm: MPI.Comm) -> None:
    response(comm, force, fails_on_last(comm, lambda **named: pressed(**named)))


@case
def parameters_of_a_response_differ(comm: MPI.Comm) -> None:
    made = SceneResponse(pressed, {"load": 1.0}, {"force": force}, comm, partitions=CUT)
    made(load=2.0 + is_last(comm))


@case
def response_goes_on_after_a_failure(comm: MPI.Comm) -> float:
    calls = []

    def quantity(state: State) -> float:
        calls.append(1)
        if len(calls) == 1 and is_last(comm):
            raise RuntimeError("a bug on one rank")
        return force(state)

    made = SceneResponse(pressed, {"load": 1.0}, {"force": quantity}, comm, partitions=CUT)
    try:
        made()
    except RuntimeError:
        return round(made()["force"], 6)
    raise AssertionError("nothing was raised")
