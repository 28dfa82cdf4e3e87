"""The program of one run: calls a function on all ranks and writes its record."""

from __future__ import annotations

import importlib
import json
import sys
import traceback
from pathlib import Path
from typing import Any

from fenics_contact._base.launching import ranks_of
from fenics_contact._base.libraries import MPI, start
from fenics_contact.errors import FenicsContactError
from fenics_contact.output.files import write_json


def main(comm: MPI.Comm | None, arguments: list[str] | None = None) -> None:
    """Run the job given as a JSON object on the command line and write the record. Collective.

    Keys: ``function`` and ``arguments`` as in `runner.Job`, and ``file`` of the record. Loading libraries is
        not part of the measured time, and its memory is reported separately.
    """
    task = json.loads((sys.argv[1:] if arguments is None else arguments)[0])
    ranks = ranks_of(comm)
    try:
        record = _called(comm, ranks, task["function"], task["arguments"])
    except FenicsContactError as error:  # raised by all ranks together
        record = {"failed": {"kind": type(error).__name__, "message": str(error)}}
    except Exception:
        if ranks.size == 1:
            raise
        # Other ranks may wait in a collective call that this one will never reach.
        traceback.print_exc()
        sys.stderr.flush()
        ranks.Abort(1)
    write_json(Path(task["file"]), record, comm=comm)


def _called(
    comm: MPI.Comm | None, ranks: MPI.Comm, function: str, arguments: dict[str, Any]
) -> dict[str, Any]:
    module, _, name = function.partition(":")
    call = getattr(importlib.import_module(module), name)
    if comm is not None:
        start(comm)
    imports = peak_memory()
    record = {"ranks": ranks.size, **call(comm, **arguments)}
    peak, imports = (ranks.allreduce(bytes_) for bytes_ in (peak_memory(), imports))
    return {**record, "peak_memory": peak, "import_memory": imports}


def peak_memory() -> int:
    """Return the largest resident memory of this process so far, [byte]; 0 where it is not available.

    Linux records it by address space; `resource.getrusage` would also count the process before it became this
    program. Of pages that ranks share now, see `once_a_machine`, each counts its share.
    """
    largest, resident = (_listed("status", name) for name in ("VmHWM:", "RssShmem:"))
    return largest - resident + min(_listed("smaps_rollup", "Pss_Shmem:"), resident)


def _listed(table: str, wanted: str) -> int:
    """Return a size that Linux lists for this process, [byte]; 0 where it does not."""
    file = Path("/proc/self") / table
    lines = file.read_text().splitlines() if file.exists() else []
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith(wanted))
