"""A collective function called by a program that runs on rank 0 alone, while the other ranks serve."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

from fenics_contact._libraries import MPI
from fenics_contact.errors import InvalidInputError, RemoteError, agree, collective

_CALL, _STOP = "call", "stop"


@contextmanager
def served(function: Callable[..., Any], comm: MPI.Comm) -> Iterator[Callable[..., Any] | None]:
    """Let rank 0 call a collective function as if it were serial, while the other ranks wait and join in.

    The block runs on every rank; on rank 0 it receives the function, on the others None, and these serve at
    its end until rank 0 leaves its block. An error of the function on any rank is raised by the call on rank
    0, which may continue; an error that leaves the block of one rank leaves that of all. So no rank waits for
    one that is gone.

    Arguments are sent from rank 0 (pickled); the value is that of rank 0.

    Example:
        >>> with served(response, comm) as call:  # doctest: +SKIP
        ...     if call is not None:
        ...         study = optuna.create_study()
        ...         study.optimize(lambda trial: call(load=trial.suggest_float("load", 1.0, 2.0))["peak"])

    Args:
        function: Called by all ranks with equal arguments. An error on one rank must not leave the others
            waiting inside the function; those of this package never do.
        comm: Communicator whose ranks serve.

    Yields:
        The function for rank 0, None on the other ranks.

    Raises:
        Exception: The error that left the block, on the rank itself; on the others one of the same class if
            it is one of this package's, else `RemoteError`.

    Note:
        Collective on ``comm``. Put code that only rank 0 should run under ``if call is not None``. Waiting
        ranks keep their cores busy.
    """
    if comm.rank == 0:
        call = _Call(function, comm)
        try:
            yield call
        except (SystemExit, KeyboardInterrupt) as leaving:
            call.stop(None, leaving)
            raise
        except Exception as error:
            call.stop(error)
            raise
        else:
            call.stop(None)
    else:
        mine: BaseException | None = None
        try:
            yield None
        except (Exception, SystemExit, KeyboardInterrupt) as error:
            mine = error
        _serve(function, comm, mine)


class _Call:
    """The function as called on rank 0."""

    def __init__(self, function: Callable[..., Any], comm: MPI.Comm) -> None:
        self._function, self._comm = function, comm
        self._open, self._process = True, os.getpid()
        # Two threads of a tool must not communicate with the other ranks at once.
        self._turn = threading.Lock()

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the function on all ranks; return what it returns on rank 0."""
        if os.getpid() != self._process:
            self._refuse()
        with self._turn:
            if not self._open:
                raise InvalidInputError(
                    "the function is served within its `with served(...)` block only, this one has ended: "
                    "call it inside, or open another block on all ranks"
                )
            self._comm.bcast((_CALL, arguments, named), root=0)
            return _called(self._function, self._comm, arguments, named, None)

    def stop(self, error: Exception | None, leaving: BaseException | None = None) -> None:
        """Release the other ranks."""
        with self._turn:
            if not self._open:
                return
            self._open = False
            self._comm.bcast((_STOP, type(leaving), leaving.args) if leaving else (_STOP, None, ()), root=0)
            if leaving is None:
                agree(self._comm, error)

    def __reduce__(self) -> NoReturn:
        """Refuse to be sent to another process."""
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise InvalidInputError(
            "a served function belongs to the process of rank 0, it was called or sent from there to "
            "another: let the outer tool run its evaluations one after the other (one worker, no process "
            "pool); MPI ranks share each of them"
        )


def _called(
    function: Callable[..., Any],
    comm: MPI.Comm,
    arguments: tuple[Any, ...],
    named: dict[str, Any],
    earlier: Exception | None,
) -> Any:
    """Call the function on this rank; all ranks raise if one does. Collective."""
    agree(comm, earlier)  # a rank that cannot serve reports it before any other waits for it
    with collective(comm, "the served function", closed=True):
        return function(*arguments, **named)


def _serve(function: Callable[..., Any], comm: MPI.Comm, left: BaseException | None) -> None:
    """Join in until rank 0 stops; a rank whose block ended in an error only reports it. Collective."""
    mine = left if left is None or isinstance(left, Exception) else RemoteError(f"the program left: {left!r}")
    while True:
        request = comm.bcast(None, root=0)
        if request[0] == _STOP:
            break
        try:
            _called(function, comm, request[1], request[2], mine)
        except BaseException:  # it is raised on rank 0, which decides whether to continue
            continue
    _, kind, arguments = request
    if kind is not None:
        raise kind(*arguments)
    try:
        agree(comm, mine)
    except RemoteError as error:
        if left is None or error is not mine:
            raise
        raise left from None
