"""Two interlocked links, placed so that the smooth surfaces of their crowns just touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.checks import check_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.link import Link, chain_link
from fenics_contact.gallery.ring import LinkShape

if TYPE_CHECKING:
    from mpi4py import MPI

PULL_AXIS = np.array([1.0, 0.0, 0.0])
"""Direction in which link 2 is pulled, away from link 1."""

_TURN = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""Rotation by 180 degrees about the diagonal of y and z: reverses the pull axis and swaps the other two."""


@dataclass(frozen=True, eq=False)
class TwoLinks:
    """Two links in contact.

    Attributes:
        first: The link to be held at its "grip"; on the -x side, ring in the x-z plane.
        second: The link to be pulled along +x at its "grip"; on the +x side, ring in the x-y plane.
    """

    first: Link
    second: Link


def two_links(
    shape: LinkShape | None = None,
    other: LinkShape | None = None,
    *,
    gap: float = 0.0,
    comm: MPI.Comm | None = None,
) -> TwoLinks:
    """Build two interlocked links, the second rotated by 90 degrees about the pull axis.

    Near their contact, link 1 is concave along its ring (radius R) and convex across (radius r) and link 2
    the same, rotated. The gap between them is, with y and z across the pull axis,

        g = gap + y² (1/r1 - 1/R2) / 2 + z² (1/r2 - 1/R1) / 2,

    so they touch at a single point only if r1 < R2 and r2 < R1: the middles of the crowns, at the origin. The
    flat facets of their meshes may slightly overlap there or be separated: contact uses the smooth crowns,
    whose shapes the meshes carry.

    Args:
        shape: Link 1; `LinkShape()` unless given.
        other: Link 2; as link 1 unless given.
        gap: Clearance of the smooth crowns along the pull axis, not below zero.
        comm: As in `chain_link`.

    Raises:
        InvalidInputError: If the links do not fit into each other, cannot touch at one spot, or would
            penetrate.

    Note:
        Collective on ``comm`` if given.
    """
    shape = LinkShape() if shape is None else shape
    other = shape if other is None else other
    check_fit(shape, other)
    check_gap(gap)
    first = chain_link(shape, comm)
    second = first if other == shape else chain_link(other, comm)
    return TwoLinks(first, second.placed(_TURN, -gap * PULL_AXIS))


def check_gap(gap: float) -> None:
    """Reject an invalid clearance.

    Raises:
        InvalidInputError: If it is negative or not a number.
    """
    check_numbers(gap=gap)
    if gap < 0.0:
        raise InvalidInputError(
            f"gap must be zero or positive, got {gap}: links that overlap before anything is loaded press "
            "each other apart"
        )


def check_fit(first: LinkShape, second: LinkShape, names: tuple[str, str] = ("link 1", "link 2")) -> None:
    """Reject links that cannot be interlocked or would not touch at a single point.

    Args:
        first: A link.
        second: Its neighbour.
        names: Their names in messages.

    Raises:
        InvalidInputError: Names the wire that is too large.
    """
    for wire, ring, one, two in ((first, second, *names), (second, first, *names[::-1])):
        if wire.width >= 2.0 * ring.inner_radius or wire.thickness >= ring.opening:
            raise InvalidInputError(
                f"the wire of {one} must pass through the opening of {two}, got a wire {wire.width:g} wide "
                f"and {wire.thickness:g} thick for an opening {2.0 * ring.inner_radius:g} wide and "
                f"{ring.opening:g} long: make the wire thinner, or inner_radius or straight of {two} larger"
            )
        radius = wire.section.crown_radius
        if radius >= ring.inner_radius:
            raise InvalidInputError(
                "links touch at one spot only if the radius across the wire is below the other link's "
                f"inner_radius, got {radius:.6g} for {one} against {ring.inner_radius:.6g} for {two}: make "
                "inner_radius larger, the wire narrower or roundness closer to 1"
            )
