"""Where the program writes: streams that may be closed by their reader, be full, or know few characters."""

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
    """Let no stream fail on a character that it does not know: it is written as an escape."""
    _hear_no_broken_pipe()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def say(text: str) -> None:
    """Write to stdout; where nobody reads any more, nothing, and the command goes on.

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
    """Return the error of a command that cannot write to stdout; what is left of its words goes nowhere."""
    _lead_nowhere(sys.stdout)
    return OutputError(
        f"what this command says must be written to stdout, which failed: {error.strerror or error}. Free "
        "space, or send it elsewhere"
    )


def complain(text: str) -> None:
    """Write to stderr what a terminal shows and does not obey; where that fails there is nobody to tell."""
    _hear_no_broken_pipe()
    with suppress(OSError):
        sys.stderr.write(visible(text))
        sys.stderr.flush()


def _hear_no_broken_pipe() -> None:
    """Let a write fail where nobody reads, as Python does; PETSc ends the whole run with a page of words."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)


def _lead_nowhere(stream: TextIO) -> None:
    """Let what a stream still holds go nowhere, so that it can be closed."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
