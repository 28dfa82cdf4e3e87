"""Rows of B as sparse triplets over copies of nodes, before ranks select their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Rows:
    """Some rows of B; entry k is B[row[k], (copy[k], component[k])] = value[k].

    Attributes:
        row: Row of each entry, numbered from 0 within these rows, shape (n_entries,).
        copy: Copy of a node, shape (n_entries,).
        component: 0, 1 or 2, shape (n_entries,).
        value: Coefficient, shape (n_entries,).
        right: Right side c of each row, shape (n_rows,), [length].
        owner: Rank that owns each row, shape (n_rows,).
    """

    row: np.ndarray
    copy: np.ndarray
    component: np.ndarray
    value: np.ndarray
    right: np.ndarray
    owner: np.ndarray

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.right)


def stack(parts: Sequence[Rows]) -> Rows:
    """Number the rows of several groups consecutively."""
    starts = np.cumsum([0] + [part.count for part in parts])
    row = np.concatenate([part.row + start for part, start in zip(parts, starts, strict=False)])
    joined = [
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("copy", "component", "value", "right", "owner")
    ]
    return Rows(row, *joined)
