"""Minimisations from a design with several weak points, anew and from each ``CHECKPOINT`` given."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mpi4py import MPI

from tests.design.several_weak import collect

if __name__ == "__main__":
    answer = [collect(MPI.COMM_WORLD, path) for path in (None, *map(Path, sys.argv[1:]))]
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(answer))
