"""Groups of rows of B u − C λ − Q q = c: what of one kind is glued, joined or in contact.

A system numbers its rows one group after the other, and asks each group for its part of B and c. What glues
copies and what touches is in every system; what joins bodies is a `Joint`, see `feti.joints`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact.feti.decomposition import Decomposition, GluingRows, Rows, Tearing

if TYPE_CHECKING:
    from typing import Self

    from fenics_contact._pairing.points import ContactPoints
    from fenics_contact._scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Unknowns q of a group of rows, and the loads on them."""

    columns: sp.csr_matrix
    load: np.ndarray


class RowGroup(ABC):
    """Rows of one kind, one after the other; all arrays are replicated.

    Fields are of nodes, shape (n_nodes, dim); ``prescribed`` ones are NaN where free, along the axes of
    nodes, and ``fixed`` marks the prescribed components.
    """

    #: Whether the rows close but for unknowns: free motions are fitted to them.
    closes: ClassVar[bool] = False
    #: Whether the group may have unknowns of its own.
    draws: ClassVar[bool] = False
    #: Whether a load step measures the rows from the state before, as it does with slip.
    from_before: ClassVar[bool] = False

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of rows."""

    @abstractmethod
    def rows(self, tearing: Tearing, fixed: np.ndarray) -> Rows:
        """Return these rows of B."""

    def right(self, scene: Scene, prescribed: np.ndarray) -> np.ndarray:
        """Return c but for what supports move in rows of free components, shape (count,), [length]."""
        return np.zeros(self.count)

    def of_supports(self, prescribed: np.ndarray) -> np.ndarray:
        """Return what prescribed displacements are in rows of free ones, shape (count,), [length]."""
        return np.zeros(self.count)

    def driven(self, change: np.ndarray) -> np.ndarray:
        """Return by how much c changes with prescribed displacements, shape (count,), [length]."""
        return -self.of_supports(change)

    @abstractmethod
    def columns(self, fields: sp.csr_matrix) -> sp.csr_matrix:
        """Return by how much fields of nodes, (n_nodes · dim, n), close the rows, shape (count, n)."""

    def held(self, fixed: np.ndarray) -> np.ndarray:
        """Return which rows supports determine, shape (count,)."""
        return np.zeros(self.count, dtype=bool)

    @property
    def compliance(self) -> np.ndarray:
        """The diagonal of C, shape (count,), [length / force]."""
        return np.zeros(self.count)

    def unknowns(self, scene: Scene) -> Unknowns:
        """Return the unknowns that the group has of its own."""
        return Unknowns(Csr((self.count, 0)), np.zeros(0))


def columns_of(group: RowGroup, fields: sp.csr_matrix, components: int) -> sp.csr_matrix:
    """Return the columns of a group one by one, as supports drive it along each field."""
    moved = [group.driven(each.toarray().reshape(-1, components)) for each in fields.T] if group.count else []
    return Csr(np.array(moved).reshape(fields.shape[1], group.count).T)


@dataclass(frozen=True, eq=False)
class Glued(RowGroup):
    """The rows that glue subdomains together and fix them at supports."""

    closes = True

    gluing: GluingRows

    @property
    def count(self) -> int:
        """Number of rows."""
        return self.gluing.rows.count

    def rows(self, tearing: Tearing, fixed: np.ndarray) -> Rows:
        """Return these rows of B."""
        return self.gluing.rows

    def right(self, scene: Scene, prescribed: np.ndarray) -> np.ndarray:
        """Return the prescribed displacements; they must be of the components that the rows hold."""
        return self.gluing.right_side(prescribed, self.gluing.axes)

    def driven(self, change: np.ndarray) -> np.ndarray:
        """Return the prescribed displacements, zero in rows that glue."""
        return np.asarray(np.nan_to_num(change).ravel()[self.gluing.dof])

    def columns(self, fields: sp.csr_matrix) -> sp.csr_matrix:
        """Return the fields in rows of supports; those that glue are zero, as supports move all else."""
        return fields[self.gluing.dof]


class Joint(RowGroup):
    """Rows of equality between bodies, or of a body alone, with forces of any sign.

    A new kind of joint is a subclass that is registered in `feti.joints`.
    """

    #: Part of the balance of forces to which those of the joint belong.
    balanced_as: ClassVar[str] = "gaps"

    @classmethod
    @abstractmethod
    def key(cls, scene: Scene) -> Sequence[object]:
        """Return what of a scene decides the rows, beside meshes and what supports hold."""

    @classmethod
    @abstractmethod
    def of(
        cls, scene: Scene, decomposition: Decomposition, ties: ContactPoints, known: Sequence[Self]
    ) -> Sequence[Self]:
        """Return the joint of a scene, an empty sequence without any. Collective."""

    def once(
        self, points: ContactPoints, ties: ContactPoints, scene: Scene, prescribed: np.ndarray
    ) -> tuple[ContactPoints, ContactPoints]:
        """Return contact points and tied ones without those that the joint moves as others."""
        return points, ties

    @classmethod
    def stored(cls, scene: Scene) -> Mapping[str, np.ndarray]:
        """Return what of the scene of a state the next load step begins with, by name."""
        return {}

    @classmethod
    def continued(cls, scene: Scene, kept: Mapping[str, np.ndarray]) -> Scene:
        """Return the scene of a load step with what is `kept` of the state before, if there is one."""
        return scene

    def at_end(self, jump: np.ndarray) -> Mapping[str, np.ndarray]:
        """Return what the next load step begins with, by name, for B u in the rows, shape (count,)."""
        return {}

    def check(self, scene: Scene, prescribed: np.ndarray, moving: sp.csr_matrix) -> None:
        """Reject what contradicts itself or supports; `moving`: free motions on nodes, (n_nodes · dim, n)."""

    @abstractmethod
    def measured(self, field: np.ndarray) -> np.ndarray:
        """Return what a displacement of all nodes along the coordinates is in the rows, shape (count,)."""

    @abstractmethod
    def forces(self, multiplier: np.ndarray, fixed: np.ndarray) -> np.ndarray:
        """Return the forces of multipliers at each point or of each equation of the joint."""

    @abstractmethod
    def on_nodes(self, forces: np.ndarray) -> np.ndarray:
        """Return what `forces` are on nodes, shape (n_nodes, dim), [force]."""

    @abstractmethod
    def wrenches(self, modes: np.ndarray, nodes: slice) -> np.ndarray:
        """Return the work of unit forces of the joint in motions of some nodes, shape (n_modes, n)."""

    def released(self, scene: Scene) -> tuple[sp.csr_matrix, np.ndarray]:
        """Return orthonormal directions among those unit forces that are known, (n, k), and their sizes."""
        return Csr((0, 0)), np.zeros(0)

    def require_resisted(self, scene: Scene, moved: np.ndarray, least: float) -> None:
        """Reject released forces against which nothing acts: motions along them, (k,), beyond the least."""

    def carried(self, before: Self, multiplier: np.ndarray) -> np.ndarray:
        """Return a guess of multipliers, shape (count,), from those of the joint with other supports."""
        return np.zeros(self.count)

    def begun(
        self, before: Self, scene: Scene, jump: np.ndarray, multiplier: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return c of the rows and loads of unknowns with which a state before is one of a later scene.

        Unknowns of now that were held have the force that they had, those that were free and are held keep
        what they were; c is NaN where it stays. `jump`: B u in the rows of `before`; `multiplier`: λ there.
        """
        return np.full(self.count, np.nan), np.zeros(0)
