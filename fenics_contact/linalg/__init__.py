"""Sparse linear algebra that the upper floors share."""

from fenics_contact.linalg.disposal import dispose_with, sweep
from fenics_contact.linalg.shared_factor import ROWS_PER_RANK, SharedFactor

__all__ = ["ROWS_PER_RANK", "SharedFactor", "dispose_with", "sweep"]
