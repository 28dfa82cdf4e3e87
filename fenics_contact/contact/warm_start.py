"""Transfer a multiplier to the system of another geometry or load."""

from __future__ import annotations

import numpy as np

from fenics_contact.feti import DualSystem
from fenics_contact.pairing import ContactPoints
from fenics_contact.qp import DualSolution


def carried_over(old: DualSystem, solution: DualSolution, new: DualSystem) -> np.ndarray:
    """Return a start for ``new``, owned: unchanged gluing forces, contact forces in the new frames.

    Contact points are identified by pair and slave node; a new point starts open. Collective.
    """
    before, after = old.torn, new.torn
    start = np.zeros(len(after.numbering.owned))
    # Ties of a moved scene may have other points; gluing rows are unchanged.
    same = before.n_equality == after.n_equality
    gluing_old = before.numbering.owned < (before.n_equality if same else before.n_gluing)
    gluing_new = after.numbering.owned < (after.n_equality if same else after.n_gluing)
    start[gluing_new] = solution.multiplier[gluing_old]
    normal = before.numbering.gather(solution.multiplier, before.normal_rows)
    tau = before.numbering.gather(solution.multiplier, before.tangential_rows.ravel()).reshape(
        -1, before.dim - 1
    )
    match = _matches(before.points, after.points)
    matched = match >= 0
    values = np.zeros(after.points.count)
    values[matched] = normal[match[matched]]
    _put(new, start, after.normal_rows, values)
    if len(after.frictional):
        friction = np.zeros((before.points.count, before.dim))
        friction[before.frictional] = np.einsum("na,nad->nd", tau, before.points.tangents[before.frictional])
        in_space = np.where(matched[:, None], friction[match], 0.0)[after.frictional]
        turned = np.einsum("nad,nd->na", after.points.tangents[after.frictional], in_space)
        _put(new, start, after.tangential_rows.ravel(), turned.ravel())
    return start


def _matches(before: ContactPoints, after: ContactPoints) -> np.ndarray:
    """Return for each new point the old one of the same pair and slave node, −1 where there is none."""
    if before.count == 0:
        return np.full(after.count, -1)
    width = int(max(before.slave.max(), after.slave.max(initial=0))) + 1
    old, new = before.pair * width + before.slave, after.pair * width + after.slave
    order = np.argsort(old)
    index = np.minimum(np.searchsorted(old[order], new), before.count - 1)
    return np.where(old[order[index]] == new, order[index], -1)


def _put(system: DualSystem, vector: np.ndarray, rows: np.ndarray, values: np.ndarray) -> None:
    position = system.torn.numbering.owned_index(rows)
    vector[position[position >= 0]] = values[position >= 0]
