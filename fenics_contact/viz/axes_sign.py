"""A small sign of the coordinate axes in the corner of an image."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.offsetbox import AnchoredOffsetbox, DrawingArea
from matplotlib.patches import FancyArrowPatch
from matplotlib.text import Text

from fenics_contact.viz.colours import INK
from fenics_contact.viz.view import Frame, View

#: Length of an axis across the view, and the space for its name, in points.
LENGTH, NAME = 38.0, 9.0
#: An axis that appears shorter than this fraction of its length points along the view and is left out.
SHORTEST = 0.1
#: Corners by matplotlib's name, as a fraction of the image; the scale bar has the fourth.
CORNERS = {"lower right": (1.0, 0.0), "upper right": (1.0, 1.0), "upper left": (0.0, 1.0)}
#: Fraction of an image that a sign in its corner covers.
COVERED = 0.18


def arrows_of(view: View) -> dict[str, np.ndarray]:
    """Return the axes as they run in a view, right and up, (2,) each; none that runs along the view."""
    ends = view.project(np.eye(3))
    return {name: end for name, end in zip("xyz", ends, strict=True) if np.linalg.norm(end) > SHORTEST}


def far_corner(frame: Frame, place: np.ndarray) -> str:
    """Return the corner of a frame that is farthest from a place (2,)."""
    spot = (place - frame.low) / float(np.max(frame.size))
    # Rounding: corners alike must not be decided by the last bit.
    away = {
        name: round(float(np.linalg.norm(np.array(corner) * frame.size / np.max(frame.size) - spot)), 1)
        for name, corner in CORNERS.items()
    }
    return max(away, key=lambda name: away[name])


def empty_corner(image: np.ndarray) -> str:
    """Return the corner of an image, (height, width, 3), that is white more than others."""
    size = round(COVERED * min(image.shape[:2]))
    pieces = {
        "lower right": image[-size:, -size:],
        "upper right": image[:size, -size:],
        "upper left": image[:size, :size],
        "lower left": image[-size:, :size],
    }
    return max(pieces, key=lambda name: round(float(np.mean(np.all(pieces[name] > 250, axis=-1))), 1))


def axes_sign(axes: Axes, view: View, corner: str, *, below: bool = False) -> None:
    """Draw the axes as arrows with names on a light ground in a corner.

    Args:
        axes: Where to.
        view: Direction of view.
        corner: Where in it, such as "lower right".
        below: Draw it below the image instead, on the right.
    """
    arrows = {name: LENGTH * end for name, end in arrows_of(view).items()}
    names = {name: end * (1 + NAME / np.linalg.norm(end)) for name, end in arrows.items()}
    reached = np.array([np.zeros(2), *names.values()])
    low, high = reached.min(axis=0) - NAME, reached.max(axis=0) + NAME
    area = DrawingArea(*(high - low), *-low)
    for name, end in arrows.items():
        arrow = {"color": INK, "lw": 1.8, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 13}
        area.add_artist(FancyArrowPatch((0, 0), tuple(end), arrowstyle="-|>", **arrow))
        area.add_artist(Text(*names[name], name, color=INK, ha="center", va="center", fontsize=14))
    look = {"child": area, "pad": 0.1, "borderpad": 0.3, "frameon": True}
    if below:
        look |= {"bbox_to_anchor": (1.0, 0.0), "bbox_transform": axes.transAxes}
    box = AnchoredOffsetbox("upper right" if below else corner, **look)
    box.patch.set(facecolor="white", edgecolor="none", alpha=0.75)
    axes.add_artist(box)
