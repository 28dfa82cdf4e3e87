"""The exchange by which ranks meet: each reports where it is, and learns where the others are.

It takes place on a communicator of this package's own, a duplicate of the user's. Ranks poll for the others
instead of waiting inside MPI, so that they can report what they wait for, receive an interrupt, and give up.
A rank whose program has ended answers until those of the others have ended, too.
"""

from __future__ import annotations

import atexit
import logging
import os
import sys
import time
import zlib
from array import array
from functools import cache
from typing import TYPE_CHECKING, Any, cast

from fenics_contact.errors.telling import safe_log

if TYPE_CHECKING:  # these errors also report that mpi4py is missing
    from mpi4py import MPI

#: Seconds that a rank which failed in collective calls waits for the others: as long as the calls took so
#: far, but within these limits.
SHORTEST_WAIT, LONGEST_WAIT = 5.0, 60.0
#: Seconds after which a rank reports where it waits for the others.
PATIENCE = 30.0
#: Waiting ranks poll again after this fraction of the time waited, and at most after this many seconds.
PAUSE, LONGEST_PAUSE = 0.05, 5e-3
#: What a failed rank reports instead of its position.
FAILED = 0
#: Position of ranks whose program has ended.
ENDED = "nothing any more, for its program has ended"

#: Duplicates in use: ranks that meet there are answered at the end of the program, too.
_open: dict[int, MPI.Comm] = {}
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
    key = _key(kind)
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

    Attributes:
        places: Where all ranks are, once `ended` is true.
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

    Args:
        own: The communicator from `own_of`.
        error: This rank's error, or None.
        where: Name of this rank's call.
        wait: Seconds after which a rank with an error ends the program; None for never.
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

    Args:
        process: Id of the process that is the rank; forked children are not ranks.
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
