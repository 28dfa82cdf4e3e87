"""Write results where there is no room for all: ``full_disk.py FOLDER [BYTES]``.

With BYTES no file may grow beyond them, else the folder lies on a small disk. The answer is one line of JSON.
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from mpi4py import MPI

from fenics_contact import write_vtu
from fenics_contact.output import OutputError, ResultSeries, write_json, write_xdmf
from tests.output.states import touching_blocks


def main(folder: Path, limit: int | None) -> None:
    state, comm = touching_blocks(), MPI.COMM_WORLD
    assert state.von_mises, "compiled before files are limited"
    series = ResultSeries(folder, "run", comm, formats=("vtu", "xdmf") if limit is None else ("vtu",))
    small = write_json(folder / "small.json", {"a": 1})
    series.add(state, 0)
    before = {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    if limit is None:  # the rest of the disk is taken
        fill = folder / "fill"
        with fill.open("wb", buffering=0) as file, suppress(OSError):
            while file.write(b"0" * 4096):
                pass
    else:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    writers: dict[str, Callable[[], object]] = {
        "vtu": lambda: write_vtu(state, folder / "run", "run_0000"),
        **({"xdmf": lambda: write_xdmf(state, folder / "run" / "run_0000.xdmf")} if limit is None else {}),
        "json": lambda: write_json(small, {"a": "0" * 100_000}),
        "series": lambda: series.add(state, 1),
    }
    said = {}
    for name, write in writers.items():
        try:
            write()
            said[name] = "written"
        except OutputError as error:
            said[name] = str(error)
    kept = all(Path(name).read_bytes() == content for name, content in before.items())
    hidden = [path.name for path in folder.rglob(".*")]
    sys.stdout.write(json.dumps({"said": said, "kept": kept, "hidden": hidden}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if sys.argv[2:] else None)
