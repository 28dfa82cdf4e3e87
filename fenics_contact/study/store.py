"""Finished runs on the disk, one file each, so that an interrupted study goes on where it was."""

from __future__ import annotations

import hashlib
import json
import logging
from dataclasses import dataclass
from pathlib import Path

from fenics_contact.io import write_json
from fenics_contact.study.launching import Record, Task
from fenics_contact.study.scenes import scene_file

_PACKAGE = Path(__file__).resolve().parents[1]
#: Parts of the package that change no number of a run.
_BESIDE = {"viz"}
#: Modules of this part that do.
_MEASURING = {"parameters.py", "solving.py", "true_error.py", "worker.py", "memory.py"}
#: Failures that may not happen again.
TRANSIENT = {"crash", "timeout"}

logger = logging.getLogger(__name__)


def fingerprint(scene: str) -> str:
    """Return a short hash of all code that a run executes: runs of other code are not used.

    Args:
        scene: Name or file of the study.
    """
    own = scene_file(scene) or _PACKAGE / "study" / "scenes" / f"{scene}.py"
    paths = [path for path in sorted(_PACKAGE.rglob("*.py")) if _counts(path.relative_to(_PACKAGE))]
    digest = hashlib.sha256()
    for path in [*paths, own]:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def _counts(path: Path) -> bool:
    room = path.parts[0]
    return path.name in _MEASURING if room == "study" else room not in _BESIDE and len(path.parts) > 1


@dataclass(frozen=True)
class Store:
    """The folder of a study's runs.

    Attributes:
        folder: Where the files are.
        mark: What the code that ran is called, see `fingerprint`.
    """

    folder: Path
    mark: str

    def file(self, task: Task, repeat: int) -> Path:
        """Return the file of a measurement."""
        key = json.dumps(
            [Path(task.scene).name, task.parameters.as_dict(), task.ranks, self.mark], sort_keys=True
        )
        return self.folder / f"{hashlib.sha256(key.encode()).hexdigest()[:16]}-{repeat}.json"

    def read(self, task: Task, repeat: int, *, transient: bool = False) -> Record | None:
        """Return a measurement, None if it is not there or cannot be read (logged).

        Args:
            task: The run.
            repeat: Which measurement of it.
            transient: Whether failures that may not happen again are returned, too.
        """
        path = self.file(task, repeat)
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
            known = isinstance(record, dict) and ("failed" in record or record["seconds"] > 0.0)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError) as reason:
            logger.warning("%s cannot be read (%s): the run is done again", path, reason)
            return None
        if not known:
            logger.warning("%s holds no record of a run: it is done again", path)
            return None
        failed = record.get("failed")
        again = failed and failed["kind"] in TRANSIENT and not transient
        return None if again else dict(record)

    def write(self, task: Task, repeat: int, record: Record) -> None:
        """Keep a measurement; the file appears whole or not at all."""
        what = {"scene": Path(task.scene).name, "parameters": task.parameters, "ranks": task.ranks}
        write_json(self.file(task, repeat), {**what, "code": self.mark, **record})
