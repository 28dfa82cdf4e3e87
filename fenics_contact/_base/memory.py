"""Memory that a machine has left, and its return."""

from __future__ import annotations

import ctypes
from pathlib import Path
from resource import RLIM_INFINITY, RLIMIT_AS, getrlimit


def available_memory(table: Path = Path("/proc/meminfo")) -> float | None:
    """Return the memory that programs can still take, [bytes]; None where the system does not say."""
    return _listed(table, "MemAvailable")


def addressable_memory(status: Path = Path("/proc/self/status")) -> float | None:
    """Return how much more this process may address, [bytes]; None without a limit (``ulimit -v``)."""
    limit, _ = getrlimit(RLIMIT_AS)
    taken = _listed(status, "VmSize")
    return None if limit == RLIM_INFINITY or taken is None else max(limit - taken, 0.0)


def _listed(table: Path, wanted: str) -> float | None:
    """Return a size that Linux lists in kB, [bytes]."""
    if not table.is_file():
        return None
    for line in table.read_text().splitlines():
        name, _, size = line.partition(":")
        if name == wanted:
            return 1024.0 * float(size.split()[0])
    return None


def return_memory() -> None:
    """Return to the system what was freed between objects that stay; only where the C library is GNU's.

    Workspaces of factors leave holes between these, which otherwise stay the program's: up to a fifth of all.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
