"""Doubts about the largest pressure of contacts that are only a few points wide."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact.contact.state import State
from fenics_contact.display import counted
from fenics_contact.pairing import NodeNumbers
from fenics_contact.scene import ContactPair, surface_of
from fenics_contact.surfaces import FacetedSurface

#: Gaps that grow by this share of how far the point of the largest pressure is pressed in are curved.
CURVED = 0.1
#: The kind of doubt that is no more than a remark.
ROUGH = "rough peak"
#: By how much the largest pressure may be off, by the edges of facets from its point to the next open one.
OFF = {1: "by a half or more", 2: "by a tenth"}


def coarse_peak(state: State, number: int, pressed_in: np.ndarray) -> list[tuple[int, str, str]]:
    """Return the doubt about a pair whose largest pressure lies beside its edge, where there is one.

    So it is of round bodies. Contact that ends where a surface ends, or between planes that lift off each
    other, has no peak that more points would resolve.

    Args:
        state: A state of small strain.
        number: Number of the pair.
        pressed_in: How far its force presses each contact point in, shape (n,), [length].
    """
    contact, scene, pair = state.contact, state.scene, state.scene.contacts[number]
    mine = contact.on_pair(number)
    pressing = contact.normal_force[mine] > 0.0
    if not pressing.any():
        return []
    slave = surface_of(scene, pair.slave, "faceted")
    node = np.searchsorted(
        slave.nodes, contact.points.slave[mine] - NodeNumbers.of(scene).first_of(pair.slave.body)
    )
    top = np.argmax(contact.pressure[mine])
    beside, rim = _beside(slave)
    if rim[node[top]] and not slave.mirrored[node[top]].any():
        return []
    gap = np.full(len(slave.nodes), np.nan)
    gap[node[~pressing]] = contact.points.gap[mine[~pressing]]
    near = beside[node[top]].indices
    for steps, reached in ((1, near), (2, beside[near].indices)):
        opened = gap[reached][~np.isnan(gap[reached])]
        if len(opened):
            grown = opened.min() - contact.points.gap[mine[top]]
            if grown > CURVED * pressed_in[mine[top]]:
                return [
                    (number, "peak" if steps == 1 else ROUGH, _in_words(pair, int(pressing.sum()), steps))
                ]
            break
    return []


def _beside(surface: FacetedSurface) -> tuple[sp.csr_matrix, np.ndarray]:
    """Return which nodes an edge of a facet joins, (n, n), and which lie on the rim, (n,)."""
    ends = surface.facets.ravel(), np.roll(surface.facets, -1, axis=1).ravel()
    one, other = np.concatenate(ends), np.concatenate(ends[::-1])
    count = np.bincount(surface.facets.ravel())
    beside = sp.csr_matrix((np.ones(len(one)), (one, other)), shape=(len(count), len(count)))
    return beside, (beside.getnnz(axis=1) != count) | (count == 1)


def _in_words(pair: ContactPair, count: int, steps: int) -> str:
    points = counted(count, "point presses", "points press")
    cells = counted(steps, "cell")
    return (
        f"the contact of {pair.place} is too small for its cells: {points}, and it ends within "
        f"{cells} of the largest pressure, which may be off {OFF[steps]}; four cells on the half width of a "
        "contact have it to about a percent: refine the meshes there"
    )
