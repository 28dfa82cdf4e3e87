"""Rows that glue subdomains together and prescribe displacements (Total FETI)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.display import counted
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.rows import Rows
from fenics_contact.linalg import LAST_PLACES
from fenics_contact.scene import Scene


def prescribed_displacements(scene: Scene, tearing: Tearing) -> np.ndarray:
    """Collect the supports node by node.

    Returns:
        The value of each prescribed component, NaN where it is free, shape (n_nodes, dim), [length].

    Raises:
        InvalidInputError: If two supports prescribe different values for one component of a node.
    """
    prescribed = np.full((tearing.n_nodes, scene.dim), np.nan)
    for support in scene.supports:
        own, given = scene.given(support)
        nodes = tearing.global_nodes(support.body, own)
        known = prescribed[nodes]
        near = LAST_PLACES * np.nanmax(np.abs(given))
        clash = ~np.isnan(known) & ~np.isnan(given) & (np.abs(known - given) > near)
        if clash.any():
            node, component = np.argwhere(clash)[0]
            raise InvalidInputError(
                f"supports must agree where they meet: component {component} of "
                f"{counted(int(clash[:, component].sum()), 'node')} of surface {support.surface!r} of body "
                f"{support.body!r} already has another value than {given[node, component]:g}: leave the "
                "component free (None) in one of them"
            )
        prescribed[nodes] = np.where(np.isnan(given), known, given)
    return prescribed


def weighted_helmert(stiffness: np.ndarray) -> np.ndarray:
    """Return rows of unit length that vanish on equal copies and are orthogonal in the inner product D⁻¹.

    Row k is the difference between the stiffness-weighted mean of the first k copies and the next one; with
    equal stiffnesses these are the rows of a Helmert matrix.

    Args:
        stiffness: D of the copies of each node, shape (n, m).

    Returns:
        Shape (n, m − 1, m).
    """
    count, copies = stiffness.shape
    rows = np.zeros((count, copies - 1, copies))
    for k in range(1, copies):  # a few copies, all nodes at once
        rows[:, k - 1, :k] = stiffness[:, :k] / stiffness[:, :k].sum(axis=1, keepdims=True)
        rows[:, k - 1, k] = -1.0
    return rows / np.linalg.norm(rows, axis=2, keepdims=True)


@dataclass(frozen=True)
class GluingRows:
    """The equality rows that glue torn bodies together and fix them at their supports.

    Attributes:
        rows: The rows; their right side is filled from the supports of a load, see `right_side`.
        dof: Node and component that each row belongs to, as node · dim + component, shape (n_rows,).
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
    """

    rows: Rows
    dof: np.ndarray
    fixed: np.ndarray

    def right_side(self, prescribed: np.ndarray) -> np.ndarray:
        """Return c of the rows for displacements from `prescribed_displacements`.

        Raises:
            InvalidInputError: If the prescribed components are not those for which the rows were built.
        """
        if not np.array_equal(~np.isnan(prescribed), self.fixed):
            raise InvalidInputError(
                "the supports of a scene may change their values, not what they hold: "
                f"{np.count_nonzero(self.fixed)} components were prescribed when the scene was decomposed, "
                f"now {np.count_nonzero(~np.isnan(prescribed))} or others are: decompose it again"
            )
        return np.nan_to_num(prescribed).ravel()[self.dof]


def gluing_rows(tearing: Tearing, fixed: np.ndarray) -> GluingRows:
    """Build the equality rows B_E u = c_E, for which B_E D⁻¹ B_Eᵀ is diagonal, D the stiffness of copies.

    A free component of a node with m copies has m − 1 gluing rows of unit length (see `weighted_helmert`, c =
    0). A prescribed one has m rows, one for each copy, which glue it as well.

    Args:
        tearing: Copies of the nodes.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
    """
    multiplicity = tearing.multiplicity
    counts = np.where(fixed, multiplicity[:, None], multiplicity[:, None] - 1)
    start = np.concatenate([[0], np.cumsum(counts.ravel())])
    parts = [_prescribed_entries(tearing, fixed, start)]
    for copies in np.unique(multiplicity[multiplicity > 1]):
        parts.append(_glued_entries(tearing, fixed, start, int(copies)))
    row, copy, component, entry = (np.concatenate(column) for column in zip(*parts, strict=True))

    dof = np.repeat(np.arange(fixed.size), counts.ravel())  # (node, component) of each row
    within = np.arange(len(dof)) - start[dof]
    is_fixed = fixed.ravel()[dof]
    # A gluing row belongs to the rank of the node's first copy, a prescribing row to that of its own copy.
    anchor = tearing.first_copy[dof // tearing.dim] + np.where(is_fixed, within, 0)
    owner = tearing.subdomain_rank[tearing.copy_subdomain[anchor]]
    return GluingRows(Rows(row, copy, component, entry, np.zeros(len(dof)), owner), dof, fixed)


def _prescribed_entries(tearing: Tearing, fixed: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, ...]:
    node, component = np.nonzero(fixed)
    copies = tearing.multiplicity[node]
    within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    row = np.repeat(start[tearing.dim * node + component], copies) + within
    copy = np.repeat(tearing.first_copy[node], copies) + within
    return row, copy, np.repeat(component, copies), np.ones(len(row))


def _glued_entries(
    tearing: Tearing, fixed: np.ndarray, start: np.ndarray, copies: int
) -> tuple[np.ndarray, ...]:
    node, component = np.nonzero(~fixed & (tearing.multiplicity == copies)[:, None])
    copy_of = tearing.first_copy[node][:, None] + np.arange(copies)
    matrix = weighted_helmert(tearing.copy_stiffness[copy_of])
    k, j = np.nonzero(np.tri(copies - 1, copies, 1))
    row = start[tearing.dim * node + component][:, None] + k
    return row.ravel(), copy_of[:, j].ravel(), np.repeat(component, len(k)), matrix[:, k, j].ravel()
