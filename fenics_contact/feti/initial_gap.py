"""Initial gaps: corrected for faceting, and checked against overlaps that supports prescribe."""

from __future__ import annotations

import numpy as np

from fenics_contact.display import counted
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.contact_rows import Relations
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.pairing import (
    HELD,
    ContactPoints,
    find_contact_points,
    find_tied_points,
    join_points,
    shared_once,
    tied_once,
    without_tied,
)
from fenics_contact.scene import Scene

#: Supports hold a point along its normal if the free fraction is no larger than this: normals of facets are
#: slightly tilted, and sliding along that tilt does not open a gap.
SLIGHT = 0.02
#: Penetration attributable to faceting, relative to the size of a slave facet.
FACETING = 0.1


def check_no_penetration(scene: Scene, points: ContactPoints) -> None:
    """Reject an initial geometry whose bodies overlap by more than their faceting explains.

    Overlap that the pair declares, see `ContactPair.interference`, is a load like any other.

    Raises:
        InvalidInputError: Names the pair, the number of nodes and the depth.
    """
    by_mortar = np.array([pair.by_mortar for pair in scene.contacts])
    # Where a facet of length h misses an arc of curvature κ by κh²/8, the dual basis, which is negative in
    # part, has a mean gap of -κh²/12 in addition.
    allowed = -_explained(points) * np.where(by_mortar[points.pair], 5.0 / 3.0, 1.0)
    deep = (points.gap < allowed) & ~points.given
    if deep.any():
        worst = int(np.argmin(np.where(deep, points.gap, np.inf)))
        pair = scene.contacts[int(points.pair[worst])]
        body = f"of {pair.slave.body!r}"
        nodes = counted(int(deep.sum()), f"node {body} lies", f"nodes {body} lie up to")
        raise InvalidInputError(
            f"bodies must not overlap at the start: {nodes} "
            f"{-points.gap[worst]:.3g} inside the master, more than the faceting of the surfaces explains "
            f"({-allowed[worst]:.3g}): move the bodies apart; for a press fit declare the overlap by "
            "ContactPair(interference='measured'), or give its amount, interference=0.05; adjust= puts "
            "points in touch without strain"
        )


def meeting_points(
    scene: Scene, decomposition: Decomposition, *, overlap: bool, told: bool = False
) -> tuple[ContactPoints, ContactPoints]:
    """Search for contact and tied points, only where the scene has pairs. Collective.

    Args:
        scene: The scene.
        decomposition: Its subdomains.
        overlap: Whether bodies may overlap.
        told: Whether doubts about the surfaces were told, as of another design.

    Raises:
        InvalidInputError: As `check_no_penetration`.
    """
    tearing, fixed, comm = decomposition.tearing, decomposition.fixed, decomposition.comm
    points = ties = join_points([], scene.dim, tearing.n_nodes)
    if scene.contacts:
        points = find_contact_points(scene, fixed, comm, told=told)
        if not overlap:
            check_no_penetration(scene, points)
    if scene.ties:
        ties = find_tied_points(scene, fixed, comm, told=told)
        if len(scene.ties) > 1:
            ties = tied_once(ties, scene, fixed)
        if scene.contacts:
            points = without_tied(points, ties, scene, fixed, told=told or comm.rank > 0)
    if len(scene.contacts) > 1:
        points = shared_once(points, scene, told=told or comm.rank > 0)
    return points, ties


def check_apart(scene: Scene, decomposition: Decomposition) -> None:
    """Search for contact and reject bodies that overlap at the start. Collective.

    Raises:
        InvalidInputError: As `check_no_penetration`.
    """
    if scene.contacts:
        points = find_contact_points(scene, decomposition.fixed, decomposition.comm, told=True)
        check_no_penetration(scene, points)


def gap_with_room(normal: Relations, fixed: np.ndarray, prescribed: np.ndarray) -> np.ndarray:
    """Return the gaps; between surfaces held by supports, penetration due to faceting is removed.

    Args:
        normal: The normal rows of all contact points.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
        prescribed: Prescribed components of all nodes, NaN where free, shape (n_nodes, dim).

    Raises:
        InvalidInputError: If supports press surfaces into each other.
    """
    points = normal.points
    missing = np.where(normal.freedom(fixed) <= SLIGHT, normal.of_supports(prescribed) - points.gap, 0.0)
    # A given interference is meant: it must not vanish where nothing can yield.
    pressed = missing > np.where(points.given, HELD, 1.0) * _explained(points)
    if pressed.any():
        raise InvalidInputError(
            f"supports must leave room between surfaces that they hold on both sides, but {pressed.sum()} "
            f"contact nodes are pressed up to {missing.max():.3g} into their master: prescribe one of the "
            "bodies only, another displacement, or less interference there"
        )
    return points.gap + np.maximum(missing, 0.0)


def _explained(points: ContactPoints) -> np.ndarray:
    """Return the penetration that faceting explains at each point, [length]."""
    dim = points.normal.shape[1]
    return np.asarray(FACETING * points.area ** (1.0 / (dim - 1)))
