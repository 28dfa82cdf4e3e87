"""The demo script itself at paper size, as `make demo SIZE=paper` runs it, with its pictures and files."""

from __future__ import annotations

import os
import runpy
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

DEMO = Path(__file__).parents[2] / "demos" / "demo_chain_links.py"


def measure(comm: MPI.Comm) -> dict[str, float]:
    """Run the demo in a folder that is removed afterwards and return its wall seconds. Collective."""
    folder = comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None)
    with tempfile.TemporaryDirectory() as mine:
        os.chdir(folder)
        sys.argv = [str(DEMO), "--size", "paper"]
        comm.Barrier()
        start = perf_counter()
        runpy.run_path(str(DEMO), run_name="__main__")
        seconds = comm.allreduce(perf_counter() - start, op=MPI.MAX)
        os.chdir(mine)
    return {"seconds": seconds}
