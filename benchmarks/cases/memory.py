"""Memory of a process, for every program that is measured."""

from __future__ import annotations

from pathlib import Path


def peak_memory() -> int:
    """Return the largest resident memory of this process so far, [byte].

    Linux keeps it by address space; `resource.getrusage` would also count what the process was before it
    became this program.
    """
    lines = Path("/proc/self/status").read_text().splitlines()
    (peak,) = (line for line in lines if line.startswith("VmHWM:"))
    return 1024 * int(peak.split()[1])
