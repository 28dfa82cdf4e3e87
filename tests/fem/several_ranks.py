"""The displacement that a module's `displacement_on` finds on several ranks."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np

SCRIPT = """
    import json, sys
    from mpi4py import MPI
    from {module} import displacement_on
    result = displacement_on(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(result))
"""


def displacement_of(module: str, ranks: int, mpirun: Callable[..., str]) -> np.ndarray:
    return np.array(json.loads(mpirun(SCRIPT.format(module=module), ranks)))
