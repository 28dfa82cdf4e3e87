"""What every case measures in the same way: seconds, memory, and the record it leaves."""

from __future__ import annotations

import argparse
import json
import traceback
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.memory import peak_memory
from fenics_contact.contact import State, Status
from fenics_contact.io.json_file import plain


class MemoryMeter:
    """Peak resident memory of all ranks together, and how much of it the imports had taken.

    Create it before anything is computed. Pages that ranks share are counted on each of them.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        """Note what the imports take."""
        self._comm, self._imports = comm, peak_memory()

    def read(self) -> dict[str, int]:
        """Return both sums over the ranks, [byte]. Collective."""
        return {
            "peak_memory": self._comm.allreduce(peak_memory()),
            "import_memory": self._comm.allreduce(self._imports),
        }


def state_record(state: State) -> dict[str, Any]:
    """Return what can be counted and compared of a state, the same on every rank."""
    return {
        "counts": {
            **state.counts,
            **{status.name.lower(): state.contact.count(status) for status in Status},
        },
        "total_potential": state.energies.total_potential,
        "natural_residual": state.solution.natural_residual,
        "gluing_residual": state.solution.gluing_residual,
        "normal_force": state.contact.normal_force.sum(),
        "contact_force": state.contact.force.sum(axis=0),
    }


def nodal_forces(state: State) -> np.ndarray:
    """Return the force on every contact node in the order of the nodes, whatever the partition, (n, 3)."""
    return np.asarray(state.contact.force[np.argsort(state.contact.points.slave)])


def run_case(
    measure: Callable[..., Mapping[str, Any]], parser: argparse.ArgumentParser | None = None
) -> None:
    """Run a case on all ranks and print its record, with ranks and memory, as the last line.

    Args:
        measure: The case, called with the communicator and the settings of the command line.
        parser: Reads the command line; a case without settings needs none.
    """
    comm = MPI.COMM_WORLD
    memory = MemoryMeter(comm)
    settings = vars((parser or argparse.ArgumentParser()).parse_args())
    try:
        record = {**measure(comm, **settings), "ranks": comm.size, **memory.read()}
    except Exception:
        # Other ranks may wait in a collective call that this one will never reach.
        traceback.print_exc()
        comm.Abort(1)
    if comm.rank == 0:
        print(json.dumps(plain(record)), flush=True)
