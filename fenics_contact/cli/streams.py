"""Output streams, which may be closed by their reader, be full, or support few characters."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import suppress
from typing import TextIO

from fenics_contact.io import OutputError
from fenics_contact.progress import visible


def prepare_streams() -> None:
    """Write characters that a stream cannot encode as escapes."""
    _hear_no_broken_pipe()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def say(text: str) -> None:
    """Write to stdout; if its reader has closed it, write nothing and continue.

    Raises:
        OutputError: If it cannot be written, for instance to a full disk.
    """
    _hear_no_broken_pipe()
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        _lead_nowhere(sys.stdout)
    except OSError as error:
        raise unsaid(error) from error


def unsaid(error: OSError) -> OutputError:
    """Return the error of a command that cannot write to stdout, whose further output is discarded."""
    _lead_nowhere(sys.stdout)
    return OutputError(
        f"what this command says must be written to stdout, which failed: {error.strerror or error}. Free "
        "space, or send it elsewhere"
    )


def complain(text: str) -> None:
    """Write to stderr with control characters escaped; a failure cannot be reported."""
    _hear_no_broken_pipe()
    with suppress(OSError):
        sys.stderr.write(visible(text))
        sys.stderr.flush()


def _hear_no_broken_pipe() -> None:
    """Let a write to a closed pipe raise, as in Python; PETSc's signal handler would end the whole run."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)


def _lead_nowhere(stream: TextIO) -> None:
    """Discard the buffer of a stream, so that it can be closed."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
