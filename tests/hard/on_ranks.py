"""Answers of hard cases on several ranks: ``mpirun -n N python on_ranks.py FILE``, which lists sentences."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from mpi4py import MPI

from fenics_contact.errors import FenicsContactError
from tests.hard.scenes import TRIALS
from tools.hard_cases.trial import Answer, bisected


def answer_of(sentence: str, comm: MPI.Comm) -> dict[str, Any]:
    """Return the answer of a trial, or the message of its error. Collective."""
    case = TRIALS[sentence].build()
    subdomains = sum(len(set(cut.tolist())) for cut in case.cut.values())
    cut = case.cut if subdomains >= comm.size else bisected(case.scene, comm.size)
    try:
        return {"answer": Answer.of(case.solve(comm, cut)).written()}
    except FenicsContactError as error:  # raised by all ranks or by none
        told = [words.split(" (met on rank")[0] for words in comm.allgather(str(error))]
        return {"error": f"{type(error).__name__}: {error}", "alike": len(set(told)) == 1}


if __name__ == "__main__":
    world = MPI.COMM_WORLD
    found = {name: answer_of(name, world) for name in json.loads(Path(sys.argv[1]).read_text())}
    if world.rank == 0:
        sys.stdout.write(json.dumps(found))
