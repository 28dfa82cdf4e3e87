"""Meshes that do not fit into memory are rejected before they are built."""

from __future__ import annotations

import math
import os
import resource
from pathlib import Path

from fenics_contact.errors import InvalidInputError

#: Memory for building and checking a structured mesh, by its dimension, in bytes per cell.
BYTES_A_CELL = {2: 550, 3: 1200}
#: Files of the memory limits of Linux containers, of both versions.
_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def require_room(*counts: int) -> None:
    """Reject a mesh that does not fit into the memory of this machine.

    Args:
        *counts: Cells along each of the two or three directions.

    Raises:
        InvalidInputError: States the number of cells, the memory they take and the available memory.
    """
    cells = math.prod(map(int, counts))
    needed, there = cells * BYTES_A_CELL[len(counts)], memory()
    if needed > there:
        raise InvalidInputError(
            f"a mesh must fit into the memory of this machine, {there / 1e9:.3g} GB, got "
            f"{' x '.join(map(str, counts))} cells, which take {_size(needed)} while they are built: take "
            "fewer cells"
        )


def memory() -> int:
    """Return the memory that this process may use, in bytes: limited by machine, container or process."""
    limits = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    own, _ = resource.getrlimit(resource.RLIMIT_AS)
    if own != resource.RLIM_INFINITY:
        limits.append(own)
    for place in _LIMITS:
        try:
            limits.append(int(Path(place).read_text()))
        except (OSError, ValueError):  # there is none, or it says "max"
            continue
    return min(limits)


def _size(needed: int) -> str:
    for unit in ("GB", "TB", "PB"):
        if needed < 1000 * 10**9:
            return f"{needed / 1e9:.3g} {unit}"
        needed //= 1000
    return "more than a thousand PB"
