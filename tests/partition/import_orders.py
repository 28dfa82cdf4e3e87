"""Walk all orders in which modules can be imported, cut a mesh in each: ``import_orders.py MODULE...``.

A process imports a module and forks one child for every module that may come next, so that what orders have
in common is imported once. Prints a line for every order that ends, "failed" and its beginning for others.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import signal
import sys
import traceback
from collections.abc import Sequence

#: Seconds after which an import or a cut that hangs is ended.
LIMIT = 60


def cut() -> str:
    """Return the digest of a partition by METIS, of a mesh that no boxes are made for."""
    from dataclasses import replace

    from fenics_contact.gallery import block
    from fenics_contact.mesh import graph_partition

    mesh = replace(block((0, 0, 0), (7, 5, 3), (7, 5, 3)), grid=None)
    return hashlib.sha256(graph_partition(mesh, 5).tobytes()).hexdigest()[:16]


def walk(done: Sequence[str], left: Sequence[str]) -> None:
    """Try all orders that begin with the modules that are imported already."""
    for module in left:
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            try:
                go_on([*done, module], [other for other in left if other != module])
                sys.stdout.flush()
                os._exit(0)
            except BaseException:
                traceback.print_exc()
                os._exit(1)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if status != 0:
            sys.stdout.write(f"failed with {status}: {' '.join([*done, module])}\n")


def go_on(done: Sequence[str], left: Sequence[str]) -> None:
    """Import the last module, and the others after it or cut."""
    signal.alarm(LIMIT)
    importlib.import_module(done[-1])
    if not left:
        sys.stdout.write(f"{cut()} {' '.join(done)}\n")
    signal.alarm(0)
    walk(done, left)


if __name__ == "__main__":
    walk([], sys.argv[1:])
