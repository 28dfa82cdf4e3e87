"""Detection of terminals, also behind mpirun, and notebooks."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TextIO

#: Programs that start ranks and forward their output.
LAUNCHERS = {
    "mpirun", "mpiexec", "mpiexec.hydra", "hydra_pmi_proxy", "orterun", "orted", "prterun", "prted", "srun",
}  # fmt: skip


def at_terminal(stream: TextIO | None) -> bool:
    """Return whether a stream ends at a terminal that supports drawing.

    The output of a rank goes to mpirun through a pipe, or through a pseudo-terminal even if mpirun's own
    output is a file. So under mpirun its output is what counts.
    """
    if stream is None or os.environ.get("TERM") == "dumb":
        return False
    with suppress(OSError, ValueError, AttributeError):  # streams without a file descriptor decide themselves
        launcher, descriptor = _launcher(), stream.fileno()
        if launcher is not None and descriptor <= 2:
            with suppress(OSError):
                return os.readlink(f"/proc/{launcher}/fd/{descriptor}").startswith(("/dev/pts/", "/dev/tty"))
            return False
    with suppress(ValueError, AttributeError):
        return stream.isatty()
    return False


def in_notebook() -> bool:
    """Return whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    return getattr(shell and shell.get_ipython(), "kernel", None) is not None


def _launcher() -> int | None:
    """Return the process that started the ranks on this machine, None if this is not one of them."""
    launcher, candidate = None, os.getppid()
    with suppress(OSError):
        while True:
            status = Path(f"/proc/{candidate}/stat").read_text()
            name, _, rest = status.partition("(")[2].rpartition(")")
            if name not in LAUNCHERS:
                break
            launcher, candidate = candidate, int(rest.split()[1])
    return launcher
