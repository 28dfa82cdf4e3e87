"""What rank 0 meets when it drives and the others serve; run under mpirun, prints one line a case."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import served
from fenics_contact.errors import InfeasibleError

comm = MPI.COMM_WORLD
LAST = comm.size - 1


def total(x: np.ndarray, *, fail: str = "") -> float:
    """Σ over ranks of (rank + 1) Σ x; fails everywhere, or on the last rank alone after its communication."""
    if fail == "everywhere":
        raise InfeasibleError("nothing holds the block")
    result = float(comm.allreduce((comm.rank + 1) * x.sum()))
    if fail == "last" and comm.rank == LAST:
        raise ZeroDivisionError("a bug on one rank")
    return result


def answers() -> list[Any]:
    """Values, and failures after which rank 0 goes on."""
    found: list[Any] = []
    with served(total, comm) as call:
        if call is not None:
            found.append(call(np.ones(2)))
            for fail in ("everywhere", "last"):
                try:
                    call(np.ones(2), fail=fail)
                except Exception as error:
                    found.append(type(error).__name__)
            found.append(call(np.full(3, 2.0)))
    return found


def tool_fails() -> list[Any]:
    """The outer tool raises between two calls."""
    with served(total, comm) as call:
        if call is not None:
            call(np.ones(1))
            raise KeyError("the tool's own")
    return []


def call_fails() -> list[Any]:
    """Nobody catches what the function raises."""
    with served(total, comm) as call:
        if call is not None:
            call(np.ones(1), fail="everywhere")
    return []


def tool_exits() -> list[Any]:
    """The outer tool ends the program."""
    with served(total, comm) as call:
        if call is not None:
            sys.exit(3)
    return []


def server_fails() -> list[Any]:
    """The block of another rank raises; rank 0 hears of it at its next call."""
    with served(total, comm) as call:
        if comm.rank == LAST:
            raise ValueError("this rank cannot serve")
        if call is not None:
            call(np.ones(1))
    return []


def server_exits() -> list[Any]:
    """The program of another rank ends in the block; rank 0 never calls."""
    with served(total, comm):
        if comm.rank == LAST:
            sys.exit(4)
    return []


CASES: list[Callable[[], list[Any]]] = [
    answers, tool_fails, call_fails, tool_exits, server_fails, server_exits,
]  # fmt: skip

if __name__ == "__main__":
    for case in CASES:
        try:
            mine: Any = case()
        except (Exception, SystemExit) as error:
            mine = [type(error).__name__]
        every = comm.gather(mine)
        if every:
            print(case.__name__, every, sep=": ")
