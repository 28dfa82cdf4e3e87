"""All groups of rows of a system, their numbers and their compliance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._pairing.points import ContactPoints
from fenics_contact._scene.scene import Scene
from fenics_contact.feti.contact_rows import NormalRows, TangentialRows
from fenics_contact.feti.row_groups import Glued, Joint, RowGroup, Unknowns
from fenics_contact.qp.face import ContactLaw


@dataclass(frozen=True, eq=False)
class RowCompliance:
    """C(λ) of this rank's rows.

    `soft`: positions of rows of equality with a compliance among the owned ones; `constant`: that of each of
    these, C(λ) = C λ; `contact`: that of contact rows, see `qp`.
    """

    soft: np.ndarray
    constant: np.ndarray
    contact: ContactLaw

    def added(self, product: np.ndarray, multiplier: np.ndarray) -> np.ndarray:
        """Add C λ in rows of equality to an owned vector, in place, and return it."""
        product[self.soft] += self.constant * multiplier[self.soft]
        return product

    def energies(self, multiplier: np.ndarray) -> tuple[float, float]:
        """Return λᵀC(λ) and Φ(λ), with Φ' = C, of this rank's rows, [force · length]."""
        force = multiplier[self.soft]
        work = float(force @ (self.constant * force))
        pressing, stored = self.contact.energies(multiplier)
        return work + pressing, 0.5 * work + stored


Kind = TypeVar("Kind", bound=RowGroup)


@dataclass(frozen=True, eq=False)
class RowGroups:
    """All groups of a system in the order of their rows.

    `joints`: what joins bodies, in the order of `feti.joints`; `further`: rows that a linearisation adds.
    """

    glued: Glued
    joints: tuple[Joint, ...]
    normal: NormalRows
    slips: TangentialRows
    further: tuple[RowGroup, ...] = ()

    @cached_property
    def members(self) -> tuple[RowGroup, ...]:
        """All of them."""
        return (self.glued, *self.joints, self.normal, self.slips, *self.further)

    def __iter__(self) -> Iterator[RowGroup]:
        """Return them in their order."""
        return iter(self.members)

    def of(self, kind: type[Kind]) -> tuple[Kind, ...]:
        """Return those of a kind."""
        return tuple(each for each in self.members if isinstance(each, kind))

    @cached_property
    def _first(self) -> dict[RowGroup, int]:
        ends = np.cumsum([each.count for each in self.members])
        return {each: int(end) - each.count for each, end in zip(self.members, ends, strict=True)}

    @property
    def total(self) -> int:
        """Number of rows."""
        return sum(each.count for each in self.members)

    @property
    def n_equality(self) -> int:
        """Number of rows before those of contact."""
        return self._first[self.normal]

    def rows_of(self, group: RowGroup) -> np.ndarray:
        """Return the numbers of the rows of a group, shape (count,)."""
        return self._first[group] + np.arange(group.count)

    def within(self, group: RowGroup, values: np.ndarray) -> np.ndarray:
        """Return the part of a group of values of all rows."""
        return values[self._first[group] : self._first[group] + group.count]

    def marks(self, chosen: Sequence[RowGroup]) -> np.ndarray:
        """Return marks of the rows of some groups, shape (total,)."""
        return np.repeat([each in chosen for each in self.members], [each.count for each in self.members])

    def of_supports(self, prescribed: np.ndarray) -> np.ndarray:
        """Return what prescribed displacements are in all rows of free ones, shape (total,), [length]."""
        return np.concatenate([each.of_supports(prescribed) for each in self.members])

    def sides(self, scene: Scene, prescribed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what supports are in all rows, and c less that, shape (total,) each, [length]."""
        supported = self.of_supports(prescribed)
        return supported, np.concatenate([each.right(scene, prescribed) for each in self.members]) - supported

    @property
    def compliance(self) -> np.ndarray:
        """The diagonal of C of all rows, shape (total,), [length / force]."""
        return np.concatenate([each.compliance for each in self.members])

    def columns(self, fields: sp.csr_matrix) -> sp.csr_matrix:
        """Return by how much fields of nodes, (n_nodes · dim, n), close all rows, shape (total, n)."""
        return sp.vstack([each.columns(fields) for each in self.members], format="csr")

    def unknowns(self, scene: Scene) -> Unknowns:
        """Return the unknowns that groups have of their own, on all rows."""
        own = [each.unknowns(scene) for each in self.members]
        columns = sp.block_diag([each.columns for each in own], format="csr")
        return Unknowns(columns, np.concatenate([each.load for each in own]))

    @property
    def fitted(self) -> tuple[RowGroup, ...]:
        """Those to which free motions are fitted: rows of supports alone where no group has unknowns."""
        if any(each.draws for each in self.members):
            return tuple(each for each in self.members if each.closes)
        return (self.glued,)

    def with_points(self, points: ContactPoints) -> RowGroups:
        """Return those whose contact points have other gaps."""
        normal, slips = replace(self.normal, points=points), replace(self.slips, points=points)
        return replace(self, normal=normal, slips=slips)
