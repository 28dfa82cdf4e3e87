"""What every rank meets in each case, one case after the other; run under mpirun, writes a JSON line a case.

A case that hangs is ended by a watchdog, which shows where each rank stands.
"""

from __future__ import annotations

import faulthandler
import gc
import json
import sys
import time
from typing import Any

from mpi4py import MPI

from tests.ranks import design_cases, input_cases, material_cases, run_cases, scene_cases
from tests.ranks.given import CASES

#: Seconds that a case may take: a form may be compiled in it.
PATIENCE = 40.0
#: They fill the table of cases when they are imported.
FILLED_BY = (scene_cases, material_cases, input_cases, run_cases, design_cases)


def met(name: str, comm: MPI.Comm) -> dict[str, Any]:
    """Run a case and return what this rank met."""
    faulthandler.dump_traceback_later(PATIENCE, exit=True)
    begun = time.perf_counter()
    found: dict[str, Any] = {"kind": "nothing", "text": "", "cause": ""}
    try:
        found["text"] = str(CASES[name](comm))
    except BaseException as error:
        found = {"kind": type(error).__name__, "text": str(error), "cause": type(error.__cause__).__name__}
    found["seconds"] = time.perf_counter() - begun
    gc.collect()
    return found


if __name__ == "__main__":
    world = MPI.COMM_WORLD
    for name in sys.argv[1:] or CASES:
        every = world.gather(met(name, world))
        if every is not None:
            sys.stdout.write(json.dumps([name, every]) + "\n")
            sys.stdout.flush()
