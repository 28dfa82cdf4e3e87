"""Tables that all ranks need, made and held once a machine.

One rank of each machine makes an object; the bytes of its arrays go into a file in memory that has no name,
which the others map read-only. A file in memory rather than a window of MPI, as freeing a window is
collective and its owners are collected at other times on other ranks, and because windows leave files behind
where a rank is killed: here each rank unmaps when its last array is gone, and the system frees the memory
when no rank maps it, however the ranks end. Where a rank cannot map it (ranks in containers that do not see
each other, no Linux), all of the machine hold copies.
"""

from __future__ import annotations

import mmap
import os
import pickle
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, TypeVar, cast

import numpy as np

from fenics_contact._base.checks import brief
from fenics_contact._base.costs import ledger_of
from fenics_contact._base.libraries import MPI
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.ranks import own_of

Found = TypeVar("Found")


def once_a_machine(comm: MPI.Comm, make: Callable[[], Found]) -> Found:
    """Return what a function makes on one rank of each machine, on all ranks. Collective on ``comm``.

    Arrays in it are held once a machine, where they are large; where a machine has several ranks, they are
    read-only. One rank alone gets the object itself.

    Args:
        comm: Communicator.
        make: Makes the object without communication, the same on every machine. What it makes can be pickled;
            arrays are contiguous.

    Raises:
        BaseException: What the function raises, on all ranks.
        InvalidInputError: If it is no function.

    Example:
        >>> from mpi4py import MPI
        >>> once_a_machine(MPI.COMM_SELF, lambda: np.arange(3))
        array([0, 1, 2])
    """
    if not callable(make):
        raise InvalidInputError(f"make must be a function of no argument, got {brief(make)}: write a lambda")
    if comm.size == 1:
        return make()
    machine, packed, file = ranks_of_machine(comm), _NOTHING, _NO_FILE
    with together(comm):
        if machine.size == 1:
            return make()
        if machine.rank == 0:
            packed = _Packed.of(make())
            file = _File.written(packed)
    return cast(Found, _spread(comm, machine, packed, file))


def is_shared(array: np.ndarray) -> bool:
    """Return whether the ranks of a machine hold an array together."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    return isinstance(base, memoryview) and isinstance(base.obj, mmap.mmap)


def ranks_of_machine(comm: MPI.Comm) -> MPI.Comm:
    """Return the ranks on this rank's machine, which `comm` owns. Collective on ``comm`` on first use."""
    if comm.size == 1:
        return comm
    key = _key(type(comm).__mro__[-2])
    ranks = comm.Get_attr(key)
    if ranks is None:
        ranks = own_of(comm).Split_type(MPI.COMM_TYPE_SHARED)
        comm.Set_attr(key, ranks)
    return cast("MPI.Comm", ranks)


def count_as_machine(comm: MPI.Comm, ranks: MPI.Comm) -> None:
    """Take some ranks for those of a machine from now on, a part of them for example: for tests."""
    comm.Set_attr(_key(type(comm).__mro__[-2]), ranks)


@cache
def _key(kind: Any) -> int:
    """Return the key under which MPI stores the ranks of a machine with communicators of a class."""
    return int(kind.Create_keyval(delete_fn=lambda comm, key, ranks: ranks.Free()))


@dataclass(frozen=True)
class _Packed:
    """An object without its arrays, and the bytes of these."""

    words: bytes
    buffers: Sequence[memoryview]

    #: Places of arrays are multiples of this.
    step: ClassVar[int] = 64
    #: Bytes from which they are shared; smaller ones are sent.
    least: ClassVar[int] = 1 << 16

    @classmethod
    def of(cls, made: object) -> _Packed:
        """Pack an object; its arrays are not copied."""
        buffers: list[pickle.PickleBuffer] = []
        words = pickle.dumps(made, 5, buffer_callback=buffers.append)
        return cls(words, [each.raw() for each in buffers])

    @property
    def spans(self) -> list[tuple[int, int]]:
        """Where each array begins and ends in a block."""
        sizes = [each.nbytes for each in self.buffers]
        starts = np.cumsum([0] + [-(-size // self.step) * self.step for size in sizes]).tolist()
        return [(start, start + size) for start, size in zip(starts, sizes, strict=False)]

    @property
    def size(self) -> int:
        """Bytes of a block."""
        return self.spans[-1][1] if self.buffers else 0

    def block(self) -> np.ndarray:
        """Return a copy of the arrays, one after the other."""
        block = np.zeros(self.size, dtype=np.uint8)
        for (start, end), each in zip(self.spans, self.buffers, strict=True):
            block[start:end] = np.frombuffer(each, dtype=np.uint8)
        return block


_NOTHING = _Packed(b"", ())


@dataclass(frozen=True)
class _File:
    """A file in memory: the process that has made it, its descriptor there, and what tells it from others."""

    process: int
    descriptor: int
    device: int
    number: int
    size: int

    #: Bytes that the system writes in one call.
    most: ClassVar[int] = 1 << 30

    @classmethod
    def written(cls, packed: _Packed) -> _File:
        """Write arrays into a file that nobody can change; none where there is no memory or no such file."""
        size = packed.size
        if size < packed.least or not hasattr(os, "memfd_create"):
            return _NO_FILE
        import fcntl  # not everywhere

        descriptor = -1
        try:
            descriptor = os.memfd_create("fenics_contact", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
            os.ftruncate(descriptor, size)
            for (start, end), each in zip(packed.spans, packed.buffers, strict=True):
                while start < end:
                    rest = each[each.nbytes - (end - start) :][: cls.most]
                    start += os.pwrite(descriptor, rest, start)
            seals = fcntl.F_SEAL_SEAL | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_WRITE
            fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, seals)
        except OSError:
            if descriptor >= 0:
                os.close(descriptor)
            return _NO_FILE
        status = os.fstat(descriptor)
        return cls(os.getpid(), descriptor, status.st_dev, status.st_ino, size)

    def mapped(self) -> list[memoryview]:
        """Map the file; nothing where this rank does not see that process, or another one of this number."""
        with suppress(OSError, ValueError):
            descriptor = os.open(f"/proc/{self.process}/fd/{self.descriptor}", os.O_RDONLY | os.O_CLOEXEC)
            try:
                found = os.fstat(descriptor)
                if (found.st_dev, found.st_ino, found.st_size) == (self.device, self.number, self.size):
                    return [memoryview(mmap.mmap(descriptor, self.size, mmap.MAP_SHARED, mmap.PROT_READ))]
            finally:
                os.close(descriptor)
        return []


_NO_FILE = _File(0, -1, 0, 0, 0)


def _spread(comm: MPI.Comm, machine: MPI.Comm, packed: _Packed, file: _File) -> object:
    """Return the object that the first rank of a machine has packed, on all ranks of the machine."""
    words, spans, file = machine.bcast((packed.words, packed.spans, file))
    blocks = list[memoryview]()
    if file.size:
        blocks = file.mapped()
        all_see = machine.allreduce(len(blocks) > 0, MPI.LAND)
        if machine.rank == 0:
            os.close(file.descriptor)  # all have mapped it, or never will
        blocks = blocks if all_see else []
    copied = [] if blocks else [_sent(machine, packed, spans)]
    ledger_of(comm).call("copy", "copies", [words, *copied])
    (block,) = blocks or [each.data for each in copied]
    return pickle.loads(words, buffers=[block[start:end] for start, end in spans])


def _sent(machine: MPI.Comm, packed: _Packed, spans: Sequence[tuple[int, int]]) -> np.ndarray:
    """Return a copy of the arrays on every rank of a machine, one after the other. Collective on it."""
    block = packed.block() if machine.rank == 0 else np.empty(spans[-1][1] if spans else 0, dtype=np.uint8)
    for start in range(0, len(block), _File.most):
        machine.Bcast(block[start : start + _File.most])
    block.setflags(write=False)
    return block
