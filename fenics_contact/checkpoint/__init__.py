"""Checkpoints: long runs store all that they need to continue, in atomically written files."""

from fenics_contact.checkpoint.archive import read_archive, write_archive
from fenics_contact.checkpoint.checkpoint import Checkpoint, without_checkpoint
from fenics_contact.checkpoint.interruption import (
    Interrupted,
    Interruption,
    interruptible,
    safe_point,
    telling_what_is_kept,
)
from fenics_contact.checkpoint.whole_file import (
    CheckpointError,
    hidden_folder,
    put_whole,
    remove_abandoned,
    replace_all,
    write_whole,
)

__all__ = [
    "Checkpoint",
    "CheckpointError",
    "Interrupted",
    "Interruption",
    "hidden_folder",
    "interruptible",
    "put_whole",
    "read_archive",
    "remove_abandoned",
    "replace_all",
    "safe_point",
    "telling_what_is_kept",
    "without_checkpoint",
    "write_archive",
    "write_whole",
]
