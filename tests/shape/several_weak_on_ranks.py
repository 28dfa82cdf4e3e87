"""A minimisation from a design with several weak points: ``several_weak_on_ranks.py [CHECKPOINT]``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mpi4py import MPI

from tests.shape.several_weak import collect

if __name__ == "__main__":
    answer = collect(MPI.COMM_WORLD, Path(sys.argv[1]) if len(sys.argv) > 1 else None)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(answer))
