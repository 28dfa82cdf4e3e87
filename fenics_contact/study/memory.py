"""Memory of the present process."""

from __future__ import annotations

from pathlib import Path


def peak_memory() -> int | None:
    """Return the largest resident memory of this process so far, [byte]; None where no one keeps it.

    Linux keeps it by address space; `resource.getrusage` would also count what the process was before it
    became this program.
    """
    status = Path("/proc/self/status")
    if not status.exists():
        return None
    peak = [line for line in status.read_text().splitlines() if line.startswith("VmHWM:")]
    return 1024 * int(peak[0].split()[1]) if peak else None
