"""Where progress can be drawn: whether a stream ends at a terminal, also through mpirun, or in a notebook."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import TextIO

#: Programs that start ranks and pass on what they write.
LAUNCHERS = {
    "mpirun", "mpiexec", "mpiexec.hydra", "hydra_pmi_proxy", "orterun", "orted", "prterun", "prted", "srun",
}  # fmt: skip


def terminal_width(stream: TextIO) -> int | None:
    """Return the columns of the terminal at which a stream ends, None where there is none.

    What a rank writes goes to mpirun through a pipe, or through a pseudo-terminal even where mpirun's own
    output is a file. So under mpirun it counts where that one writes to.

    Args:
        stream: The stream.
    """
    try:
        descriptor = stream.fileno()
    except (OSError, ValueError, AttributeError):
        # No file of the system: a stream that a program has put together knows itself what it is.
        return 80 if _says_terminal(stream) else None
    launcher = _launcher()
    if launcher is None or descriptor > 2:
        return _columns(descriptor)
    with suppress(OSError):
        opened = os.open(f"/proc/{launcher}/fd/{descriptor}", os.O_WRONLY | os.O_NOCTTY)
        try:
            return _columns(opened)
        finally:
            os.close(opened)
    return None


def in_notebook() -> bool:
    """Tell whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    found = None if shell is None else shell.get_ipython()
    return found is not None and getattr(found, "kernel", None) is not None


def _says_terminal(stream: TextIO) -> bool:
    try:
        return bool(stream.isatty())
    except (ValueError, AttributeError):
        return False


def _columns(descriptor: int) -> int | None:
    if not os.isatty(descriptor) or os.environ.get("TERM") == "dumb":
        return None
    with suppress(OSError):
        return os.get_terminal_size(descriptor).columns or 80
    return 80


def _launcher() -> int | None:
    """Return the process that started the ranks on this machine, None where this is none of them."""
    found, candidate = None, os.getppid()
    while candidate > 1:
        with suppress(OSError, ValueError), open(f"/proc/{candidate}/stat") as file:
            name, _, rest = file.read().partition("(")[2].rpartition(")")
            if name in LAUNCHERS:
                found, candidate = candidate, int(rest.split()[1])
                continue
        break
    return found
