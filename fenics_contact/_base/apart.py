"""A process that calls functions for this one, which goes on if libraries crash there.

Libraries in C++ that read files of other programs end the whole process where a file misleads them, by a
signal that Python cannot catch. multiprocessing is no help: forked processes share what MPI and threads hold,
and spawned ones run the caller's script once more.
"""

from __future__ import annotations

import logging
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, ParamSpec, TypeVar, cast

from fenics_contact._base.launching import clean_environment
from fenics_contact.errors import FenicsContactError, InvalidInputError, UserCodeError

Given = ParamSpec("Given")
Found = TypeVar("Found")

#: What the process runs, with the folders of this one's modules.
_START = "import sys; sys.path[:] = sys.argv[3:]; from fenics_contact._base.apart import serve; serve()"


@dataclass
class _Reply:
    """What came of a call, with what it logged and warned of."""

    value: Any = None
    error: Exception | None = None
    records: list[logging.LogRecord] = field(default_factory=list)
    warned: list[tuple[str, type[Warning], str, int]] = field(default_factory=list)

    def found(self) -> Any:
        """Return the value, or raise the error, after all else that was reported."""
        for record in self.records:
            logger = logging.getLogger(record.name)
            if logger.isEnabledFor(record.levelno):
                logger.handle(record)
        for words in self.warned:
            warnings.warn_explicit(*words)
        if self.error is not None:
            raise self.error
        return self.value


class OwnProcess:
    """A Python of its own, without the traces of MPI; what one call leaves in memory the next one finds.

    Example:
        >>> with OwnProcess("the comparison", "compare less") as process:
        ...     process.call(max, 1, 2)
        2
    """

    def __init__(self, doing: str, advice: str) -> None:
        """Store what the process is for and what to do if it crashes, for the error."""
        self._doing, self._advice = doing, advice

    def __enter__(self) -> OwnProcess:
        """Start it."""
        self._here, there = Pipe()
        self._errors = tempfile.TemporaryFile()
        numbers = [str(there.fileno()), str(os.getpid())]
        with there:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _START, *numbers, *sys.path], pass_fds=[there.fileno()],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=self._errors,
                env=clean_environment(),
            )  # fmt: skip
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it, whatever it does."""
        self._here.close()
        self._process.kill()
        self._process.wait()
        self._errors.close()

    def call(self, function: Callable[Given, Found], *arguments: Given.args, **named: Given.kwargs) -> Found:
        """Return what a function of a module returns there; its errors, warnings and logs come here, too."""
        try:
            self._here.send((function, arguments, named))
            reply = self._here.recv()
        except (EOFError, ConnectionError) as lost:
            raise InvalidInputError(
                f"{self._doing} must end, but the process {self._ending()}: {self._advice}"
            ) from lost
        return cast(Found, reply.found())

    def _ending(self) -> str:
        """Return in words how the process ended, with the last that libraries wrote."""
        code = self._process.wait()
        self._errors.seek(0)
        last = " ".join(self._errors.read().decode(errors="replace").split())[-300:]
        words = f", its last words: {last}" if last else ""
        if code < 0:
            return f"crashed (signal {-code}, {signal.strsignal(-code)}{words})"
        return f"ended itself (exit status {code}{words})"


def serve() -> None:
    """Call functions for the process that started this one, until it has no more or is gone."""
    connection = Connection(int(sys.argv[1]))
    threading.Thread(target=_end_with, args=[int(sys.argv[2])], daemon=True).start()
    try:
        while True:
            connection.send_bytes(_pickled(_reply(*connection.recv())))
    except (EOFError, ConnectionError, KeyboardInterrupt):
        os._exit(0)  # libraries crash at their end, too


def _end_with(parent: int, pause: float = 1.0) -> None:
    """End this process, even in the middle of a library that never returns, when its parent has ended."""
    while os.getppid() == parent:
        time.sleep(pause)
    os._exit(1)


def _reply(function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> _Reply:
    reply = _Reply()
    handler = _Kept(reply.records)
    logger = logging.getLogger("fenics_contact")
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            reply.value = function(*arguments, **named)
        except Exception as error:
            if not isinstance(error, FenicsContactError):
                error.add_note(f"in a process of its own:\n{traceback.format_exc()}")
            reply.error = error
    logger.removeHandler(handler)
    reply.warned = [(str(each.message), each.category, each.filename, each.lineno) for each in caught]
    return reply


def _pickled(reply: _Reply) -> bytes:
    """Return the reply as bytes; an error that cannot be sent becomes its words."""
    try:
        data = pickle.dumps(reply)
        pickle.loads(data)
    except Exception as error:
        words = traceback.format_exception_only(reply.error or error)
        reply.value, reply.error = None, UserCodeError("".join(words).strip())
        data = pickle.dumps(reply)
    return data


class _Kept(logging.Handler):
    """Keeps records, in words."""

    def __init__(self, records: list[logging.LogRecord]) -> None:
        super().__init__()
        self._records = records

    def emit(self, record: logging.LogRecord) -> None:
        record.msg, record.args, record.exc_info = record.getMessage(), None, None
        self._records.append(record)
