"""Kill a process again and again while it writes checkpoints: ``killed_writer.py FOLDER KILLS SEED``.

Every process goes on from what the one before has left, as a run that is started again would. The answer is
one line of JSON: what the survivor found after each kill.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np

from fenics_contact import Checkpoint

KIND, PROBLEM = "test", {"problem": "counting"}


def content(step: int) -> dict[str, np.ndarray]:
    """Return arrays that tell whether they belong together; some hundred kilobytes."""
    return {"step": np.array(step), "numbers": np.full(50_000, float(step))}


def write_forever(checkpoint: Checkpoint) -> None:
    stored = checkpoint.read(KIND, PROBLEM, None)
    step = 0 if stored is None else int(stored["step"])
    while True:
        step += 1
        checkpoint.write(KIND, PROBLEM, content(step), None)


def kill_once(checkpoint: Checkpoint, delay: float) -> None:
    begun, tell = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(tell, b"!")
        write_forever(checkpoint)
    os.read(begun, 1)
    os.close(begun)
    os.close(tell)
    time.sleep(delay)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def main(folder: Path, kills: int, seed: int) -> None:
    checkpoint, chance = Checkpoint(folder / "run.npz"), random.Random(seed)
    steps, whole, partial = [0], 0, 0
    checkpoint.write(KIND, PROBLEM, content(0), None)
    # On a busy machine many processes are killed before they come to write.
    while len(steps) <= kills or (steps[-1] < 10 and len(steps) < 20 * kills):
        kill_once(checkpoint, chance.uniform(0.002, 0.03))
        stored = checkpoint.read(KIND, PROBLEM, None)  # raises if it is not whole
        assert stored is not None
        steps.append(int(stored["step"]))
        whole += all(np.array_equal(stored[name], part) for name, part in content(steps[-1]).items())
        partial += len(list(folder.glob(".*.partial"))) > 0
    left = len(list(folder.glob(".*.partial")))
    sys.stdout.write(json.dumps({"steps": steps, "whole": whole, "partial": partial, "left": left}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
