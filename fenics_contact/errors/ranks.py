"""An error of one rank becomes an error of all.

It takes place on a communicator of this package's own, a duplicate of the user's. Ranks poll for the others
instead of waiting inside MPI, so that they can report what they wait for, receive an interrupt, and give up.
A rank whose program has ended answers until those of the others have ended, too.

Every point at which ranks agree is the same exchange on a communicator of this package's own: the end of a
block that fails or succeeds on each rank by itself (`together`), and the beginning of a function that all
ranks must call (`collective`). So a rank that has failed anywhere notifies the others at the next such point
that they reach, and so does one whose program has ended. Ranks that wait inside an MPI call which the failed
one will never make cannot be notified; if no other rank arrives, the failed one ends the program on all of
them.
"""

from __future__ import annotations

import atexit
import logging
import os
import sys
import time
import zlib
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, wraps
from inspect import Signature, signature
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar, cast

from fenics_contact.errors.kinds import (
    FenicsContactError,
    InvalidInputError,
    RemoteError,
    described_error,
    failure,
    safe_log,
)
from fenics_contact.errors.memory import naming_memory

if TYPE_CHECKING:
    from mpi4py import MPI


#: Least time that a rank which failed in collective calls waits for the others, [s]; more if the calls took
#: longer so far.
SHORTEST_WAIT = 5.0
#: Longest time that it waits, [s].
LONGEST_WAIT = 60.0
#: Seconds after which a rank reports where it waits for the others.
PATIENCE = 30.0
#: Waiting ranks poll again after this fraction of the time waited,
PAUSE = 0.05
#: and at most after this time, [s].
LONGEST_PAUSE = 5e-3
#: What a failed rank reports instead of its position.
FAILED = 0
#: Position of ranks whose program has ended.
ENDED = "nothing any more, for its program has ended"

#: Duplicates in use, on all ranks in the order in which they were made: ranks that meet there are answered at
#: the end of the program, too.
_open: dict[int, MPI.Comm] = {}
#: What the ranks of each of them do together once all have come to the end.
_last: list[Callable[[MPI.Comm], None]] = []
_LOG = logging.getLogger(__name__)
_WAITING = (
    "rank %d waits since %.0f s for the others in %s, which is collective: if they are not just slower, call "
    "it on every rank, outside of blocks like `if comm.rank == 0`"
)
_FIRST = "the first call of this package with this communicator (or did one of them end with an error?)"
_ENDING = (
    "rank %d failed in %s, and the other ranks wait for it where they cannot be told: the program is ended "
    "on all ranks"
)


def own_of(comm: MPI.Comm) -> MPI.Comm:
    """Return the duplicate of a communicator on which ranks meet, separate from users' messages.

    Collective on ``comm`` on first use.
    """
    kind: Any = type(comm)
    key = _key(kind.__mro__[-2])  # of any kind: one with counts shares the duplicate of that without
    own: Any = comm.Get_attr(key)
    if own is None:
        own = _duplicated(comm)
        comm.Set_attr(key, own)
        _open[id(own)] = own
    # Handlers run in reverse order: this one before the end of PETSc, which waits for ranks and may be
    # recent.
    atexit.unregister(_answer_until_all_have_ended)
    atexit.register(_answer_until_all_have_ended, os.getpid())
    return cast("MPI.Comm", own)


def at_common_end(function: Callable[[MPI.Comm], None]) -> None:
    """Call a function with each communicator on which ranks met, when their programs have all ended.

    The function may communicate there: the ranks call it in the same order, while MPI and PETSc still run.
    """
    _last.append(function)


def _duplicated(comm: MPI.Comm) -> MPI.Comm:
    """Return a duplicate of a communicator, with a word where the others do not come. Collective.

    A rank that has failed before it ever met the others, as in the description of a scene, cannot be heard.
    """
    own, request = comm.Idup()
    begun, warned = time.monotonic(), False
    while not request.Test():
        waited = time.monotonic() - begun
        if waited > PATIENCE and not warned:
            warned = True
            safe_log(_LOG.warning, _WAITING, comm.rank, waited, _FIRST)
        time.sleep(min(PAUSE * waited, LONGEST_PAUSE))
    return own


@cache
def _key(kind: Any) -> int:
    """Return the key under which MPI stores an attribute of this module with communicators of a class."""
    return int(kind.Create_keyval(delete_fn=_freed))


def _freed(comm: MPI.Comm, key: int, own: MPI.Comm) -> None:
    _open.pop(id(own), None)
    own.Free()


class Post:
    """One exchange under way.

    `places`: where all ranks are, once `ended` is true.
    """

    def __init__(self, own: MPI.Comm, place: int) -> None:
        """Report where this rank is."""
        self._mine, self.places = array("q", [place]), array("q", [0]) * own.size
        self._request = own.Iallgather(self._mine, self.places)

    def ended(self) -> bool:
        """Return whether all ranks have reported where they are."""
        return bool(self._request.Test())


def place_of(where: str) -> int:
    """Return the number by which ranks compare where they are."""
    return 1 + zlib.crc32(where.encode())


def exchanged(
    own: MPI.Comm, error: BaseException | None, where: str, wait: float | None
) -> tuple[list[int], BaseException | None]:
    """Return where all ranks are, and this rank's error, possibly an interrupt received while waiting.

    `where`: name of this rank's call; `wait`: seconds after which a rank with an error ends the program; None
    for never.
    """
    post = Post(own, place_of(where) if error is None else FAILED)
    begun, warned = time.monotonic(), not where
    while True:
        try:
            if post.ended():
                return list(post.places), error
            waited = time.monotonic() - begun
            if error is not None and wait is not None and waited > wait:
                safe_log(_LOG.critical, _ENDING, own.rank, where or "a collective call", exc_info=error)
                own.Abort(1)
            if error is None and waited > PATIENCE and not warned:
                warned = True
                safe_log(_LOG.warning, _WAITING, own.rank, waited, where)
            time.sleep(min(PAUSE * waited, LONGEST_PAUSE))
        except BaseException as caught:
            # The exchange must end before its buffers are freed: an interrupt waits for that, but not for
            # ever.
            if error is not None or type(caught).__module__.startswith("mpi4py"):
                raise
            error, wait = caught, SHORTEST_WAIT + time.monotonic() - begun


def _answer_until_all_have_ended(process: int) -> None:
    """Stay until the other ranks have ended, too, as MPI itself would, but answer those that call.

    `process`: id of the process that is the rank; forked children are not ranks.
    """
    finalized = any(sys.modules[type(own).__module__].Is_finalized() for own in _open.values())
    if os.getpid() != process or finalized:
        return
    place, begun = place_of(ENDED), time.monotonic()
    posts = {key: Post(own, place) for key, own in _open.items()}
    while posts:
        for key, post in list(posts.items()):
            if not post.ended():
                continue
            if set(post.places) == {place}:
                del posts[key]
                continue
            _open[key].allgather(None if FAILED in post.places else ENDED)
            posts[key] = Post(_open[key], place)
        time.sleep(min(PAUSE * (time.monotonic() - begun), LONGEST_PAUSE))
    for own in _open.values():
        for function in _last:
            function(own)


#: Marks errors that all ranks have raised already.
_AGREED = "_fenics_contact_agreed"

Given = ParamSpec("Given")
Found = TypeVar("Found")


def agree(
    comm: MPI.Comm,
    error: BaseException | None,
    where: str = "",
    *,
    wait: float | None = None,
    users: bool = False,
) -> None:
    """Let all ranks raise as soon as one of them has an error.

    A rank with an error of its own raises that; a rank without one raises an error of the
    same class with the message of the lowest failing rank. Collective on ``comm``.

    Args:
        comm: Communicator whose ranks must stay together.
        error: This rank's error, or None.
        where: Name of the call; it must be the same on all ranks.
        wait: Seconds after which a rank with an error ends the program, because the others wait in a call
            that it will not make; None where they are sure to arrive.
        users: This rank's error comes from user code. If other ranks have none, all raise a `UserCodeError`
            instead; one that all have, such as an exception by which the user stops a run, is unchanged.

    Raises:
        BaseException: ``error`` itself where there is one.
        FenicsContactError: On the other ranks, of the failing rank's class where that is one of
            this package's, else `RemoteError`; exits and interrupts are unchanged.
        InvalidInputError: If ranks make different calls.
    """
    if comm.size == 1:
        if error is not None:
            raise error
        return
    own = own_of(comm)
    if (ledger := getattr(comm, "ledger", None)) is not None:
        ledger.add("meetings")
    places, stop = exchanged(own, error, where, wait)
    if FAILED in places:
        named = _named(stop, where) if users else stop
        reports = own.allgather(None if named is None else _report(named))
        if named is not None:
            raise _marked(named if None in reports else stop or named)
        raise _marked(_remote(reports))
    if len(set(places)) > 1:
        raise _marked(_strayed(own.allgather(where)))
    if stop is not None:
        raise stop


@contextmanager
def together(comm: MPI.Comm, where: str = "", *, wait: float | None = None) -> Iterator[None]:
    """Run a block that makes no collective calls, then raise on all ranks if it failed on one.

    Collective on ``comm``, which the block itself must not use.

    Args:
        comm: Communicator whose ranks must stay together.
        where: As for `agree`.
        wait: As for `agree`; some ranks may call each other in the block if it is given.

    Raises:
        BaseException: The error of the block on this rank, or as in `agree` that on another.

    Example:
        >>> with together(comm):  # doctest: +SKIP
        ...     if comm.rank == 0:
        ...         text = path.read_text()
    """
    error: BaseException | None = None
    try:
        yield
    except GeneratorExit:
        raise
    except BaseException as caught:
        error = naming_memory(caught)
    agree(comm, error, where, wait=wait)


def on_root_then_bcast(comm: MPI.Comm | None, make: Callable[[], Found]) -> Found:
    """Return what a function makes on rank 0, on all ranks; without a communicator what it makes here.

    Collective on ``comm`` if given; ``make`` must not use it.
    """
    if comm is None:
        return make()
    made: Found | None = None
    with together(comm):
        made = make() if comm.rank == 0 else None
    return cast(Found, comm.bcast(made))


@contextmanager
def collective(comm: MPI.Comm, where: str, *, closed: bool = False, users: bool = False) -> Iterator[None]:
    """Run a block that makes collective calls; an error of one rank becomes an error of all.

    The ranks meet at its beginning: there they learn of a failure of another one since the last meeting, and
    of ranks that make a different call. A rank that fails inside notifies the others where these meet next.
    If they do not, because they wait in an MPI call for the failed one, it ends the program: an error is
    logged, and all ranks are aborted.

    Args:
        comm: Communicator whose ranks run the block.
        where: Its name, for messages.
        closed: Meet at its end, too, so that after it no rank has failed in it.
        users: It is user code, as for `agree`.

    Raises:
        BaseException: As `agree`.
    """
    agree(comm, None, where)
    begun = time.perf_counter()
    try:
        yield
    except GeneratorExit:
        raise
    except BaseException as caught:
        error = naming_memory(caught)
        if comm.size > 1 and not hasattr(error, _AGREED):
            wait = min(max(time.perf_counter() - begun, SHORTEST_WAIT), LONGEST_WAIT)
            agree(comm, error, where, wait=wait, users=users)
        if error is not caught:
            raise error from caught
        raise
    if closed:
        agree(comm, None, f"the end of {where}")


def collectively(
    where: str, comm_of: Callable[..., MPI.Comm]
) -> Callable[[Callable[Given, Found]], Callable[Given, Found]]:
    """Make a whole function a `collective` block.

    Args:
        where: Its name, for messages.
        comm_of: Takes its arguments, returns the communicator.

    Raises:
        InvalidInputError: When it is called with arguments that have no communicator.

    Example:
        >>> @collectively("Model.solve", lambda self: self.comm)
        ... def solve(self): ...
    """

    def guarded(function: Callable[Given, Found]) -> Callable[Given, Found]:
        wanted = signature(function)

        @wraps(function)
        def called(*arguments: Given.args, **named: Given.kwargs) -> Found:
            comm = _communicator(wanted, where, comm_of, arguments, named)
            with collective(comm, where):
                return function(*arguments, **named)

        return called

    return guarded


def _communicator(
    wanted: Signature,
    where: str,
    comm_of: Callable[..., MPI.Comm],
    arguments: tuple[Any, ...],
    named: dict[str, Any],
) -> MPI.Comm:
    """Return the communicator in the arguments of a call."""
    cause: Exception | None = None
    try:
        wanted.bind(*arguments, **named)
        comm = comm_of(*arguments, **named)
        if hasattr(comm, "allreduce"):
            return comm
    except (TypeError, AttributeError, LookupError) as error:
        cause = error
    names = [name for name in wanted.parameters if name != "self"]
    given = [type(each).__name__ for each in arguments[len(arguments) and "self" in wanted.parameters :]]
    given += [f"{name}={type(value).__name__}" for name, value in named.items()]
    raise InvalidInputError(
        f"{where} takes ({', '.join(names)}), got ({', '.join(given)}): give what is needed in this order, "
        "as communicator one of mpi4py: MPI.COMM_WORLD for all ranks"
    ) from cause


Report = tuple[type[BaseException], str, Any]


def _report(error: BaseException) -> Report:
    """Return the data for other ranks: a class that they know, the message, the status of an exit."""
    kind = type(error)
    if isinstance(error, FenicsContactError) and kind.__module__.startswith("fenics_contact."):
        return kind, str(error), None
    if isinstance(error, SystemExit):
        return SystemExit, str(error), error.code if isinstance(error.code, int | str) else 1
    if isinstance(error, KeyboardInterrupt):
        return KeyboardInterrupt, str(error), None
    return RemoteError, described_error(error), None


def _named(error: BaseException | None, where: str) -> BaseException | None:
    """Return an error of user code as one that names the code."""
    if isinstance(error, FenicsContactError) or not isinstance(error, Exception):
        return error
    named = failure(where, error)
    named.__cause__ = error
    return named


def _remote(reports: list[Report | None]) -> BaseException:
    """Return the error for a rank without one of its own."""
    rank, (kind, message, code) = next((r, report) for r, report in enumerate(reports) if report is not None)
    if kind is SystemExit:
        return SystemExit(code)
    text = f"{message} (met on rank {rank})" if message else f"met on rank {rank}"
    try:
        return kind(text)
    except TypeError:  # a class whose constructor needs more than a message
        return RemoteError(f"{kind.__name__}: {text}")


def _strayed(places: list[str]) -> InvalidInputError:
    """Return the error for ranks that make different calls."""
    other = next(rank for rank, place in enumerate(places) if place != places[0])
    first, second = (place or "a step inside the package" for place in (places[0], places[other]))
    return InvalidInputError(
        f"all ranks must make the same collective calls in the same order, but rank 0 calls {first} and rank "
        f"{other} {second}: take them out of blocks like `if comm.rank == 0`"
    )


def _marked(error: BaseException) -> BaseException:
    with suppress(AttributeError):
        setattr(error, _AGREED, True)
    return error
