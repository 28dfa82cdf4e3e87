"""What is added to the gaps of bodies that move far, where their pair says what these are at first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._libraries import MPI
from fenics_contact.errors import together
from fenics_contact.fingerprint import described, require_alike
from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.pairing.contact_search import find_contact_points
from fenics_contact.pairing.given_gaps import in_reach
from fenics_contact.pairing.sliding.meeting import Meeting
from fenics_contact.scene import ContactPair, Scene


def with_given_offsets(
    meetings: tuple[Meeting, ...], scene: Scene, stood: ContactPoints, fixed: np.ndarray, comm: MPI.Comm
) -> tuple[Meeting, ...]:
    """Return the pairs with the offsets that their given gaps need. Collective.

    The gap of a node counts from its distance as it is measured while bodies move, which by mortar is one
    between facets and may differ from that of the true surfaces: in the given geometry, undeformed, it is
    what the pair says.

    Args:
        meetings: The pairs of a scene without offsets.
        scene: That scene before any design moved its surfaces.
        stood: Its points there, with the distances that are measured while bodies move.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
        comm: Communicator of the ranks; all have the same pairs and points.
    """
    first = find_contact_points(scene, fixed, comm, told=True)
    result = []
    for index, (meeting, pair) in enumerate(zip(meetings, scene.contacts, strict=True)):
        if not pair.given_gap:
            result.append(meeting)
            continue
        place = scene.points[meeting.nodes]
        with together(comm):
            offset, given = _offsets(meeting, pair, place, first, stood, index)
        require_alike(comm, described(offset, f"the gap given between {pair.place}"))
        result.append(replace(meeting, offset=offset, given=given))
    return tuple(result)


def _offsets(
    meeting: Meeting,
    pair: ContactPair,
    place: np.ndarray,
    first: ContactPoints,
    stood: ContactPoints,
    index: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is added to the gap of each candidate, and whether the pair gives its gap."""
    measured, moving = (_of_candidates(meeting, points, index) for points in (first, stood))
    faced = ~np.isnan(measured)
    near = faced & in_reach(pair, np.where(faced, measured, np.inf), place)
    moving = np.where(np.isnan(moving), measured, moving)
    if pair.gives_all_gaps:  # nodes that meet the master only later continue what is next to them
        _, next_to = cKDTree(place[faced]).query(place[~faced])
        moving[~faced] = moving[faced][next_to]
        near[:] = True
    wanted = pair.gap_at(place) if near.any() else None
    target = np.zeros(len(place)) if wanted is None else wanted
    return np.where(near, target - moving, 0.0), near | (pair.interference == "measured")


def _of_candidates(meeting: Meeting, points: ContactPoints, index: int) -> np.ndarray:
    """Return the distances of a pair's points at its candidates, NaN where these have none, [length]."""
    distance, mine = np.full(len(meeting.candidates), np.nan), points.pair == index
    mine &= np.isin(points.slave, meeting.nodes)  # tied nodes are no candidates
    distance[np.searchsorted(meeting.nodes, points.slave[mine])] = points.distance[mine]
    return distance
