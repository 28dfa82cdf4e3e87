"""Arguments that users give: types, counts, numbers, vectors, files."""

from __future__ import annotations

from fenics_contact.checks.arguments import (
    LARGEST,
    MOST,
    STEEPEST,
    check_count,
    check_grading,
    check_numbers,
    check_row,
    shown,
)
from fenics_contact.checks.checked import checked, meaning
from fenics_contact.checks.files import require_file
from fenics_contact.checks.vectors import Vector, unit_vector

__all__ = [
    "LARGEST",
    "MOST",
    "STEEPEST",
    "Vector",
    "check_count",
    "check_grading",
    "check_numbers",
    "check_row",
    "checked",
    "meaning",
    "require_file",
    "shown",
    "unit_vector",
]
