"""Memory that a machine has left."""

from __future__ import annotations

from pathlib import Path


def available_memory(table: Path = Path("/proc/meminfo")) -> float | None:
    """Return the memory that programs can still take, [bytes]; None where the system does not say.

    `table`: where Linux lists its memory.
    """
    if not table.is_file():
        return None
    for line in table.read_text().splitlines():
        name, _, size = line.partition(":")
        if name == "MemAvailable":
            return 1024.0 * float(size.split()[0])
    return None
