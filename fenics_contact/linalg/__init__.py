"""Sparse linear algebra shared by the upper floors."""

from fenics_contact.linalg.cost_model import expected_bytes, expected_seconds, prefers_explicit
from fenics_contact.linalg.disposal import dispose_with, sweep
from fenics_contact.linalg.rounding import LAST_PLACES, ROUNDING
from fenics_contact.linalg.scaled import scaled_columns, scaled_rows
from fenics_contact.linalg.shared_factor import ROWS_PER_RANK, SharedFactor
from fenics_contact.linalg.threads import warn_of_threads

__all__ = [
    "LAST_PLACES",
    "ROUNDING",
    "ROWS_PER_RANK",
    "SharedFactor",
    "dispose_with",
    "expected_bytes",
    "expected_seconds",
    "prefers_explicit",
    "scaled_columns",
    "scaled_rows",
    "sweep",
    "warn_of_threads",
]
