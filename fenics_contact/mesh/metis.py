"""Partition of any mesh by METIS.

pymetis carries METIS inside its extension and exports its functions. The dynamic linker prefers functions of
the same name in libraries opened with RTLD_GLOBAL, as dolfinx 0.5 opens the METIS of the system, whose
indices have 32 bits while those of pymetis have 64: a pymetis loaded after it mixes both and crashes or never
ends. Here it is loaded so that it prefers its own functions.

A library is loaded only once. If the program itself has loaded pymetis and another METIS may have taken its
calls, the graph is partitioned in a separate process.

The graph is the dual one: a vertex for every cell, an edge for every face that two cells share, weighted by
its area; see `mesh.partition`. METIS may return a disconnected part and, when parts are small, a part
without cells; both are repaired. It balances parts to the cell, which leaves jagged boundaries; these are
smoothed.

References:
    G. Karypis, V. Kumar: A fast and high quality multilevel scheme for partitioning irregular graphs. SIAM J.
    Sci. Comput. 20 (1998).
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
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from fenics_contact._base.launching import clean_environment
from fenics_contact._base.requirements import load_pymetis, pymetis_error
from fenics_contact.mesh import metis_call
from fenics_contact.mesh.bisection import smoothed
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.partition import cell_weights, check_one_piece, check_parts, face_areas, merge_pieces


def part_graph(graph: csr_matrix, vertices: np.ndarray, parts: int) -> np.ndarray:
    """Return METIS's part of every vertex.

    `graph`: cost of cutting two vertices apart, integers of at least 1, (n, n), symmetric; `vertices`: weight
    of each vertex, integers of at least 1, (n,); `parts`: number of parts, at least 2.

    Returns (n,) part numbers; a part may be in pieces or have no vertices.
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


STEPS = 1000
"""Integer value of the largest weight, as METIS uses integers."""


def graph_partition(mesh: BodyMesh, parts: int, body: str = "") -> np.ndarray:
    """Cut any mesh with small interfaces between its subdomains.

    The same mesh gives the same subdomains on every call and every rank.

    Args:
        mesh: Any mesh that is connected through faces.
        parts: Number of subdomains.
        body: Name of the body, for messages.

    Returns:
        (n_cells,) subdomain numbers, every subdomain connected through faces.

    Raises:
        InvalidInputError: If there are fewer cells than parts, or the mesh consists of separate parts.
        MissingRequirementError: If pymetis is missing, too old or cannot be loaded.
    """
    check_parts(mesh, parts)
    check_one_piece(mesh, body)
    if parts == 1:
        return np.zeros(mesh.n_cells, dtype=np.int64)
    pairs, areas = face_areas(mesh)
    graph = _dual_graph(mesh.n_cells, pairs, areas)
    partition = part_graph(graph, _integers(cell_weights(mesh)), parts)
    partition = smoothed(_without_empty_parts(graph, partition, parts), pairs, areas)
    return merge_pieces(mesh, partition, body)


def _dual_graph(n_cells: int, pairs: np.ndarray, areas: np.ndarray) -> csr_matrix:
    """Return the areas, in integers, of the faces between the cells, (n_cells, n_cells)."""
    rows, columns = np.concatenate([pairs, pairs[:, ::-1]]).T
    graph = coo_matrix((np.tile(_integers(areas), 2), (rows, columns)), shape=2 * (n_cells,)).tocsr()
    graph.sort_indices()
    return graph


def _integers(weights: np.ndarray) -> np.ndarray:
    """Return weights as integers from 1 to `STEPS`."""
    return np.asarray(np.maximum(1, np.round(STEPS * weights / weights.max())), dtype=np.int64)


def _without_empty_parts(graph: csr_matrix, partition: np.ndarray, parts: int) -> np.ndarray:
    """Give half of the largest part to every part without cells."""
    partition = partition.copy()
    sizes = np.bincount(partition, minlength=parts)
    for empty in np.flatnonzero(sizes == 0):
        largest = int(np.argmax(sizes))
        cells = np.flatnonzero(partition == largest)
        inside = graph[cells][:, cells]
        reached = breadth_first_order(inside, 0, directed=False, return_predecessors=False)
        # Cells not reached from the first one are another piece and move first.
        order = np.concatenate([np.setdiff1d(np.arange(cells.size), reached), reached[::-1]])
        moved = cells[order[: cells.size // 2]]
        partition[moved] = empty
        sizes[empty], sizes[largest] = moved.size, cells.size - moved.size
    return partition
