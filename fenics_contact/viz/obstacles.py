"""Rigid obstacles in pictures and pages: outlines of simple shapes; in the plane also shaded areas."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes

from fenics_contact.contact import State
from fenics_contact.scene import MovingObstacle, RigidObstacle, Surface
from fenics_contact.surface_shapes import Cylinder, Plane, Sphere, SurfaceShape, simplified
from fenics_contact.viz.colours import GREY, PALE
from fenics_contact.viz.stage import Layer
from fenics_contact.viz.view import Frame, View

#: Samples along each side of a plane picture.
SAMPLES = 400
#: Pieces of a circle.
PIECES = 96
#: Margin of the shown part of a plane around the bodies, relative to their size.
BORDER = 0.06


def obstacles_of(state: State) -> list[SurfaceShape]:
    """Return the different rigid obstacles of a scene, where they are in a state of it."""
    obstacles: list[RigidObstacle] = []
    for pair in state.scene.contacts:
        if not isinstance(pair.master, Surface) and pair.master not in obstacles:
            obstacles.append(pair.master)
    now = [each.at(state.time) if isinstance(each, MovingObstacle) else each for each in obstacles]
    return [simplified(each) for each in now]


def shade_obstacles(axes: Axes, obstacles: list[SurfaceShape], frame: Frame) -> None:
    """Shade the inside of plane obstacles of any shape, where the distance is negative."""
    x, y = (np.linspace(a, b, SAMPLES) for a, b in zip(frame.low, frame.high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    for obstacle in obstacles:
        distance = obstacle.distance(grid.reshape(-1, 2)).reshape(SAMPLES, SAMPLES)
        if distance.min() < 0 < distance.max():
            axes.contourf(x, y, distance, levels=[distance.min(), 0.0], colors=[PALE], zorder=0)
            axes.contour(x, y, distance, levels=[0.0], colors=[GREY], linewidths=1.5, zorder=0.5)


def outline(shape: SurfaceShape, points: np.ndarray) -> list[np.ndarray]:
    """Return lines that show an obstacle beside bodies, (n, dim) each; none for shapes other than these.

    Of a plane the edge of the part under the bodies, of a sphere three circles, of a cylinder a circle at
    each end of the part beside the bodies and four lines between them.

    Args:
        shape: The obstacle.
        points: All nodes of the bodies, (n, dim).
    """
    if isinstance(shape, Plane):
        return [_edge(shape, points)]
    if isinstance(shape, Sphere):
        axes = np.eye(len(shape.centre))
        return [
            _circle(np.asarray(shape.centre), (first, second), shape.radius)
            for k, first in enumerate(axes)
            for second in axes[:k]
        ]
    if not isinstance(shape, Cylinder):
        return []
    axis = np.asarray(shape.axis)
    along = (points - np.asarray(shape.point)) @ axis
    ends = [np.asarray(shape.point) + reach * axis for reach in (along.min(), along.max())]
    across = _across(axis)
    sides = [sign * shape.radius * each for each in across for sign in (1.0, -1.0)]
    circles = [_circle(end, across, shape.radius) for end in ends]
    return circles + [np.stack([end + side for end in ends]) for side in sides]


def obstacle_layers(
    obstacles: list[SurfaceShape], points: np.ndarray, view: View
) -> tuple[list[Layer], np.ndarray]:
    """Draw the outlines of obstacles in space, and planes as sheets.

    A sheet seen from its free side lies behind all bodies; seen from behind it would hide them.

    Returns:
        Layers to draw, and points that the picture should contain, (n, 3).
    """
    layers: list[Layer] = []
    held = [np.zeros((0, 3))]
    for obstacle in obstacles:
        lines = outline(obstacle, points)
        if isinstance(obstacle, Plane):
            held += lines
            if np.asarray(obstacle.normal) @ view.towards > 0.05:
                layers.append(Layer(pv.Quadrilateral(lines[0][:-1]), {"color": PALE, "lighting": False}))
        look = {"color": GREY, "line_width": 3, "lighting": False}
        layers += [Layer(pv.lines_from_points(line), look) for line in lines]
    return layers, np.concatenate(held)


def _across(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors perpendicular to a unit vector and to each other."""
    first = np.eye(3)[int(np.argmin(np.round(np.abs(direction), 6)))]
    first = first - (first @ direction) * direction
    first /= np.linalg.norm(first)
    return first, np.cross(direction, first)


def _edge(plane: Plane, points: np.ndarray) -> np.ndarray:
    """Return the edge of the part of a plane under the bodies, closed in space, (5, 3) or (2, 2)."""
    normal = np.asarray(plane.normal)
    axes = np.array([[-normal[1], normal[0]]]) if plane.dim == 2 else np.stack(_across(normal))
    flat = (points - np.asarray(plane.point)) @ axes.T
    border = BORDER * float(np.ptp(points, axis=0).max())
    low, high = flat.min(axis=0) - border, flat.max(axis=0) + border
    corners = [low, high] if plane.dim == 2 else [low, (high[0], low[1]), high, (low[0], high[1]), low]
    return np.asarray(plane.point) + np.array(corners) @ axes


def _circle(centre: np.ndarray, axes: tuple[np.ndarray, np.ndarray], radius: float) -> np.ndarray:
    turn = np.linspace(0.0, 2 * np.pi, PIECES + 1)
    return np.asarray(centre + radius * (np.outer(np.cos(turn), axes[0]) + np.outer(np.sin(turn), axes[1])))
