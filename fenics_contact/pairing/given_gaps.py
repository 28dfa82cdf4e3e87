"""Gaps that a contact pair gives in place of measured ones: clearances, interferences, adjusted points."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.errors import InvalidDesignError, safe_log, together
from fenics_contact.fingerprint import described, require_alike
from fenics_contact.mesh import computed_rounding
from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.scene import ContactPair

_LOG = logging.getLogger(__name__)


def with_given_gaps(
    points: ContactPoints, first: ContactPoints, pair: ContactPair, place: np.ndarray, comm: MPI.Comm
) -> ContactPoints:
    """Return points with the gaps that their pair gives. Collective on ``comm``.

    A given gap holds in the geometry that was given. Where a design has moved the surfaces since then, the
    change of their distance is added: g = g_given + d − d_first.

    Args:
        points: Points of the pair with measured gaps.
        first: The same before any design moved the surfaces.
        pair: The pair.
        place: Coordinates of the slave nodes of ``first``, shape (n, dim), [length].
        comm: Communicator of the ranks; all have the same points.

    Raises:
        InvalidDesignError: If a design has brought nodes to the master whose first distance is not known.
        InvalidInputError: If a function returns anything but lengths, or not the same on all ranks.
    """
    with together(comm):
        _, now, then = np.intersect1d(points.slave, first.slave, return_indices=True)
        if len(now) < points.count:
            raise InvalidDesignError(
                "where a pair gives its gap, each slave node must face the master from the start, but "
                f"{points.count - len(now)} of {points.count} nodes do so only in this design: move the rim "
                "of the surfaces less, or leave the gap of the pair to measurement"
            )
        measured, place = first.distance[then], place[then]
        near = in_reach(pair, measured, place)
        if comm.rank == 0 and pair.adjust is not None:
            _tell_of_adjusted(pair, near, measured)
        wanted = pair.gap_at(place)
        target = np.where(near, 0.0 if wanted is None else wanted, measured)
    require_alike(comm, described(target, f"the gap given between {pair.place}"))
    moved = points.distance[now] - measured
    moved[np.abs(moved) <= computed_rounding(place)] = 0.0
    declared = near | (pair.interference == "measured")
    gap, given = points.gap.copy(), points.given.copy()
    gap[now], given[now] = target + moved, declared
    return replace(points, gap=gap, given=given)


def in_reach(pair: ContactPair, measured: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return at which points a pair replaces the gap, shape (n,).

    Args:
        pair: The pair.
        measured: Distances of its slave nodes from the master, shape (n,), [length].
        place: Their coordinates, shape (n, dim), [length].
    """
    if pair.adjust is None:
        return np.full(len(measured), pair.gives_all_gaps)
    return np.abs(measured) <= pair.adjust + computed_rounding(place)


def _tell_of_adjusted(pair: ContactPair, near: np.ndarray, measured: np.ndarray) -> None:
    if near.any():
        log, words = (
            _LOG.info,
            "%d of %d points of %s lie within %g of the master and get the gap of the pair",
        )
        safe_log(log, words, np.count_nonzero(near), len(near), pair.place, pair.adjust)
        return
    safe_log(
        _LOG.warning,
        "no point of %s lies within adjust=%g of the master, the nearest has a distance of %.3g: nothing is "
        "put in touch; give a larger adjust, or move the bodies",
        pair.place, pair.adjust, measured[np.argmin(np.abs(measured))],
    )  # fmt: skip
