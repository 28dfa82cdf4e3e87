"""The call of METIS; also a separate program, independent of the package.

Program: reads the graph and the number of parts from stdin as the arrays of an ``.npz`` file, named as the
    arguments of `part_graph`; writes the parts of the vertices to stdout as an ``.npy`` file.
"""

from __future__ import annotations

import io
import sys

import numpy as np

_SEED = 1


def part_graph(
    indptr: np.ndarray, indices: np.ndarray, edges: np.ndarray, vertices: np.ndarray, parts: int
) -> np.ndarray:
    """Return METIS's part of every vertex, deterministically.

    `indptr`: (n + 1,) start of the neighbours of each vertex in ``indices``; `indices`: (2 n_edges,)
    neighbours, both directions of every edge; `edges`: (2 n_edges,) cost of cutting them, integers of at
    least 1; `vertices`: (n,) their weights, integers of at least 1; `parts`: number of parts, at least 2.

    Returns (n,) part numbers; a part may be in pieces or have no vertices.
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
    written = io.BytesIO()  # NumPy needs the position in a file, which a pipe lacks
    np.save(written, answer)
    sys.stdout.buffer.write(written.getvalue())


if __name__ == "__main__":
    main()
