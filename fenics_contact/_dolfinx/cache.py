"""The cache of compiled forms: runs at once share it, what is left over or spoilt is compiled again.

ffcx marks a module by its ``.c`` file before it compiles and by a ``.c.cached`` file when the library is
there; who finds the first alone waits ten seconds for the second and gives up. So a run that is killed in
between spoils the form for all later ones, and a compiler that takes longer ends the runs that wait.
A full disk leaves half a library, another C library one that cannot be loaded.
"""

from __future__ import annotations

import fcntl
import logging
import os
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

_LOG = logging.getLogger(__name__)

#: Seconds without a change after which files are taken for left over where their compiler held no lock: it
#: was a program that uses dolfinx alone.
PATIENCE = 60.0


@contextmanager
def compiled_once() -> Iterator[None]:
    """Have ffcx compile under a lock for each module, which a killed holder frees."""
    from ffcx.codegeneration import jit

    lookup = jit.get_cached_module

    def locked_lookup(module_name: str, object_names: Any, cache_dir: Any, timeout: Any) -> Any:
        module = Path(cache_dir) / module_name
        held.close()
        held.enter_context(_alone(module))
        before = _stamps(module)
        try:
            return lookup(module_name, object_names, cache_dir, timeout)
        except (AttributeError, ImportError) as error:
            _remove_spoilt(module, before, error)
        held.close()
        held.enter_context(_alone(module))
        return lookup(module_name, object_names, cache_dir, timeout)

    with ExitStack() as held:  # until the library is written, which the lookup leaves to its caller
        jit.get_cached_module = locked_lookup
        try:
            yield
        finally:
            jit.get_cached_module = lookup


@contextmanager
def _alone(module: Path) -> Iterator[None]:
    """Hold the right to compile a module, unless it is ready."""
    if _ready(module):
        yield
        return
    lock = module.with_suffix(".lock")
    try:
        module.parent.mkdir(exist_ok=True, parents=True)
        file, killed = _locked(lock)
    except OSError:  # nobody can write there, or lock: as ffcx does it alone
        yield
        return
    try:
        _remove_left_over(module, lock, killed)
        yield
    finally:
        if not _ready(module):  # stopped by a key, say
            module.with_suffix(".c").unlink(missing_ok=True)
        lock.unlink(missing_ok=True)
        os.close(file)


def _ready(module: Path) -> bool:
    """Return whether the library of a module is complete, for this Python."""
    return module.with_suffix(".c.cached").exists() and any(map(_is_whole, _libraries(module)))


def _libraries(module: Path) -> list[Path]:
    """Return the names that the library of a module may have."""
    return [module.with_suffix(suffix) for suffix in EXTENSION_SUFFIXES]


def _is_whole(library: Path) -> bool:
    """Return whether a library is there to its end: loading a part of one may end the process.

    The header of an ELF file of 64 bits says where the table is that ends it.
    """
    try:
        with library.open("rb") as file:
            header, size = file.read(64), os.fstat(file.fileno()).st_size
    except OSError:
        return False
    if not header.startswith(b"\x7fELF\x02") or len(header) < 64:
        return size > 64
    (table,) = struct.unpack_from("<Q", header, 40)
    entry, entries = struct.unpack_from("<HH", header, 58)
    return size >= int(table) + entry * entries


def _stamps(module: Path) -> list[tuple[int, int, int]]:
    """Return what distinguishes libraries of a module from others that replace them."""
    found = []
    for library in _libraries(module):
        with suppress(OSError):
            known = library.stat()
            found.append((known.st_ino, known.st_mtime_ns, known.st_size))
    return found


def _remove_spoilt(module: Path, before: list[tuple[int, int, int]], error: Exception) -> None:
    """Remove a library that cannot be loaded, unless another process has replaced it."""
    if _stamps(module) != before:
        return
    _LOG.warning("%s has a library that cannot be loaded (%s); it is compiled again", module, error)
    _remove(module)


def _remove(module: Path) -> None:
    for file in [module.with_suffix(".c"), module.with_suffix(".c.cached"), *_libraries(module)]:
        file.unlink(missing_ok=True)


def _locked(lock: Path) -> tuple[int, bool]:
    """Return an open lock file that this process alone holds, and whether its last holder was killed."""
    while True:
        try:
            file, found = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_EXCL), False
        except FileExistsError:
            file, found = os.open(lock, os.O_RDWR | os.O_CREAT), True
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
            if os.path.samestat(os.fstat(file), os.stat(lock)):
                return file, found
        except FileNotFoundError:  # its holder has finished
            pass
        except BaseException:
            os.close(file)
            raise
        os.close(file)


def _remove_left_over(module: Path, lock: Path, killed: bool) -> None:
    """Remove what a compiler left that is gone."""
    source, mark = module.with_suffix(".c"), module.with_suffix(".c.cached")
    part = any(library.exists() for library in _libraries(module))
    while source.exists() and not _ready(module):
        if killed or mark.exists() or _idle(module, lock) > PATIENCE:
            _LOG.warning(
                "%s has %s: the run that compiled it was killed, the disk was full, or the library was "
                "deleted; it is compiled again",
                source, "a part of its library alone" if part and mark.exists() else "no library",
            )  # fmt: skip
            _remove(module)
        else:
            time.sleep(0.5)


def _idle(module: Path, lock: Path) -> float:
    """Return the seconds since the last change of a module's files, by the clock of their disk."""
    os.utime(lock)
    changes = [0.0]
    for file in module.parent.glob(f"{module.name}.*"):
        with suppress(FileNotFoundError):  # its compiler has moved it
            changes.append(file.stat().st_mtime if file != lock else 0.0)
    return lock.stat().st_mtime - max(changes)
