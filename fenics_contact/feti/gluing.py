"""Orthonormal rows that glue subdomains together and prescribe displacements (Total FETI)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.rows import Rows
from fenics_contact.scene import Scene, Surface


def prescribed_displacements(scene: Scene, tearing: Tearing) -> tuple[np.ndarray, np.ndarray]:
    """Collect the supports node by node.

    Returns:
        Whether a component is prescribed, shape (n_nodes, 3), and its value, same shape, [length].

    Raises:
        InvalidInputError: If two supports prescribe different values for one component of a node.
    """
    n_nodes = int(tearing.node_offset[-1])
    fixed, value = np.zeros((n_nodes, 3), dtype=bool), np.zeros((n_nodes, 3))
    for support in scene.supports:
        facets = scene.facets(Surface(support.body, support.surface))
        nodes = tearing.global_nodes(support.body, np.unique(facets))
        for component, given in enumerate(support.value):
            if given is None:
                continue
            clash = fixed[nodes, component] & (value[nodes, component] != given)
            if clash.any():
                raise InvalidInputError(
                    f"supports must agree where they meet: component {component} of {int(clash.sum())} nodes "
                    f"of surface {support.surface!r} of body {support.body!r} already has another value than "
                    f"{given}: leave the component free (None) in one of them"
                )
            fixed[nodes, component], value[nodes, component] = True, given
    return fixed, value


@lru_cache(maxsize=64)
def helmert(copies: int) -> np.ndarray:
    """Return orthonormal rows that vanish on equal copies, shape (copies - 1, copies)."""
    rows = np.tril(np.ones((copies - 1, copies)))
    k = np.arange(1, copies)
    rows[k - 1, k] = -k
    return rows / np.sqrt(k * (k + 1.0))[:, None]


def gluing_rows(scene: Scene, tearing: Tearing) -> Rows:
    """Build the equality rows B_E u = c_E with B_E B_Eᵀ = I.

    A free component of a node with m copies gets m − 1 gluing rows (a Helmert matrix, c = 0). A
    prescribed one gets m rows, one for each copy, which glue it as well.
    """
    fixed, value = prescribed_displacements(scene, tearing)
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
    anchor = tearing.first_copy[dof // 3] + np.where(is_fixed, within, 0)
    owner = tearing.subdomain_rank[tearing.copy_subdomain[anchor]]
    return Rows(row, copy, component, entry, value.ravel()[dof], owner)


def _prescribed_entries(tearing: Tearing, fixed: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, ...]:
    node, component = np.nonzero(fixed)
    copies = tearing.multiplicity[node]
    within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    row = np.repeat(start[3 * node + component], copies) + within
    copy = np.repeat(tearing.first_copy[node], copies) + within
    return row, copy, np.repeat(component, copies), np.ones(len(row))


def _glued_entries(
    tearing: Tearing, fixed: np.ndarray, start: np.ndarray, copies: int
) -> tuple[np.ndarray, ...]:
    node, component = np.nonzero(~fixed & (tearing.multiplicity == copies)[:, None])
    matrix = helmert(copies)
    k, j = np.nonzero(matrix)
    row = start[3 * node + component][:, None] + k
    copy = tearing.first_copy[node][:, None] + j
    entry = np.broadcast_to(matrix[k, j], row.shape)
    return row.ravel(), copy.ravel(), np.repeat(component, len(k)), entry.ravel()
