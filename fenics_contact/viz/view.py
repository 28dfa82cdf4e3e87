"""Direction of view and visible part of a picture, in parallel projection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes


@dataclass(frozen=True)
class View:
    """A direction of view.

    Attributes:
        towards: Unit vector from the scene to the viewer, (3,).
        up: Unit vector that points up in the picture, perpendicular to it, (3,).
    """

    towards: np.ndarray
    up: np.ndarray

    @property
    def right(self) -> np.ndarray:
        """Unit vector that points right in the picture, (3,)."""
        return np.cross(self.up, self.towards)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return picture coordinates, (n, 2): right and up."""
        return points @ np.column_stack([self.right, self.up])


#: View of the plane of plane bodies.
IN_PLANE = View(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))


@dataclass(frozen=True)
class Frame:
    """The visible rectangle of a view.

    Attributes:
        low: Lower left corner in picture coordinates, (2,).
        high: Upper right corner, (2,).
    """

    low: np.ndarray
    high: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        """Middle, (2,)."""
        return (self.low + self.high) / 2

    @property
    def size(self) -> np.ndarray:
        """Width and height, (2,)."""
        return self.high - self.low

    def holds(self, places: np.ndarray) -> np.ndarray:
        """Return which points, (..., 2), are visible."""
        return np.asarray(np.all((places > self.low) & (places < self.high), axis=-1))

    def fit(self, axes: Axes) -> None:
        """Let axes show the rectangle with equal scales."""
        axes.set(aspect="equal", xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]))

    @property
    def proportion(self) -> float:
        """Width by height."""
        return float(self.size[0] / self.size[1])


def frame_around(view: View, points: np.ndarray, margin: float = 0.02) -> Frame:
    """Return the frame that contains all points, with a margin as a fraction of its larger side."""
    places = view.project(points)
    low, high = places.min(axis=0), places.max(axis=0)
    border = margin * float(np.max(high - low))
    return Frame(low - border, high + border)


def looking_along(towards: np.ndarray, horizontal: np.ndarray) -> View:
    """Return the view from a side in which a direction appears horizontal.

    Args:
        towards: From the scene to the viewer, (3,), any length.
        horizontal: Direction that points right in the picture, not parallel to it, (3,).
    """
    towards = towards / np.linalg.norm(towards)
    right = horizontal - (horizontal @ towards) * towards
    right /= np.linalg.norm(right)
    return View(towards, np.cross(towards, right))


def oblique_view(points: np.ndarray) -> View:
    """View from the front, slightly from above and from the left, with the longer of x and y horizontal.

    The rotation about the vertical axis is small: a lying as well as a standing ring shows its opening.
    """
    extent = np.ptp(points, axis=0)
    front = np.array([-0.30, -1.0, 0.72])
    if extent[1] > 1.01 * extent[0]:  # what is as long as wide is seen alike, however its points are rounded
        return looking_along(np.array([1.0, -0.30, 0.72]), np.array([0.0, 1.0, 0.0]))
    return looking_along(front, np.array([1.0, 0.0, 0.0]))


def face_on(normal: np.ndarray) -> View:
    """View a plane at right angles: z up if the plane is upright, else y up.

    Args:
        normal: From the plane to the viewer, (3,), any length.
    """
    towards = normal / np.linalg.norm(normal)
    reference = np.array([0.0, 0.0, 1.0]) if abs(towards[2]) < 0.8 else np.array([0.0, 1.0, 0.0])
    return looking_along(towards, np.cross(reference, towards))


def axis_label(direction: np.ndarray) -> str:
    """Name a direction: "x", "−z", or "" if it runs along no axis."""
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) < 0.999:
        return ""
    return ("" if direction[axis] > 0 else "−") + "xyz"[axis]
