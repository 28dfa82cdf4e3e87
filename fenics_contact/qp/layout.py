"""Which entries of a rank's dual vector are normal, tangential or equality multipliers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True, eq=False)
class ContactLayout:
    """Positions of the contact multipliers in the part of a dual vector that one rank owns.

    Every other entry belongs to an equality row (gluing or Dirichlet). A contact and its friction disc
    live on one rank, so that projections need no communication.

    Attributes:
        size: Length of this rank's owned dual vector.
        normal: Positions of the normal multipliers, shape (n_contact,), owned.
        tangential: Positions of the tangential components, shape (n_friction, t), owned; t is 2 in
            three dimensions and 1 in two.
        friction_of: For each friction disc the index into `normal` of its contact, shape (n_friction,).

    Example:
        >>> layout = ContactLayout.build(5, normal=[2], tangential=[[3, 4]])
        >>> layout.equality
        array([0, 1])
    """

    size: int
    normal: npt.NDArray[np.int64]
    tangential: npt.NDArray[np.int64]
    friction_of: npt.NDArray[np.int64]

    @classmethod
    def build(
        cls,
        size: int,
        normal: npt.ArrayLike = (),
        tangential: npt.ArrayLike = (),
        friction_of: npt.ArrayLike | None = None,
    ) -> ContactLayout:
        """Build a layout from plain lists; by default disc i belongs to contact i."""
        rows = np.asarray(tangential, dtype=np.int64)
        rows = rows.reshape(0, 2) if rows.size == 0 else rows
        owners = np.arange(len(rows)) if friction_of is None else friction_of
        return cls(size, np.asarray(normal, dtype=np.int64), rows, np.asarray(owners, dtype=np.int64))

    def __post_init__(self) -> None:
        """Check shapes, ranges and that no entry is used twice."""
        if self.normal.ndim != 1 or self.tangential.ndim != 2 or self.tangential.shape[1] not in (1, 2):
            raise InvalidInputError(
                f"give normal (n,), tangential (m, 1 or 2), got {self.normal.shape}, {self.tangential.shape}"
            )
        if self.friction_of.shape != (len(self.tangential),):
            raise InvalidInputError(
                f"friction_of must have shape ({len(self.tangential)},), got {self.friction_of.shape}"
            )
        used = np.concatenate([self.normal, self.tangential.ravel()])
        if used.size and (used.min() < 0 or used.max() >= self.size or np.unique(used).size < used.size):
            raise InvalidInputError(
                f"contact positions must be distinct and lie in 0..{self.size - 1}, got {used.size} "
                f"positions, {np.unique(used).size} distinct, from {used.min()} to {used.max()}"
            )
        owners = self.friction_of
        if owners.size and (
            owners.min() < 0 or owners.max() >= self.n_contact or np.unique(owners).size < owners.size
        ):
            raise InvalidInputError(f"friction_of must name distinct contacts, got {owners}")

    @property
    def n_contact(self) -> int:
        """Number of contacts on this rank."""
        return len(self.normal)

    @property
    def n_friction(self) -> int:
        """Number of friction discs on this rank."""
        return len(self.tangential)

    @cached_property
    def equality(self) -> npt.NDArray[np.int64]:
        """Positions of all entries that are neither normal nor tangential, ascending, owned."""
        return np.setdiff1d(np.arange(self.size), self.contact, assume_unique=True)

    @cached_property
    def contact(self) -> npt.NDArray[np.int64]:
        """Positions of all normal and tangential entries, ascending, owned."""
        return np.sort(np.concatenate([self.normal, self.tangential.ravel()]))

    @cached_property
    def tangential_frictional(self) -> npt.NDArray[np.int64]:
        """Positions of the normal multipliers that have a friction disc, shape (n_friction,), owned."""
        return self.normal[self.friction_of]
