"""METIS of pymetis, and not of another library in the process.

pymetis carries METIS inside its extension and exports its functions. The dynamic linker prefers functions of
the same name in libraries opened with RTLD_GLOBAL, as dolfinx 0.5 opens the METIS of the system, whose
indices have 32 bits while those of pymetis have 64: a pymetis loaded after it mixes both and crashes or never
ends. Here it is loaded so that it prefers its own functions.

A library is loaded only once. If the program itself has loaded pymetis and another METIS may have taken its
calls, the graph is partitioned in a separate process.
"""

from __future__ import annotations

import ctypes
import io
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
from scipy.sparse import csr_matrix

from fenics_contact._requirements import load_pymetis, pymetis_error
from fenics_contact.launching import clean_environment
from fenics_contact.partition import metis_call


def part_graph(graph: csr_matrix, vertices: np.ndarray, parts: int) -> np.ndarray:
    """Return METIS's part of every vertex.

    Args:
        graph: Cost of cutting two vertices apart, integers of at least 1, (n, n), symmetric.
        vertices: Weight of each vertex, integers of at least 1, (n,).
        parts: Number of parts, at least 2.

    Returns:
        (n,) part numbers; a part may be in pieces or have no vertices.

    Raises:
        MissingRequirementError: If pymetis is missing, too old, cannot be loaded or does not run.
    """
    alone = _may_have_lost_its_calls()
    with _own_functions_first():
        load_pymetis()
    if alone:
        return _part_graph_elsewhere(graph, vertices, parts)
    return metis_call.part_graph(graph.indptr, graph.indices, graph.data, vertices, parts)


@cache  # determined at the first call, before the package has loaded pymetis
def _may_have_lost_its_calls() -> bool:
    """Return whether the program has loaded pymetis itself and there is a global METIS that it may call."""
    return "pymetis._internal" in sys.modules and hasattr(ctypes.CDLL(None), "METIS_PartGraphKway")


@contextmanager
def _own_functions_first() -> Iterator[None]:
    """Let libraries loaded in this block prefer their own functions to global ones."""
    flags = sys.getdlopenflags()
    sys.setdlopenflags(os.RTLD_NOW | os.RTLD_LOCAL | getattr(os, "RTLD_DEEPBIND", 0))
    try:
        yield
    finally:
        sys.setdlopenflags(flags)


def _part_graph_elsewhere(graph: csr_matrix, vertices: np.ndarray, parts: int) -> np.ndarray:
    """Return METIS's part of every vertex, from a new Python process that loads only pymetis."""
    given, path = io.BytesIO(), os.pathsep.join(filter(None, sys.path))
    np.savez(
        given, indptr=graph.indptr, indices=graph.indices, edges=graph.data, vertices=vertices, parts=parts
    )
    done = subprocess.run(
        [sys.executable, "-P", metis_call.__file__],  # -P: modules beside the program are none of its imports
        input=given.getvalue(),
        capture_output=True,
        env=clean_environment() | {"PYTHONPATH": path},
    )
    if done.returncode != 0:
        raise pymetis_error(
            f"does not run in a process of its own (exit status {done.returncode}: "
            f"{done.stderr.decode(errors='replace').strip()[-500:]}), as it must where the program has "
            "imported another METIS before it: cut the mesh before dolfinx and pymetis are imported"
        )
    return np.load(io.BytesIO(done.stdout))
