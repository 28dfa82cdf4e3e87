"""Interruption and continuation of runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fenics_contact.checkpoint import Checkpoint, interruptible
from fenics_contact.cli.desk import Console, write_stderr
from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError


@contextmanager
def resumable(console: Console, checkpoint: Checkpoint | None) -> Iterator[None]:
    """Let signals stop the block where it can continue, and report how to continue an incomplete run.

    Collective.
    """
    with interruptible(console.comm), _reporting(console, checkpoint):
        yield


@contextmanager
def _reporting(console: Console, checkpoint: Checkpoint | None) -> Iterator[None]:
    if checkpoint is None:
        yield
        return
    path = Path(checkpoint.path)
    resumed = path.exists() and checkpoint.resume is not False
    if resumed:
        console.say(f"going on from {path} (--fresh starts anew)")
    try:
        yield
    except InvalidInputError as error:
        if resumed:
            raise InvalidInputError(f"{error} (with --fresh the run starts anew)") from error
        raise
    except (ConvergenceError, InfeasibleError):
        if console.comm.rank == 0 and path.exists():
            write_stderr(f"what is done is kept in {path}; the same command goes on from there\n")
        raise
