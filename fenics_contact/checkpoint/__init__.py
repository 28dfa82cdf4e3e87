"""Checkpoints: long runs write down all that they need to go on, in files that are whole or not there."""

from fenics_contact.checkpoint.archive import read_archive, write_archive
from fenics_contact.checkpoint.checkpoint import Checkpoint
from fenics_contact.checkpoint.fingerprint import described, differences
from fenics_contact.checkpoint.whole_file import CheckpointError, synchronise, write_whole

__all__ = [
    "Checkpoint",
    "CheckpointError",
    "described",
    "differences",
    "read_archive",
    "synchronise",
    "write_archive",
    "write_whole",
]
