"""The one call of METIS; also a program of its own, which knows nothing of the package.

Program: the graph and the number of parts come in through stdin as the arrays of an ``.npz`` file, named as
the arguments of `part_graph`; the parts of the vertices go out through stdout as an ``.npy`` file.
"""

from __future__ import annotations

import io
import sys

import numpy as np

_SEED = 1


def part_graph(
    indptr: np.ndarray, indices: np.ndarray, edges: np.ndarray, vertices: np.ndarray, parts: int
) -> np.ndarray:
    """Return METIS's part of every vertex: the same for the same graph, always.

    Args:
        indptr: (n + 1,) where the neighbours of each vertex begin in ``indices``.
        indices: (2 n_edges,) neighbours, both directions of every edge.
        edges: (2 n_edges,) what it costs to cut them, integers of at least 1.
        vertices: (n,) what they count in a part, integers of at least 1.
        parts: Number of parts, at least 2.

    Returns:
        (n,) part numbers; a part may be in pieces or have no vertices.
    """
    import pymetis

    answer = pymetis.part_graph(
        parts,
        pymetis.CSRAdjacency(indptr, indices),
        eweights=edges,
        vweights=vertices,
        recursive=True,
        options=pymetis.Options(seed=_SEED),
    )
    return np.asarray(answer.vertex_part, dtype=np.int64)


def main() -> None:
    """Read a graph, write its parts."""
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as given:
        indptr, indices, edges, vertices = (
            given[name] for name in ("indptr", "indices", "edges", "vertices")
        )
        answer = part_graph(indptr, indices, edges, vertices, int(given["parts"]))
    written = io.BytesIO()  # NumPy asks a file for its position, a pipe has none
    np.save(written, answer)
    sys.stdout.buffer.write(written.getvalue())


if __name__ == "__main__":
    main()
