"""What a rank sends, reduces and computes, counted where communication passes: in its communicator."""

from __future__ import annotations

import pickle
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache, singledispatch
from typing import Any, cast

import numpy as np

from fenics_contact._base.display import counted, displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import phase_under_way

#: Phases that prepare, and those that iterate; others recover.
SET_UP = frozenset({
    "mesh", "mesh motion", "decompose", "assemble", "factor", "coarse space", "preconditioner"
})  # fmt: skip
SOLVE = frozenset({"solve", "adjoint"})


@displayed
@dataclass(frozen=True)
class PhaseCosts:
    """Messages, collective calls and operations of one rank in a part of its work.

    What happens inside of libraries (MUMPS on several ranks, dolfinx) is not in it.

    Attributes:
        messages: Those of multipliers that this rank sends to others or receives from them: to neighbours,
            and of contact rows to the rank that holds their matrix.
        message_bytes: Bytes of these.
        reductions: Sums, largest and smallest values over all ranks, the same on each of them afterwards.
        reduction_bytes: Bytes of what this rank puts in.
        copies: Tables that all ranks hold afterwards: one rank's, or the parts of all put together.
        copy_bytes: Bytes of the whole tables.
        transfers: Calls in which every rank sends parts of a table to those that need them.
        transfer_bytes: Bytes that this rank receives in them.
        meetings: Points at which ranks wait for each other to learn of errors, of 8 bytes a rank.
        largest_reduction: Bytes of the largest of the reductions: that of the coarse matrix, while dense.
        largest_copy: Bytes of the largest of the copies.
        flops: Floating point operations of products with subdomains' matrices or factors, with B, with the
            coarse problem and the contact rows' factor. Those of factorisations are not in it.
    """

    messages: int = 0
    message_bytes: int = 0
    reductions: int = 0
    reduction_bytes: int = 0
    copies: int = 0
    copy_bytes: int = 0
    transfers: int = 0
    transfer_bytes: int = 0
    meetings: int = 0
    largest_reduction: int = 0
    largest_copy: int = 0
    flops: int = 0

    def __add__(self, other: PhaseCosts) -> PhaseCosts:
        """Return the costs of both together."""
        pairs = {each.name: (getattr(self, each.name), getattr(other, each.name)) for each in fields(self)}
        return PhaseCosts(
            **{name: max(pair) if name.startswith("largest") else sum(pair) for name, pair in pairs.items()}
        )

    def __str__(self) -> str:
        """Return what there is in a line."""
        calls = [
            (self.messages, "message", "", self.message_bytes),
            (self.reductions, "reduction", "", self.reduction_bytes),
            (self.copies, "copy", "copies", self.copy_bytes),
            (self.transfers, "transfer", "", self.transfer_bytes),
        ]
        parts = [f"{counted(n, one, many)} {_amount(size)}" for n, one, many, size in calls if n]
        parts += [counted(self.meetings, "meeting")] if self.meetings else []
        parts += [f"{self.flops:.3g} flops"] if self.flops else []
        return ", ".join(parts) or "nothing"


@displayed
@dataclass(frozen=True)
class Costs:
    """What one rank of several has sent, reduced and computed so far; see `State.costs`.

    One rank alone exchanges nothing, and counts operations only.

    Attributes:
        ranks: Number of ranks.
        phases: Name of a phase as in `State.seconds` -> its costs; "other": outside of phases, as for fields
            and forces of a state.

    Example:
        >>> costs = state.costs  # doctest: +SKIP
        >>> costs.solve.reductions, costs.solve.flops  # doctest: +SKIP
        >>> most = max(comm.allgather(costs.total.flops))  # doctest: +SKIP
    """

    ranks: int
    phases: Mapping[str, PhaseCosts]

    def _facts(self) -> dict[str, str]:
        total = self.total
        return {
            "ranks": str(self.ranks),
            "set-up": str(self.set_up),
            "solve": str(self.solve),
            "recovery": str(self.recovery),
            "largest": f"reduction {_amount(total.largest_reduction)}, copy {_amount(total.largest_copy)}",
        }

    @property
    def set_up(self) -> PhaseCosts:
        """Costs of meshes, matrices, factors, the coarse space and the preconditioner."""
        return self._sum(lambda name: name in SET_UP)

    @property
    def solve(self) -> PhaseCosts:
        """Costs of iterations of the dual solvers, those of adjoints among them."""
        return self._sum(lambda name: name in SOLVE)

    @property
    def recovery(self) -> PhaseCosts:
        """Costs of displacements, energies, fields, forces, errors and gradients."""
        return self._sum(lambda name: name not in SET_UP | SOLVE)

    @property
    def total(self) -> PhaseCosts:
        """Costs of all phases."""
        return self._sum(lambda _: True)

    def _sum(self, wanted: Any) -> PhaseCosts:
        return sum((part for name, part in self.phases.items() if wanted(name)), PhaseCosts())


def _amount(size: float) -> str:
    """Return a number of bytes in words."""
    for unit in ("B", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} GB"


class Ledger:
    """Counts of one rank by phase."""

    def __init__(self) -> None:
        """Start at zero."""
        self._phases: dict[str, Counter[str]] = {}

    def add(self, name: str, number: int = 1) -> None:
        """Add to a field of the costs of the phase under way."""
        self._counts[name] += number

    def call(self, kind: str, kinds: str, data: Sequence[Any]) -> None:
        """Add a collective call and the bytes of its data to those of a kind, in singular and plural."""
        counts, size = self._counts, sum(map(size_of, data))
        counts[kinds] += 1
        counts[f"{kind}_bytes"] += size
        if kind != "transfer":
            counts[f"largest_{kind}"] = max(counts[f"largest_{kind}"], size)

    @property
    def _counts(self) -> Counter[str]:
        name = phase_under_way() or "other"
        if name not in self._phases:
            self._phases[name] = Counter()
        return self._phases[name]

    def costs(self, ranks: int) -> Costs:
        """Return the counts so far."""
        return Costs(ranks, {name: PhaseCosts(**counts) for name, counts in self._phases.items()})


class NoLedger(Ledger):
    """What communicators without a ledger count with."""

    def add(self, name: str, number: int = 1) -> None:
        """Do nothing."""

    def call(self, kind: str, kinds: str, data: Sequence[Any]) -> None:
        """Do nothing."""


NO_LEDGER = NoLedger()


def with_ledger(comm: MPI.Comm) -> MPI.Comm:
    """Return the same communicator with a ledger, in which its calls are counted if it has several ranks."""
    if ledger_of(comm) is not NO_LEDGER:
        return comm
    recording: Any = _kinds()[comm.size > 1](comm)
    recording.ledger = Ledger()
    return cast("MPI.Comm", recording)


def ledger_of(comm: MPI.Comm) -> Ledger:
    """Return the ledger of a communicator."""
    return getattr(comm, "ledger", NO_LEDGER)


def costs_of(comm: MPI.Comm) -> Costs:
    """Return what this rank has sent over a communicator and computed so far; nothing without a ledger."""
    return ledger_of(comm).costs(comm.size)


def count_flops(comm: MPI.Comm, number: int) -> None:
    """Add floating point operations to those of the phase under way."""
    ledger_of(comm).add("flops", number)


def count_of_exchange(comm: MPI.Comm, owner: np.ndarray) -> tuple[int, int]:
    """Return the messages that this rank sends or receives if ranks exchange numbers, and their bytes.

    Collective on ``comm``. `owner`: rank, not this one, that owns each number that this rank shares.
    """
    if comm.size == 1:
        return 0, 0
    mine = np.bincount(owner, minlength=comm.size)
    comm.Alltoall(mine, theirs := np.empty_like(mine))
    return int(np.count_nonzero(mine) + np.count_nonzero(theirs)), 8 * int(mine.sum() + theirs.sum())


def count_messages(comm: MPI.Comm, exchange: tuple[int, int]) -> None:
    """Add the messages of an exchange and their bytes to those of the phase under way."""
    ledger = ledger_of(comm)
    if exchange[0]:
        ledger.add("messages", exchange[0])
        ledger.add("message_bytes", exchange[1])


@singledispatch
def size_of(data: Any) -> int:
    """Return the bytes of what is sent: of arrays their entries, of objects what pickle makes of them.

    Example:
        >>> size_of(np.zeros(10)), size_of(1.0)
        (80, 8)
    """
    arrays: list[pickle.PickleBuffer] = []  # which are not copied
    words = pickle.dumps(data, 5, buffer_callback=arrays.append)
    return len(words) + sum(part.raw().nbytes for part in arrays)


size_of.register(np.ndarray, lambda data: data.nbytes)
for _number in (int, float, np.generic):
    size_of.register(_number, lambda data: 8)


@cache
def _kinds() -> tuple[type, type]:
    """Return the classes of communicators with a ledger: one rank's, and several ranks', which count.

    Both are made on first use, as MPI is loaded late.
    """

    class Alone(MPI.Intracomm):  # type: ignore[misc, valid-type, name-defined]
        """A communicator of one rank: its calls are those of MPI, and only operations are counted."""

        __module__ = "mpi4py.MPI"  # petsc4py takes no communicator of a class from elsewhere
        ledger: Ledger = NO_LEDGER  # of duplicates and parts

    class Counting(Alone):
        """A communicator that counts its calls; those of MPI that it does not list are not counted."""

        __module__ = "mpi4py.MPI"

        def allreduce(self, sendobj: Any, *more: Any, **named: Any) -> Any:
            self._count("reduction", "reductions", sendobj)
            return super().allreduce(sendobj, *more, **named)

        def Allreduce(self, sendbuf: Any, recvbuf: Any, *more: Any, **named: Any) -> None:
            self._count("reduction", "reductions", recvbuf)
            super().Allreduce(sendbuf, recvbuf, *more, **named)

        def allgather(self, sendobj: Any) -> Any:
            self._count("copy", "copies", *(parts := super().allgather(sendobj)))
            return parts

        def bcast(self, obj: Any, *more: Any, **named: Any) -> Any:
            self._count("copy", "copies", given := super().bcast(obj, *more, **named))
            return given

        def Bcast(self, buf: Any, *more: Any, **named: Any) -> None:
            self._count("copy", "copies", buf)
            super().Bcast(buf, *more, **named)

        def gather(self, sendobj: Any, *more: Any, **named: Any) -> Any:
            parts = super().gather(sendobj, *more, **named)
            others = [] if parts is None else [*parts[: self.rank], *parts[self.rank + 1 :]]
            self._count("transfer", "transfers", *others)
            return parts

        def alltoall(self, sendobj: Any) -> Any:
            parts = super().alltoall(sendobj)
            self._count("transfer", "transfers", *parts[: self.rank], *parts[self.rank + 1 :])
            return parts

        def Alltoallv(self, sendbuf: Any, recvbuf: Any) -> None:
            super().Alltoallv(sendbuf, recvbuf)
            values, counts = recvbuf
            own = slice(start := int(counts[: self.rank].sum()), start + int(counts[self.rank]))
            self._count("transfer", "transfers", np.delete(values, own))

        def _count(self, kind: str, kinds: str, *data: Any) -> None:
            self.ledger.call(kind, kinds, data)

    return Alone, Counting
