"""Output streams, which may be closed by their reader, be full, or support few characters."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from fenics_contact.io import OutputError
from fenics_contact.progress import visible


def prepare_streams() -> None:
    """Write characters that a stream cannot encode as escapes."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def say(text: str) -> None:
    """Write to stdout; if its reader has closed it, write nothing and continue.

    Raises:
        OutputError: If it cannot be written, for instance to a full disk.
    """
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
    with suppress(OSError):
        sys.stderr.write(visible(text))
        sys.stderr.flush()


class Unread:
    """A stream that goes on, writing nothing, once its reader has closed it: for code that prints itself."""

    def __init__(self, stream: TextIO) -> None:
        """Take the stream that is written to."""
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        """Return everything else as of the stream."""
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text."""
        with self._going_on():
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Write what is in the buffer."""
        with self._going_on():
            self._stream.flush()

    @contextmanager
    def _going_on(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            _lead_nowhere(self._stream)


def _lead_nowhere(stream: TextIO) -> None:
    """Discard the buffer of a stream, so that it can be closed."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
