"""A basis of all rigid motions in which those of whole bodies are separate vectors.

The motion of a body is the sum of those of its subdomains, and it has no jump in gluing rows: in G it would
be a difference of large numbers, of which the rows that hold the body would be a small remainder if the body
is stiff and its support soft. As a separate basis vector it suffers no cancellation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact.errors import together
from fenics_contact.feti.subdomain import Subdomain, kernel_of_body
from fenics_contact.feti.torn import TornSystem


@dataclass(frozen=True, eq=False)
class TornModes:
    """R = diag(R_s) C on this rank's torn vectors: modes of its subdomains and which of them move together.

    Only C is stored: as a sparse matrix R would need more memory than all rows of B and their products.
    `parts`: R_s of each subdomain, as it has them; `coefficients`: C.
    """

    parts: tuple[np.ndarray, ...]
    coefficients: sp.csr_matrix

    @classmethod
    def of(cls, subdomains: Sequence[Subdomain], first: np.ndarray, total: int) -> TornModes:
        """Take the modes of this rank's subdomains, numbered from ``first`` of each among ``total``."""
        parts = tuple(subdomain.kernel for subdomain in subdomains)
        modes = [start + np.arange(part.shape[1]) for part, start in zip(parts, first, strict=True)]
        columns = np.concatenate(modes)
        entries = np.ones(len(columns)), (np.arange(len(columns)), columns)
        return cls(parts, Csr(entries, shape=(len(columns), total)))

    @property
    def shape(self) -> tuple[int, int]:
        """Length of torn vectors, and number of modes of all ranks."""
        return sum(map(len, self.parts)), self.coefficients.shape[1]

    def __matmul__(self, alpha: np.ndarray) -> np.ndarray:
        """Return R α for α of shape (n_modes,)."""
        each = np.split(self.coefficients @ alpha, self._ends)
        return np.concatenate([part @ own for part, own in zip(self.parts, each, strict=True)])

    def resultants(self, force: np.ndarray) -> np.ndarray:
        """Return Rᵀ f of a torn vector, this rank's share, shape (n_modes,)."""
        each = np.split(force, np.cumsum([len(part) for part in self.parts])[:-1])
        own = [part.T @ values for part, values in zip(self.parts, each, strict=True)]
        return np.asarray(self.coefficients.T @ np.concatenate(own))

    def moved_by(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """Return rows · R for sparse rows on torn vectors, shape (n_rows, torn_size)."""
        # Where no row acts, R is not needed.
        used = np.unique(rows.indices)
        starts = np.cumsum([0, *map(len, self.parts)])
        ends = np.searchsorted(used, starts)
        parts = [
            part[used[a:b] - start]
            for part, start, (a, b) in zip(self.parts, starts[:-1], pairwise(ends), strict=True)
        ]
        place = np.searchsorted(used, rows.indices)
        rows = Csr((rows.data, place, rows.indptr), shape=(rows.shape[0], len(used)))
        sizes, widths = np.array([part.shape for part in parts]).T
        first = np.repeat(np.cumsum(widths) - widths, sizes)
        counts = np.repeat(widths, sizes)
        start = np.concatenate([[0], np.cumsum(counts)])
        column = np.arange(start[-1], dtype=np.int32)
        column -= np.repeat((start[:-1] - first).astype(np.int32), counts)
        values = np.concatenate([part.ravel() for part in parts])
        modes = Csr((values, column, start), shape=(len(counts), widths.sum()))
        modes.eliminate_zeros()  # half of the entries of rigid motions
        return (rows @ modes) @ self.coefficients

    def combined(self, coefficients: sp.csr_matrix) -> TornModes:
        """Return the modes R A for a matrix A, shape (n_modes, n)."""
        return replace(self, coefficients=(self.coefficients @ coefficients).tocsr())

    def tocsr(self) -> sp.csr_matrix:
        """Return R as a sparse matrix, shape (torn_size, n_modes)."""
        if self.shape[1] == 0:
            return Csr(self.shape)
        return self.moved_by(sp.identity(self.shape[0], format="csr"))

    @property
    def _ends(self) -> np.ndarray:
        """Where the modes of each subdomain but the last end."""
        return np.cumsum([part.shape[1] for part in self.parts])[:-1]


def whole_motions(torn: TornSystem, offset: np.ndarray) -> sp.csr_matrix:
    """Return T that replaces the modes of every cut body's first subdomain by those of the body. Collective.

    Returns coefficients of the new basis vectors in the old ones as columns, (n_modes, n_modes), replicated.
    `offset`: first mode of each subdomain and the total, replicated.
    """
    comm = torn.numbering.comm
    with together(comm):
        bodies = {name: torn.scene.bodies[name] for name in {part.mesh.body for part in torn.subdomains}}
        modes = {
            name: kernel_of_body(body, body.mesh.points, body.materials) for name, body in bodies.items()
        }
        mine = {part.mesh.number: _coefficients(part, modes[part.mesh.body]) for part in torn.subdomains}
    parts = {number: coefficients for share in comm.allgather(mine) for number, coefficients in share.items()}
    total, first = int(offset[-1]), torn.decomposition.tearing.subdomain_offset
    unchanged, rows, columns, values = np.ones(total), [], [], []
    for start, end in pairwise(first):
        place = np.arange(offset[start], offset[start + 1])
        coefficients = [parts[number] for number in range(start, end)]
        whole = [part for part in coefficients if part is not None and part.shape[1] == len(place)]
        # All parts or none: the modes of a body replace those of a part only if every part reproduces them.
        if len(coefficients) == 1 or len(whole) < len(coefficients):
            continue
        unchanged[place] = 0.0
        block = np.vstack(whole)
        row, column = np.indices(block.shape)
        rows.append(offset[start] + row.ravel())
        columns.append(offset[start] + column.ravel())
        values.append(block.ravel())
    nowhere = np.zeros(0, dtype=np.int64)
    entries = (np.concatenate([nowhere, *rows]), np.concatenate([nowhere, *columns]))
    motions = Csr((np.concatenate([np.zeros(0), *values]), entries), shape=(total, total))
    return (motions + sp.diags(unchanged)).tocsr()


def _coefficients(subdomain: Subdomain, modes: np.ndarray, spanned: float = 1e-10) -> np.ndarray | None:
    """Return the body's modes, (n_nodes, dim, n_modes), in terms of a subdomain's, one per column.

    None if they are not in its span. `spanned`: modes of a subdomain must reproduce those of its body to this
    accuracy, else the subdomains' own are used.
    """
    wanted = modes[subdomain.mesh.nodes].reshape(subdomain.mesh.size, modes.shape[-1])
    coefficients = np.linalg.lstsq(subdomain.kernel, wanted, rcond=None)[0]
    error = np.abs(subdomain.kernel @ coefficients - wanted).max(initial=0.0)
    return coefficients if error <= spanned * np.abs(wanted).max(initial=0.0) else None
