"""Two elastic blocks in contact, torn into equal cubes: a realistic dual problem in plain NumPy.

The lower block stands on a held base, the upper one floats on it and is pressed down and sideways. Every
subdomain is the same cube of trilinear elements, so one dense pseudo-inverse serves them all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.qp import DualProblem
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.layout import ContactLayout


def element_stiffness(size: float, young: float = 1.0, poisson: float = 0.3) -> np.ndarray:
    """Stiffness of a trilinear cube, shape (24, 24), nodes in lexicographic order."""
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = young / (2 * (1 + poisson))
    elasticity = np.diag([2 * shear] * 3 + [shear] * 3)
    elasticity[:3, :3] += lame
    corners = np.array(list(product((0, 1), repeat=3)))
    stiffness = np.zeros((24, 24))
    points = 0.5 + np.array([-1, 1]) / (2 * np.sqrt(3))
    for point in product(points, repeat=3):
        factors = np.where(corners == 1, point, 1 - np.array(point))
        gradient = np.stack(
            [
                np.where(corners[:, a] == 1, 1, -1) * np.delete(factors, a, axis=1).prod(axis=1)
                for a in range(3)
            ]
        )
        strain = np.zeros((6, 24))
        for a in range(3):
            strain[a, a::3] = gradient[a] / size
        for row, (a, b) in enumerate([(0, 1), (1, 2), (0, 2)], start=3):
            strain[row, a::3], strain[row, b::3] = gradient[b] / size, gradient[a] / size
        stiffness += strain.T @ elasticity @ strain * size**3 / 8
    return stiffness


@lru_cache(maxsize=4)
def cube(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return stiffness, its pseudo-inverse, orthonormal rigid motions and node coordinates of a cube."""
    nodes = np.array(list(product(range(n + 1), repeat=3)), dtype=float) / n
    numbers = np.arange((n + 1) ** 3).reshape((n + 1,) * 3)
    local = element_stiffness(1.0 / n)
    stiffness = np.zeros((3 * len(nodes),) * 2)
    for i, j, k in product(range(n), repeat=3):
        dofs = (3 * numbers[i : i + 2, j : j + 2, k : k + 2].ravel()[:, None] + np.arange(3)).ravel()
        stiffness[np.ix_(dofs, dofs)] += local
    x, y, z = (nodes - 0.5).T
    kernel = np.zeros((3 * len(nodes), 6))
    for a in range(3):
        kernel[a::3, a] = 1.0
    kernel[0::3, 3], kernel[1::3, 3] = -y, x
    kernel[1::3, 4], kernel[2::3, 4] = -z, y
    kernel[0::3, 5], kernel[2::3, 5] = z, -x
    kernel, _ = np.linalg.qr(kernel)
    inverse = np.linalg.inv(stiffness + kernel @ kernel.T) - kernel @ kernel.T
    return stiffness, inverse, kernel, nodes


@dataclass(frozen=True)
class Bricks:
    """Parameters of the two blocks: cubes along x, y and height of each, elements per cube edge."""

    cubes: tuple[int, int] = (2, 1)
    heights: tuple[int, int] = (1, 1)
    n: int = 3
    press: float = 0.01
    shear: float = 0.002
    tilt: float = 0.0
    crown: float = 0.0
    contact: bool = True
    friction: bool = True
    preconditioned: bool = True


class Torn:
    """Matrices of the torn blocks, assembled in full: B, B K⁺, R."""

    def __init__(self, bricks: Bricks) -> None:
        self.bricks = bricks
        nx, ny = bricks.cubes
        self.places = [(0, i, j, k) for i in range(nx) for j in range(ny) for k in range(bricks.heights[0])]
        upper = 1 if bricks.contact else 0
        self.places += [
            (upper, i, j, k + bricks.heights[0])
            for i in range(nx)
            for j in range(ny)
            for k in range(bricks.heights[1])
        ]
        self.stiffness, self.inverse, self.kernel, self.nodes = cube(bricks.n)
        self.n_dofs = 3 * len(self.nodes)
        self.coordinates = np.array([self.nodes + p[1:] for p in self.places])
        self.body = np.array([p[0] for p in self.places])
        self._rows, self._columns, self._values, self._offset = [], [], [], []
        self._glue()
        self.n_equality = len(self._offset)
        if bricks.contact:
            self._touch()
        self.B = sp.csr_matrix(
            (np.concatenate(self._values), (np.concatenate(self._rows), np.concatenate(self._columns))),
            shape=(len(self._offset), self.n_dofs * len(self.places)),
        )
        self.c = np.array(self._offset)
        self.f = self._load()

    def _row(self, columns: np.ndarray, values: np.ndarray, offset: float) -> None:
        self._rows.append(np.full(len(columns), len(self._offset)))
        self._columns.append(np.asarray(columns))
        self._values.append(np.asarray(values, dtype=float))
        self._offset.append(offset)

    def _glue(self) -> None:
        keys = np.round(self.coordinates * 2520).astype(int)
        groups: dict[tuple[int, ...], list[int]] = {}
        for s, node in product(range(len(self.places)), range(len(self.nodes))):
            groups.setdefault((self.body[s], *keys[s, node]), []).append(s * len(self.nodes) + node)
        for key, copies in groups.items():
            m = len(copies)
            for r in range(1, m):
                weights = np.concatenate([np.ones(r), [-r]]) / np.sqrt(r * (r + 1))
                for a in range(3):
                    self._row(3 * np.array(copies[: r + 1]) + a, weights, 0.0)
            if key[3] == 0:
                for a in range(3):
                    self._row(3 * np.array(copies) + a, np.full(m, 1 / np.sqrt(m)), 0.0)

    def _touch(self) -> None:
        height = self.bricks.heights[0]
        keys = np.round(self.coordinates * 2520).astype(int)
        lower: dict[tuple[int, ...], int] = {}
        upper: dict[tuple[int, ...], int] = {}
        for s, node in product(range(len(self.places)), range(len(self.nodes))):
            if keys[s, node, 2] == 2520 * height:
                (upper if self.body[s] else lower).setdefault(
                    tuple(keys[s, node]), s * len(self.nodes) + node
                )
        self.normal, self.tangential = [], []
        length = np.array(self.bricks.cubes)
        for key in upper:
            x = np.array(key[:2]) / 2520 / length - 0.5
            gap = self.bricks.crown * (x @ x)
            self.normal.append(len(self._offset))
            self._row([3 * upper[key] + 2, 3 * lower[key] + 2], [-np.sqrt(0.5), np.sqrt(0.5)], gap)
            if self.bricks.friction:
                self.tangential.append([len(self._offset), len(self._offset) + 1])
                for a in range(2):
                    self._row([3 * upper[key] + a, 3 * lower[key] + a], [np.sqrt(0.5), -np.sqrt(0.5)], 0.0)

    def _load(self) -> np.ndarray:
        bricks = self.bricks
        load = np.zeros((len(self.places), len(self.nodes), 3))
        top = bricks.heights[0] + bricks.heights[1]
        here = self.coordinates[:, :, 2] > top - 1e-9
        lever = self.coordinates[:, :, 0] / bricks.cubes[0] - 0.5
        load[here, 2] = (-bricks.press * (1 + bricks.tilt * lever))[here] / (bricks.n + 1) ** 2
        load[here, 0] = bricks.shear / (bricks.n + 1) ** 2
        return load.ravel()

    def pseudo_inverse(self, u: np.ndarray) -> np.ndarray:
        return (u.reshape(len(self.places), -1) @ self.inverse).ravel()

    def schur_preconditioner(self) -> list[tuple[np.ndarray, np.ndarray]]:
        pieces = []
        by_subdomain = self.B.tocsc()
        for s in range(len(self.places)):
            block = by_subdomain[:, s * self.n_dofs : (s + 1) * self.n_dofs]
            touched = np.flatnonzero(np.diff(block.indptr))
            rest = np.setdiff1d(np.arange(self.n_dofs), touched)
            k = self.stiffness
            schur = k[np.ix_(touched, touched)]
            if rest.size:
                schur = schur - k[np.ix_(touched, rest)] @ np.linalg.solve(
                    k[np.ix_(rest, rest)], k[np.ix_(rest, touched)]
                )
            pieces.append((touched + s * self.n_dofs, schur))
        return pieces


def torn_problem(bricks: Bricks, comm: MPI.Comm = MPI.COMM_SELF) -> tuple[DualProblem, Torn]:
    """Return the dual problem, rows dealt out to the ranks in contiguous pieces, and its matrices."""
    torn = Torn(bricks)
    B, n = torn.B, torn.B.shape[0]
    owner, layout_rows = row_owners(torn, comm.size), contact_rows(torn)
    mine = np.flatnonzero(owner == comm.rank)
    order = np.concatenate([np.flatnonzero(owner == r) for r in range(comm.size)])

    def gather(x: np.ndarray) -> np.ndarray:
        full = np.empty(n)
        full[order] = np.concatenate(comm.allgather(x))
        return full

    def flexibility(x: np.ndarray) -> np.ndarray:
        return (B @ torn.pseudo_inverse(B.T @ gather(x)))[mine]

    R = sp.block_diag([torn.kernel] * len(torn.places)).tocsr()
    G = (R.T @ B.T).tocsr()
    e = R.T @ torn.f
    d = B @ torn.pseudo_inverse(torn.f) - torn.c
    weights = np.asarray(B.power(2) @ np.tile(np.diag(torn.inverse), len(torn.places)))
    position = np.full(n, -1)
    position[mine] = np.arange(len(mine))
    normal, tangential = layout_rows
    layout = ContactLayout.build(
        len(mine),
        position[normal[owner[normal] == comm.rank]],
        position[tangential[owner[tangential[:, 0]] == comm.rank]],
    )
    preconditioner = _dirichlet(torn, gather, mine) if bricks.preconditioned else None
    coarse = CoarseSpace(comm, G[:, mine], e)
    return DualProblem(comm, flexibility, d[mine], coarse, layout, weights[mine], preconditioner), torn


def contact_rows(torn: Torn) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal rows and the pairs of tangential rows."""
    normal = np.array(torn.normal if torn.bricks.contact else [], dtype=int)
    has_discs = torn.bricks.contact and torn.bricks.friction
    return normal, np.array(torn.tangential if has_discs else np.zeros((0, 2)), dtype=int)


def row_owners(torn: Torn, ranks: int) -> np.ndarray:
    """Deal gluing rows and contacts out to the ranks in equal pieces; a contact stays whole."""
    owner = np.empty(torn.B.shape[0], dtype=int)
    owner[: torn.n_equality] = np.arange(torn.n_equality) * ranks // max(torn.n_equality, 1)
    normal, tangential = contact_rows(torn)
    share = np.arange(len(normal)) * ranks // max(len(normal), 1)
    owner[normal] = share
    owner[tangential] = share[: len(tangential), None]
    return owner


def _dirichlet(torn: Torn, gather, mine):
    pieces = torn.schur_preconditioner()
    gram = sp.linalg.splu((torn.B @ torn.B.T).tocsc())
    B = torn.B

    def apply(x: np.ndarray) -> np.ndarray:
        jumps = B.T @ gram.solve(gather(x))
        forces = np.zeros_like(jumps)
        for dofs, schur in pieces:
            forces[dofs] = schur @ jumps[dofs]
        return gram.solve(B @ forces)[mine]

    return apply
