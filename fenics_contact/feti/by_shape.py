"""What stiffnesses of subdomains are compared by: their entries or, before they are assembled, their cells.

That of an isotropic material depends on the cells and the places of their nodes alone. Where a rigid motion
puts the nodes of one subdomain on those of another to rounding, and its cells on the other's, the matrices
are P K Pᵀ and need not be assembled to be compared. They are for the first ones of each shape and of each
kind of motion; where these samples differ, all are.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.nearby import ToleranceIndex


@dataclass(eq=False)
class Samples:
    """What matrices were compared of and were the same, or were not: families, moved or not, and signs."""

    passed: set[object] = field(default_factory=set)
    failed: set[object] = field(default_factory=set)

    def agrees(self, family: Family, sign: float, compare: Callable[[], bool]) -> bool:
        """Return whether matrices agree: by comparing them where there is no sample yet, or one differed."""
        sort = {(family, sign != 0.0), sign}
        if sort <= self.passed and family not in self.failed:
            return True
        same = compare()
        (self.passed if same else self.failed).update({*sort, family})
        return same


@dataclass(eq=False)
class Family:
    """Shapes of one material with the same invariants, most likely the same shape.

    `stiffness`: the mean diagonal entry of their stiffness, NaN until it is measured.
    """

    key: Hashable
    marks: np.ndarray
    samples: Samples
    stiffness: float = np.nan


class ByMatrix:
    """Of a stiffness that depends on more than the shape, or of which that is not known."""

    family = Family((), np.zeros(0), Samples())

    @property
    def key(self) -> Hashable:
        """What differs where stiffnesses are not compared."""
        return self.family.key

    def cells(self) -> np.ndarray:
        """Return the nodes of each cell, (n_cells, k); none where they do not matter."""
        return np.zeros((0, 0), dtype=np.int64)

    def typical_stiffness(self, measured: Callable[[], float]) -> float:
        """Return the mean diagonal entry of the stiffness, which is assembled where it is measured."""
        return measured()

    def invariants(self, arms: np.ndarray, matrix: Callable[[], sp.csr_matrix]) -> np.ndarray:
        """Return two numbers that rigid motions and numbering leave: trace and norm of the stiffness."""
        values = matrix().data
        return np.array([matrix().diagonal().sum(), np.sqrt(values @ values)])

    def marks(self, matrix: Callable[[], sp.csr_matrix], width: int) -> np.ndarray:
        """Return an invariant of each node, shape (n,)."""
        diagonal = matrix().diagonal()
        return np.asarray(diagonal.reshape(-1, width).sum(axis=1) / np.abs(diagonal).mean())

    def agrees(
        self, other: ByMatrix, nodes: np.ndarray, apart: float, sign: float, compare: Callable[[], bool]
    ) -> bool:
        """Return whether a stiffness is another one moved, by comparing matrices where that is not known.

        `nodes`: the other's node at each of its nodes; `apart`: largest distance of these, relative to the
        size; `sign`: 1 where the motion turns, −1 where it mirrors, 0 where it shifts all nodes
        to those of the same numbers.
        """
        return compare()


BY_MATRIX = ByMatrix()


class ByShape(ByMatrix):
    """Of a stiffness that depends on the shape alone."""

    #: Distance of nodes that are at the same place but for rounding, relative to the size of the subdomain.
    #: Matrices then differ by about this times the cells along it.
    rounding: ClassVar[float] = 1e-13

    def __init__(self, family: Family, cells: Callable[[], np.ndarray]) -> None:
        """Take what returns the nodes of each cell, shape (n_cells, k): meshes have them."""
        self.family, self._cells = family, cells

    def cells(self) -> np.ndarray:
        """Return the nodes of each cell, shape (n_cells, k)."""
        return self._cells()

    def typical_stiffness(self, measured: Callable[[], float]) -> float:
        """Return that of the first one of the family."""
        if np.isnan(self.family.stiffness):
            self.family.stiffness = measured()
        return self.family.stiffness

    def invariants(self, arms: np.ndarray, matrix: Callable[[], sp.csr_matrix]) -> np.ndarray:
        """Return sums of powers of distances from the centroid."""
        squares = (arms**2).sum(axis=1)
        return np.array([squares.sum(), np.sqrt(squares @ squares)])

    def marks(self, matrix: Callable[[], sp.csr_matrix], width: int) -> np.ndarray:
        """Return the number of cells at each node, relative to the mean."""
        counts = np.bincount(self.cells().ravel())
        return counts / counts.mean()

    def agrees(
        self, other: ByMatrix, nodes: np.ndarray, apart: float, sign: float, compare: Callable[[], bool]
    ) -> bool:
        """Return whether cells lie on each other, as matrices of samples do; otherwise compare matrices."""
        if other.family is not self.family or apart > self.rounding:
            return compare()
        if not np.array_equal(_ordered(nodes[self.cells()]), _ordered(other.cells())):
            return compare()
        return self.family.samples.agrees(self.family, sign, compare)


def _ordered(cells: np.ndarray) -> np.ndarray:
    """Return cells in an order of their own, the nodes of each ascending."""
    cells = np.sort(cells, axis=1)
    return np.asarray(cells[np.lexsort(cells.T)])


class Families:
    """The families of shapes of a system."""

    #: Difference of marks of the same shape, relative to the size.
    near: ClassVar[float] = 1e-12

    def __init__(self) -> None:
        """Start empty."""
        self._known: dict[Hashable, ToleranceIndex[Family]] = {}
        self._samples = Samples()

    def add(self, family: Family) -> Family:
        """Add one, also of another system."""
        known = self._known.setdefault(family.key, ToleranceIndex())
        if not any(each is family for each in known.near(float(family.marks.sum()), 0.0)):
            known.add(float(family.marks.sum()), family)
        return family

    def of(self, key: Hashable, points: np.ndarray, cells: np.ndarray) -> Family:
        """Return the family of a shape, a new one where none has its invariants.

        `key`: what the stiffness depends on but the shape, with sizes.
        """
        arms = points - points[0]
        far = np.linalg.norm(arms - arms.mean(axis=0), axis=1)
        marks = np.sort(far / far.max() + 10.0 * np.bincount(cells.ravel(), minlength=len(far)))
        marks = np.append(marks, np.log(far.max()))
        room = self.near * len(marks)
        key = (key, len(points), cells.shape)
        known = self._known.get(key, ToleranceIndex[Family]())
        for family in known.near(float(marks.sum()), room * float(np.abs(marks).max())):
            if np.abs(family.marks - marks).max() <= self.near * max(float(np.abs(marks).max()), 1.0):
                return family
        return self.add(Family(key, marks, self._samples))
