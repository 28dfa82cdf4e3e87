"""Checkpoints: long runs store all that they need to continue, in atomically written files."""

from fenics_contact.checkpoint.archive import read_archive, write_archive
from fenics_contact.checkpoint.checkpoint import Checkpoint, without_checkpoint
from fenics_contact.checkpoint.interruption import (
    Interrupted,
    Interruption,
    interruptible,
    reporting_what_is_stored,
    safe_point,
)
from fenics_contact.checkpoint.whole_file import (
    CheckpointError,
    hidden_folder,
    remove_abandoned,
    replace_all,
    write_atomically,
    write_whole,
)

__all__ = [
    "Checkpoint",
    "CheckpointError",
    "Interrupted",
    "Interruption",
    "hidden_folder",
    "interruptible",
    "read_archive",
    "remove_abandoned",
    "replace_all",
    "reporting_what_is_stored",
    "safe_point",
    "without_checkpoint",
    "write_archive",
    "write_atomically",
    "write_whole",
]
