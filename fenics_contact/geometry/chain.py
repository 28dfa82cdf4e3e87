"""A chain of interlocked links, every link turned by 90 degrees against the one before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry.link import Link, chain_link
from fenics_contact.geometry.mesh import BodyMesh
from fenics_contact.geometry.ring import LinkShape
from fenics_contact.geometry.room import require_room
from fenics_contact.geometry.touch import PULL_AXIS, check_fit, check_penetration, mutual_clearance

if TYPE_CHECKING:
    from mpi4py import MPI

_QUARTER_TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""About the pull axis."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Links in touch, one after the other along +x.

    Attributes:
        links: The first, third, ... ring lies in the x-z plane, the others in the x-y plane. Every link bears
            with its "contact" surface on the "grip" of the next; the first is to be held at its "grip", the
            last to be pulled at its "contact".
        clearances: Smallest distance along the chain between neighbours' surfaces, nodes against facets, one
            number for each pair.
        faceting: How far the flat facets stand off the smooth crowns; clearances mean nothing below it.
    """

    links: tuple[Link, ...]
    clearances: tuple[float, ...]
    faceting: float

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Numbers of the links that touch."""
        return tuple((k, k + 1) for k in range(len(self.links) - 1))


def chain(shapes: Sequence[LinkShape], *, gap: float = 0.0, comm: MPI.Comm | None = None) -> Chain:
    """Build a straight chain of links.

    Neighbours are placed as `two_links` places them: each touches the one before at one spot, with a
    measured clearance of ``gap``.

    Args:
        shapes: The links in their order; equal shapes are meshed once.
        gap: Clearance between neighbours along the chain. Down to minus the faceting it may be negative.
        comm: As in `chain_link`.

    Returns:
        The links and the measured clearances.

    Raises:
        InvalidInputError: If there are fewer than two links, or neighbours do not fit into each other,
            cannot touch at one spot or would penetrate by more than the faceting.

    Note:
        Collective on ``comm`` if given.

    Example:
        >>> five = chain([LinkShape(n_around=24, n_a=2, n_b=6)] * 5)
        >>> len(five.links), len(five.clearances)
        (5, 4)
    """
    if len(shapes) < 2:
        raise InvalidInputError(
            f"a chain needs at least two links, got {len(shapes)}: give the shape of every link, such as "
            "[LinkShape()] * 5"
        )
    for number, (one, other) in enumerate(pairwise(shapes), 1):
        check_fit(one, other, (f"link {number}", f"link {number + 1}"))
    longest = max(shapes, key=lambda shape: shape.n_around)
    require_room(len(shapes) * longest.n_around, longest.n_a, longest.n_b)
    faceting = max(shape.faceting for shape in shapes)
    check_penetration(gap, faceting)
    built = {shape: chain_link(shape, comm) for shape in dict.fromkeys(shapes)}
    links, clearances = [built[shapes[0]]], []
    for number, shape in enumerate(shapes[1:], 1):
        turned = built[shape].placed(_QUARTER_TURN if number % 2 else np.eye(3), np.zeros(3))
        shift = _clearance(links[-1], turned) - gap
        links.append(turned.placed(np.eye(3), shift * PULL_AXIS))
        clearances.append(_clearance(links[-2], links[-1]))
    return Chain(tuple(links), tuple(clearances), faceting)


def _clearance(first: Link, second: Link) -> float:
    """Measure the distance between the contact crown of a link and the far crown of the next."""
    far = second.mesh
    return mutual_clearance(first.mesh, BodyMesh(far.points, far.cells, {"contact": far.surfaces["grip"]}))
