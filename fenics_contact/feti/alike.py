"""Subdomains that are alike: the same stiffness up to a rigid motion and the numbering of nodes.

Every subdomain floats, so its stiffness depends on shape and material alone. Of two that differ by a rotation
or a mirror Q, a translation and the numbering π of nodes, K_first = P K Pᵀ with P the permutation π of blocks
times Q in each; then K_first⁺ = P K⁺ Pᵀ, and S likewise where P maps the interfaces on each other.

Invariants choose candidates, coordinates suggest Q and π, and the matrices themselves decide: whatever enters
the stiffness, such as material axes, springs or hanging nodes, must agree to rounding. Where it depends on
the shape alone cells decide, and samples of matrices confirm it, see `by_shape`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fenics_contact.feti.moved import SAME, Motion, Placement
from fenics_contact.feti.nearby import ToleranceIndex
from fenics_contact.feti.subdomain import LocalOperator, Subdomain


class Kind:
    """A kind of subdomains, represented by its first one, and what is compared of others with it.

    `key`: counts that agree where subdomains are alike; `operator`: its factors; None until they are made.
    """

    def __init__(self, subdomain: Subdomain, interface: np.ndarray) -> None:
        """Begin with a subdomain and its interface."""
        self.subdomain, self.interface = subdomain, interface
        self.width = subdomain.mesh.components
        modes, (count, dim) = subdomain.kernel.shape[1], subdomain.points.shape
        self.key = count, dim, self.width, modes, len(interface), subdomain.shape.key
        self.operator: LocalOperator | None = None

    def stiffness(self) -> sp.csr_matrix:
        """Return the stiffness, assembled where it was not."""
        return self.subdomain.stiffness

    @cached_property
    def size(self) -> np.ndarray:
        """Two invariants under rigid motions and numbering."""
        return self.subdomain.shape.invariants(self.arms, self.stiffness)

    def forget(self) -> None:
        """Free what is made again where it is needed."""
        for name in ("arms", "tree", "marks", "sorted_marks", "blocks"):
            self.__dict__.pop(name, None)

    @cached_property
    def arms(self) -> np.ndarray:
        """Nodes relative to their centroid, (n, dim)."""
        points = self.subdomain.points
        arms = points - points[0]
        return np.asarray(arms - arms.mean(axis=0))

    @cached_property
    def reach(self) -> float:
        """Distance of the farthest node from the centroid."""
        return float(np.linalg.norm(self.arms, axis=1).max())

    @cached_property
    def tree(self) -> cKDTree:
        """Nodes by place."""
        return cKDTree(self.arms)

    @cached_property
    def marks(self) -> np.ndarray:
        """Invariants of each node in one number, (n,): distance, stiffness or cells, interface."""
        counts = np.bincount(self.interface // self.width, minlength=len(self.arms))
        own = self.subdomain.shape.marks(self.stiffness, self.width)
        return np.asarray(np.linalg.norm(self.arms, axis=1) / self.reach + np.pi * own + 10.0 * counts)

    @cached_property
    def sorted_marks(self) -> np.ndarray:
        """The marks, ascending."""
        return np.sort(self.marks)

    @cached_property
    def blocks(self) -> sp.bsr_matrix:
        """The stiffness by blocks of nodes, with sorted indices."""
        blocks = self.subdomain.stiffness.tobsr((self.width, self.width))
        blocks.sort_indices()
        return blocks

    def references(self, near: float) -> np.ndarray:
        """Return as many nodes as there are dimensions, in independent directions and with rare marks."""
        order = np.argsort(self.marks)
        group = np.empty(len(order), dtype=np.int64)
        group[order] = np.cumsum(np.diff(self.marks[order], prepend=self.marks[order[0]]) > near)
        alike = np.bincount(group)[group]
        rest, chosen = self.arms, []
        for _ in range(self.arms.shape[1]):
            length = np.linalg.norm(rest, axis=1)
            chosen.append(int(np.argmax(length**2 / alike)))
            way = rest[chosen[-1]] / length[chosen[-1]]
            rest = rest - np.outer(rest @ way, way)
        return np.array(chosen)


@dataclass(frozen=True)
class Agreement:
    """How closely subdomains agree that are alike.

    `matrix`: difference of stiffnesses, relative to their largest entry. Those of equal pieces of one body
    differ by 1e-15, of turned ones by some 1e-14; `shape`: difference of coordinates, relative to the size,
    up to which nodes are tried as the same; `marks`: difference of the invariants of a node up to which it is
    tried as the same; `motions`: number of rotations and mirrors that are tried for one pair; a cube has 48
    of its own.
    """

    matrix: float = 1e-12
    shape: float = 1e-8
    marks: float = 1e-6
    motions: int = 96


class Kinds:
    """Kinds of subdomains."""

    def __init__(self, agreement: Agreement | None = None) -> None:
        """Start empty."""
        self._agreement = agreement or Agreement()
        self.all: list[Kind] = []
        # By counts and trace: kind, a subdomain of it with a numbering of its own, how it lies on the first.
        self._seen: dict[tuple[Hashable, ...], ToleranceIndex[tuple[Kind, Kind, Placement]]] = defaultdict(
            ToleranceIndex
        )
        self._matrices: set[int] = set()

    def add(self, kind: Kind) -> Kind:
        """Take a kind without comparing it with others."""
        self.all.append(kind)
        self._seen[kind.key].add(kind.size[0], (kind, kind, SAME))
        self._matrices.add(id(kind.subdomain.matrix))
        return kind

    def compares_with(self, subdomain: Subdomain) -> bool:
        """Return whether those that follow may be compared with the matrix of a subdomain."""
        return id(subdomain.matrix) in self._matrices

    def place(self, given: Kind) -> tuple[Kind, Placement]:
        """Return the kind of a subdomain, given as one of its own, and how it lies on the first one of it.

        One that is like none before is a new kind.
        """
        seen, room = self._seen[given.key], self._agreement.matrix * given.arms.size * given.size
        near = seen.near(given.size[0], room[0])
        near = [each for each in near if abs(each[1].size[1] - given.size[1]) <= room[1]]
        for kind, other, motion in near:
            if self._same_numbers(other, given):
                return kind, motion
        for kind, other, _ in near:
            if other is kind:
                found = self._motion(kind, given)
                if found is not None:  # others may be the same as this one dof by dof
                    seen.add(given.size[0], (kind, given, found))
                    self._matrices.add(id(given.subdomain.matrix))
                    given.forget()
                    return kind, found
        return self.add(given), SAME

    def forget(self) -> None:
        """Free what only comparisons need."""
        for kind in self.all:
            kind.forget()

    def _same_numbers(self, one: Kind, other: Kind) -> bool:
        """Return whether two subdomains are the same dof by dof."""
        if not np.array_equal(one.interface, other.interface):
            return False
        if one.subdomain.matrix is other.subdomain.matrix:
            return True
        apart = np.abs(one.arms - other.arms).max() / one.reach
        if apart > self._agreement.shape:
            return False
        nodes = np.arange(len(one.arms))
        return one.subdomain.shape.agrees(
            other.subdomain.shape, nodes, apart, 0.0, lambda: self._same_entries(one, other)
        )

    def _same_entries(self, one: Kind, other: Kind) -> bool:
        A, B = one.stiffness(), other.stiffness()
        same = np.array_equal(A.indptr, B.indptr) and np.array_equal(A.indices, B.indices)
        return same and self._agree(A.data, B.data)

    def _agree(self, first: np.ndarray, other: np.ndarray) -> bool:
        return bool(np.abs(other - first).max() <= self._agreement.matrix * np.abs(first).max())

    def _motion(self, first: Kind, given: Kind) -> Motion | None:
        """Return how a subdomain lies on another one; None where it is not alike."""
        near, limit = self._agreement.shape * first.reach, self._agreement.marks
        if abs(first.reach - given.reach) > near:
            return None
        if np.abs(first.sorted_marks - given.sorted_marks).max() > limit:
            return None
        for Q in self._turns(first, given):
            distance, nodes = given.tree.query(first.arms @ Q)
            if distance.max() > near or len(np.unique(nodes)) < len(nodes):
                continue
            if given.width == len(Q):
                Q = _nearest_orthogonal(first.arms.T @ given.arms[nodes])
            motion = Motion.of(nodes, Q, given.width)
            if motion.maps(given.interface, first.interface) and self._same(first, given, nodes, Q):
                return motion
        return None

    def _same(self, first: Kind, given: Kind, nodes: np.ndarray, Q: np.ndarray) -> bool:
        """Return whether P K Pᵀ is the stiffness of the first one, by shapes or by matrices."""
        apart = np.abs(first.arms - given.arms[nodes] @ Q.T).max() / first.reach
        sign = float(np.sign(np.linalg.det(Q)))
        return first.subdomain.shape.agrees(
            given.subdomain.shape, nodes, apart, sign, lambda: self._same_matrix(first, given, nodes, Q)
        )

    def _turns(self, first: Kind, given: Kind) -> Iterator[np.ndarray]:
        """Yield orthogonal Q with x_first = Q x about the centroids that reference nodes suggest."""
        dim = first.arms.shape[1]
        if given.width not in (1, dim):  # of revolution, with torsion: components are not those of the plane
            yield np.eye(dim)
            return
        near = self._agreement.marks
        chosen = first.references(near)
        goal, count = first.arms[chosen] / first.reach, 0
        images = [np.flatnonzero(np.abs(given.marks - first.marks[node]) <= near) for node in chosen]
        arms = given.arms / first.reach
        for nodes in _tuples(arms, goal, images, near):
            yield _nearest_orthogonal(np.linalg.solve(arms[nodes], goal).T)
            count += 1
            if count == self._agreement.motions:
                return

    def _same_matrix(self, first: Kind, given: Kind, nodes: np.ndarray, Q: np.ndarray) -> bool:
        """Return whether P K Pᵀ is the stiffness of the first one."""
        A, B, count = first.blocks, given.blocks, len(nodes)
        numbers = sp.csr_matrix((np.arange(1, len(B.indices) + 1), B.indices, B.indptr), shape=(count, count))
        moved = numbers[nodes][:, nodes].tocsr()
        moved.sort_indices()
        if not (np.array_equal(moved.indptr, A.indptr) and np.array_equal(moved.indices, A.indices)):
            return False
        data = B.data[moved.data - 1]
        return self._agree(A.data, Q @ data @ Q.T if given.width == len(Q) else data)


def _nearest_orthogonal(matrix: np.ndarray, near: float = 1e-9) -> np.ndarray:
    """Return the orthogonal factor of a matrix; axes that lie on each other to ``near`` do so exactly."""
    left, _, right = np.linalg.svd(matrix)
    Q = np.asarray(left @ right)
    whole = np.round(Q)
    return whole if np.abs(Q - whole).max() <= near else Q


def _tuples(
    arms: np.ndarray, goal: np.ndarray, images: Sequence[np.ndarray], near: float
) -> Iterator[np.ndarray]:
    """Yield tuples of nodes, one of each list of images, whose arms have the products of the goal's."""
    pending = [np.zeros(0, dtype=np.int64)]
    while pending:
        chosen = pending.pop()
        k = len(chosen)
        if k == len(goal):
            yield chosen
            continue
        products = arms[images[k]] @ arms[chosen].T
        fits = np.all(np.abs(products - goal[:k] @ goal[k]) <= near, axis=1)
        pending += [np.append(chosen, node) for node in images[k][fits][::-1]]
