"""Checks of users' arguments: types, counts, numbers, vectors, files."""

from __future__ import annotations

from fenics_contact.checks.arguments import (
    LARGEST,
    MOST,
    STEEPEST,
    brief,
    check_count,
    check_grading,
    check_numbers,
    check_row,
)
from fenics_contact.checks.checked import checked, meaning
from fenics_contact.checks.files import require_file
from fenics_contact.checks.vectors import GivenVector, floats, unit_vector

__all__ = [
    "LARGEST",
    "MOST",
    "STEEPEST",
    "GivenVector",
    "brief",
    "check_count",
    "check_grading",
    "check_numbers",
    "check_row",
    "checked",
    "floats",
    "meaning",
    "require_file",
    "unit_vector",
]
