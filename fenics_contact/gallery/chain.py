"""A chain of interlocked links, every link rotated by 90 degrees relative to the one before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.link import Link, chain_link
from fenics_contact.gallery.memory import require_room
from fenics_contact.gallery.ring import LinkShape
from fenics_contact.gallery.touch import PULL_AXIS, check_fit, check_gap

if TYPE_CHECKING:
    from mpi4py import MPI

_QUARTER_TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation about the pull axis."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Links in contact, one after the other along +x.

    Attributes:
        links: The first, third, ... ring lies in the x-z plane, the others in the x-y plane. Every link bears
            with its "contact" surface on the "grip" of the next; the first is to be held at its "grip", the
            last to be pulled at its "contact".
    """

    links: tuple[Link, ...]

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Numbers of the links that touch."""
        return tuple((k, k + 1) for k in range(len(self.links) - 1))


def chain(shapes: Sequence[LinkShape], *, gap: float = 0.0, comm: MPI.Comm | None = None) -> Chain:
    """Build a straight chain of links.

    Neighbours are placed as by `two_links`: each touches the one before at one point.

    Args:
        shapes: The links in their order; equal shapes are meshed once.
        gap: Clearance between neighbours' smooth crowns along the chain, not below zero.
        comm: As in `chain_link`.

    Raises:
        InvalidInputError: If there are fewer than two links, or neighbours do not fit into each other,
            cannot touch at one spot or would penetrate.

    Note:
        Collective on ``comm`` if given.

    Example:
        >>> five = chain([LinkShape(n_around=24, n_a=2, n_b=6)] * 5)
        >>> len(five.links), len(five.pairs)
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
    check_gap(gap)
    built = {shape: chain_link(shape, comm) for shape in dict.fromkeys(shapes)}
    links, pole = [built[shapes[0]]], 0.0
    for number, shape in enumerate(shapes[1:], 1):
        pole += shape.opening - gap
        turn = _QUARTER_TURN if number % 2 else np.eye(3)
        links.append(built[shape].placed(turn, pole * PULL_AXIS))
    return Chain(tuple(links))
