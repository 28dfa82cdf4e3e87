"""Gaps before anything moves: bodies must not overlap, and supports leave room between surfaces."""

from __future__ import annotations

import numpy as np

from fenics_contact._base.display import counted
from fenics_contact._pairing.points import HELD, ContactPoints
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError

#: Penetration attributable to faceting, relative to the size of a slave facet.
FACETING = 0.1


def check_no_penetration(scene: Scene, points: ContactPoints) -> None:
    """Reject an initial geometry whose bodies overlap by more than their faceting explains.

    Overlap that the pair declares, see `ContactPair.interference`, is a load like any other.
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
            f"bodies must not overlap at the start: {nodes} {-points.gap[worst]:.3g} inside the master, not "
            f"{-allowed[worst]:.3g} as facets: move them, or give the pair interference='measured' or adjust="
        )


def gap_with_room(
    points: ContactPoints, freedom: np.ndarray, moved: np.ndarray, soft: np.ndarray, slight: float = 0.02
) -> np.ndarray:
    """Return the gaps; between surfaces held by supports, penetration due to faceting is removed.

    `freedom`: free part of the normals, from 0 to 1; `moved`: by how much supports close the gaps; `soft`:
    marks of points that give way, which may be pressed; `slight`: supports hold a point along its normal if
    the free fraction is no larger than this: normals of facets are slightly tilted, and sliding along that
    tilt does not open a gap.
    """
    missing = np.where((freedom <= slight) & ~soft, moved - points.gap, 0.0)
    # A given interference is meant: it must not vanish where nothing can yield.
    pressed = missing > np.where(points.given, HELD, 1.0) * _explained(points)
    if pressed.any():
        raise InvalidInputError(
            f"supports must leave room between surfaces, but {pressed.sum()} contact nodes are pressed up to "
            f"{missing.max():.3g} into their master: prescribe one body alone, or less interference"
        )
    return points.gap + np.maximum(missing, 0.0)


def _explained(points: ContactPoints) -> np.ndarray:
    """Return the penetration that faceting explains at each point, [length]."""
    return FACETING * points.sizes
