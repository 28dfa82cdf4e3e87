"""A run that may be killed at any moment: ``interrupted_run.py KIND FILE`` goes on from FILE."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from mpi4py import MPI

from fenics_contact import Checkpoint
from tests.design.resumed_cases import minimised, posed
from tests.equilibrium.step_cases import sequence, shears


def optimisation(path: Path | None) -> dict[str, Any]:
    """Minimise over the shape of a block."""
    problem = posed("block", MPI.COMM_SELF, 1e-6)
    checkpoint = None if path is None else Checkpoint(path)
    result = minimised("block", problem, checkpoint, max_evaluations=30, tolerance=1e-5)
    return {"answer": result.x.tolist(), "count": result.evaluations, "products": problem.products}


def steps(path: Path | None) -> dict[str, Any]:
    """Shear a block to and fro."""
    history = sequence(None if path is None else Checkpoint(path), MPI.COMM_SELF)
    states = [history.advance(step) for step in shears()]
    products = sum(state.solution.products for state in states)
    return {"answer": states[-1].contact.force.tolist(), "count": len(states), "products": products}


RUNS = {"optimisation": optimisation, "steps": steps}

if __name__ == "__main__":
    sys.stdout.write(json.dumps(RUNS[sys.argv[1]](Path(sys.argv[2]))))
