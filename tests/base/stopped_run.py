"""A run that is told to stop: ``stopped_run.py KIND FILE SIGNAL [RANK] [twice] [plain] [seldom]``.

Rank RANK sends the signal to itself in the middle of a solve, once three steps or evaluations are done.
SIGNAL ``none`` lets the run come to its end; ``wait`` says "now" and goes on slowly, to be stopped from
outside. ``plain`` leaves Ctrl-C to Python, ``seldom`` writes every fourth time alone.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from mpi4py import MPI

from fenics_contact import Checkpoint, ContactProblem, box_partition, interruptible, solve_steps
from fenics_contact._base.progress import LOGGER_NAME, Event
from fenics_contact.qp import FaceNewton
from tests.design.resumed_cases import minimised, posed
from tests.equilibrium.step_cases import sheared_block, shears

DONE = 3


class Stopper(logging.Handler):
    """Sends the signal as soon as enough is done and the next solve has begun."""

    def __init__(self, what: str, name: str, times: int) -> None:
        super().__init__()
        self.what, self.name_of_signal, self.times, self.done = what, name, times, 0

    def emit(self, record: logging.LogRecord) -> None:
        event: Event = record.progress  # type: ignore[attr-defined]
        if event.what == self.what and event.number is not None:
            self.done = event.number
        if self.done < DONE or event.what != "solve" or not event.number:
            return
        if self.name_of_signal == "wait":
            if self.done == DONE and event.number == 1:
                sys.stderr.write("now\n")
                sys.stderr.flush()
            time.sleep(0.02)
        else:
            for _ in range(self.times):
                self.times -= 1
                os.kill(os.getpid(), getattr(signal, self.name_of_signal))


def steps(checkpoint: Checkpoint | None) -> dict[str, Any]:
    """Shear a block to and fro."""
    scene = sheared_block()
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    solver = FaceNewton(tolerance=1e-9)  # answers are compared to 1e-7
    states = solve_steps(
        ContactProblem(scene, MPI.COMM_WORLD, partitions=cut, solver=solver), shears(), checkpoint=checkpoint
    )
    products = [state.solution.products for state in states]
    return {"answer": states[-1].contact.force.tolist(), "products": products}


def optimisation(checkpoint: Checkpoint | None) -> dict[str, Any]:
    """Minimise over the shape of a block."""
    problem = posed("block", MPI.COMM_WORLD, 1e-6)
    result = minimised("block", problem, checkpoint, max_evaluations=6, raise_on_failure=False)
    return {"answer": result.x.tolist(), "products": [record.evaluations for record in result.history]}


RUNS = {"steps": ("load steps", steps), "optimisation": ("optimisation", optimisation)}

if __name__ == "__main__":
    # Jobs in the background of a shell are started deaf to Ctrl-C, and so is what they start.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    kind, path, name, *more = sys.argv[1:]
    what, run = RUNS[kind]
    rank = next((int(word) for word in more if word.isdecimal()), 0)
    if name != "none" and MPI.COMM_WORLD.rank == rank:
        logger = logging.getLogger(LOGGER_NAME)
        logger.setLevel(logging.DEBUG)
        logger.propagate = False
        logger.addHandler(Stopper(what, name, 2 if "twice" in more else 1))
    checkpoint = None if path == "-" else Checkpoint(Path(path), every=4 if "seldom" in more else 1)
    with nullcontext() if "plain" in more else interruptible(MPI.COMM_WORLD):
        found = run(checkpoint)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(found))
