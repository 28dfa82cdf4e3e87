"""Write ever larger checkpoints until there is no room: ``full_disk.py FOLDER [BYTES]``.

With BYTES no file may grow beyond them, else the folder lies on a small disk. The answer is one line of JSON.
"""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path

import numpy as np

from fenics_contact import Checkpoint, CheckpointError

KIND, PROBLEM = "test", {"problem": "growing"}


def main(folder: Path, limit: int | None) -> None:
    if limit is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    checkpoint, said, step = Checkpoint(folder / "run.npz"), "", 0
    while not said and step < 100:
        step += 1
        try:
            checkpoint.write(KIND, PROBLEM, {"step": np.array(step), "numbers": np.ones(1000 * step)}, None)
        except CheckpointError as error:
            said = str(error)
    stored = checkpoint.read(KIND, PROBLEM, None)
    assert stored is not None
    kept = int(stored["step"])
    others = [path.name for path in folder.iterdir() if path.name != "run.npz"]
    sys.stdout.write(json.dumps({"failed": step, "kept": kept, "said": said, "others": others}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if sys.argv[2:] else None)
