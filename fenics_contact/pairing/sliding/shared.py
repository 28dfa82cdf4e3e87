"""Nodes on the edge between two slave surfaces that slide over one master: points of one pair only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fenics_contact.pairing.shared_nodes import PARALLEL, are_beside
from fenics_contact.pairing.sliding.meeting import Meeting
from fenics_contact.scene import ContactPair, RigidPlane, Scene, Surface


def shared_once(meetings: tuple[Meeting, ...], scene: Scene) -> tuple[Meeting, ...]:
    """Return the pairs, of which each node that meets the same by nodes has points of the first only.

    Wherever the bodies lie, such nodes have the same counterpart in both pairs: the split of their force
    would not be determined. They keep the area of both surfaces. By mortar the counterparts are means over
    different facets, and of other masters a node may leave one for the other: these points are left alone.

    Args:
        meetings: The pairs in the reference configuration.
        scene: Their scene.
    """
    pairs, result = scene.contacts, list(meetings)
    for other, pair in enumerate(pairs):
        for one in range(other):
            if _meet_alike(pairs[one], pair):
                beside = are_beside(scene, pairs[one], pair)
                result[one], result[other] = _split(result[one], result[other], beside, (other, len(pairs)))
    return tuple(result)


def _meet_alike(pair: ContactPair, other: ContactPair) -> bool:
    """Return whether a node has the same counterpart and gap in both pairs."""
    one, two = pair.master, other.master
    same = one is two or (isinstance(one, (Surface, RigidPlane)) and one == two)
    given = (pair.gap, pair.interference, pair.adjust) == (other.gap, other.interference, other.adjust)
    by_mortar = pair.by_mortar or other.by_mortar
    return same and given and not by_mortar and not pair.within_body and pair.geometry == other.geometry


def _split(kept: Meeting, lost: Meeting, beside: bool, number: tuple[int, int]) -> tuple[Meeting, Meeting]:
    """Return two pairs, the second without the nodes that both have where their surfaces run on smoothly."""
    _, here, there = np.intersect1d(kept.nodes, lost.nodes, return_indices=True)
    normals = kept.slave.normals[kept.candidates[here]], lost.slave.normals[lost.candidates[there]]
    parallel = np.einsum("nd,nd->n", *normals) > PARALLEL
    here, there = here[parallel], there[parallel]
    stays = np.setdiff1d(np.arange(len(lost.candidates)), there)
    if beside:
        area = kept.area.copy()
        area[here] += lost.area[there]
        entries = lost.nodes[there] + 1, (here, np.full(len(here), number[0]))
        taken = sp.csr_matrix(entries, shape=(len(area), number[1]))
        taken = taken if kept.taken is None else kept.taken + taken
        kept = replace(kept, area=area, taken=taken.tocsr())
    return kept, lost.part(stays)
