"""What ranks hold together, and what each holds alone; run under mpirun, writes a JSON list by rank."""

from __future__ import annotations

import gc
import json
import sys
from collections.abc import Collection
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact._base import shared
from fenics_contact._base.costs import costs_of, with_ledger
from fenics_contact._base.shared import count_as_machine, is_shared, once_a_machine, ranks_of_machine
from fenics_contact.errors import InvalidInputError

LARGE = 200_000


class Made:
    """Makes tables and counts how often."""

    def __init__(self, first: int = 0) -> None:
        self.times, self.first = 0, first

    def __call__(self) -> dict[str, Any]:
        self.times += 1
        numbers = np.arange(self.first, self.first + LARGE)
        turned = np.asfortranarray(numbers[: LARGE // 2].reshape(-1, 4) / 3.0)
        return {
            "numbers": numbers,
            "again": [numbers],
            "turned": turned,
            "none": np.zeros((0, 3)),
            "name": "a",
        }


def mapped(earlier: Collection[str] = ()) -> dict[str, int]:
    """Return the files in memory that this rank has mapped but for some: inode -> bytes.

    `earlier`: those of scripts that the same ranks have run before.
    """
    lines = [
        line.split() for line in Path("/proc/self/maps").read_text().splitlines() if "memfd:fenics" in line
    ]
    ends = [(line[4], *(int(x, 16) for x in line[0].split("-"))) for line in lines]
    return {inode: end - start for inode, start, end in ends if inode not in earlier}


def is_protected(array: np.ndarray) -> bool:
    with suppress(ValueError):
        array.setflags(write=True)
        return False
    return not array.flags.writeable


def facts(comm: MPI.Comm, made: Made) -> dict[str, Any]:
    """Return what this rank finds in tables that are made once a machine. Collective."""
    before, earlier = costs_of(comm).total.copy_bytes, mapped()
    tables = once_a_machine(comm, made)
    expected = Made(made.first)()
    arrays = [tables["numbers"], tables["turned"]]
    found = {
        "times": made.times,
        "equal": all(np.array_equal(tables[name], expected[name]) for name in expected if name != "again"),
        "one array": tables["again"][0] is tables["numbers"],
        "layout": bool(tables["turned"].flags.f_contiguous and tables["none"].shape == (0, 3)),
        "shared": [is_shared(array) for array in arrays],
        "protected": [is_protected(array) for array in arrays],
        "files": mapped(earlier),
        "copied": costs_of(comm).total.copy_bytes - before,
    }
    kept = arrays[1]
    del tables, arrays
    gc.collect()
    found["while one is used"] = list(mapped(earlier))
    del kept
    gc.collect()
    return {**found, "afterwards": list(mapped(earlier))}


def failing(comm: MPI.Comm) -> str:
    """Return the words of an error of the first rank. Collective."""

    def make() -> None:
        raise InvalidInputError("there must be a table")

    try:
        once_a_machine(comm, make)
    except InvalidInputError as error:
        return str(error)
    return "nothing"


def small(comm: MPI.Comm) -> bool:
    """Return whether few numbers are protected copies. Collective."""
    few = once_a_machine(comm, lambda: np.arange(comm.size))
    return is_protected(few) and not is_shared(few) and few.tolist() == list(range(comm.size))


def with_files(comm: MPI.Comm, mapped_as: Any) -> dict[str, Any]:
    """Return what is found where files are mapped another way. Collective."""
    known = shared._File.mapped
    shared._File.mapped = mapped_as  # type: ignore[method-assign]
    try:
        return facts(comm, Made())
    finally:
        shared._File.mapped = known  # type: ignore[method-assign]


def main(comm: MPI.Comm) -> list[dict[str, Any]] | None:
    """Return the facts of all ranks, on rank 0. Collective."""
    world = with_ledger(comm)
    plain, is_last = shared._File.mapped, comm.rank == comm.size - 1
    found: dict[str, Any] = {
        "one machine": facts(world, Made()),
        "failed": failing(world),
        "small": small(world),
        "last is blind": with_files(world, lambda file: [] if is_last else plain(file)),
        "another file": with_files(world, lambda file: plain(replace(file, number=file.number + 1))),
    }
    halves = with_ledger(comm.Dup())
    count_as_machine(halves, comm.Split(comm.rank % 2))
    found["two machines"] = facts(halves, Made())
    found["ranks of machines"] = [ranks_of_machine(each).size for each in (world, halves)]
    alone = with_ledger(comm.Dup())
    count_as_machine(alone, comm.Split(comm.rank))
    found["machines of one rank"] = facts(alone, Made())
    return comm.gather(found)


if __name__ == "__main__":
    every = main(MPI.COMM_WORLD)
    if every is not None:
        sys.stdout.write(json.dumps(every))
