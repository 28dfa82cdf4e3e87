"""Rigid obstacles in pictures: shaded areas in the plane, outlines of simple shapes in space."""

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
PIECES = 180
#: Margin of the shown part of a plane around the bodies, relative to their size.
BORDER = 0.06
_LINE = {"color": GREY, "line_width": 3, "lighting": False}


def obstacles_of(state: State) -> list[SurfaceShape]:
    """Return the different rigid obstacles of a scene, where they are in a state of it."""
    obstacles: list[RigidObstacle] = []
    for pair in state.scene.contacts:
        if not isinstance(pair.master, Surface) and pair.master not in obstacles:
            obstacles.append(pair.master)
    now = [each.at(state.time) if isinstance(each, MovingObstacle) else each for each in obstacles]
    return [simplified(each) for each in now]


def shade_obstacles(axes: Axes, state: State, frame: Frame) -> None:
    """Shade the inside of a plane scene's obstacles of any shape, where the distance is negative.

    Args:
        axes: Where to.
        state: A state in the plane.
        frame: The visible frame.
    """
    x, y = (np.linspace(a, b, SAMPLES) for a, b in zip(frame.low, frame.high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    for obstacle in obstacles_of(state):
        distance = obstacle.distance(grid.reshape(-1, 2)).reshape(SAMPLES, SAMPLES)
        if distance.min() < 0 < distance.max():
            axes.contourf(x, y, distance, levels=[distance.min(), 0.0], colors=[PALE], zorder=0)
            axes.contour(x, y, distance, levels=[0.0], colors=[GREY], linewidths=1.5, zorder=0.5)


def obstacle_layers(state: State, points: np.ndarray, view: View) -> tuple[list[Layer], np.ndarray]:
    """Draw planes as sheets, spheres and cylinders by their outlines; other shapes in space are omitted.

    Args:
        state: A state in space.
        points: All nodes of the drawn bodies, (n, 3).
        view: Direction of view.

    Returns:
        Layers to draw, and points that the picture should contain, (n, 3).
    """
    layers: list[Layer] = []
    held = [np.zeros((0, 3))]
    for obstacle in obstacles_of(state):
        match obstacle:
            case Plane():
                corners = _sheet(obstacle, points)
                layers += _plane_layers(corners, float(np.asarray(obstacle.normal) @ view.towards))
                held.append(corners)
            case Sphere(centre, radius):
                look = {"normal": view.towards, "n_sides": PIECES, "fill": False}
                outline = pv.Polygon(center=centre, radius=radius, **look)
                layers.append(Layer(outline, _LINE))
            case Cylinder():
                layers += [Layer(pv.Line(*edge), _LINE) for edge in _edges(obstacle, points, view)]
    return layers, np.concatenate(held)


def _plane_layers(corners: np.ndarray, facing: float) -> list[Layer]:
    """A sheet seen from its free side lies behind all bodies; seen from behind it would hide them."""
    sheet = Layer(pv.Quadrilateral(corners), {"color": PALE, "lighting": False})
    outline = Layer(pv.lines_from_points(corners, close=True), _LINE)
    return [sheet, outline] if facing > 0.05 else [outline]


def _sheet(plane: Plane, points: np.ndarray) -> np.ndarray:
    """Return the corners of the part of a plane under the bodies, (4, 3)."""
    normal = np.asarray(plane.normal)
    first = np.eye(3)[int(np.argmin(np.round(np.abs(normal), 6)))]
    first = first - (first @ normal) * normal
    axes = np.stack([first / np.linalg.norm(first), np.cross(normal, first / np.linalg.norm(first))])
    flat = (points - np.asarray(plane.point)) @ axes.T
    border = BORDER * float(np.ptp(points, axis=0).max())
    (x0, y0), (x1, y1) = flat.min(axis=0) - border, flat.max(axis=0) + border
    return np.asarray(plane.point) + np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ axes


def _edges(cylinder: Cylinder, points: np.ndarray, view: View) -> list[np.ndarray]:
    """Return the edges of a cylinder's outline beside the bodies, (2, 3) each; none if it is seen end on."""
    axis = np.asarray(cylinder.axis)
    across = np.cross(axis, view.towards)
    length = float(np.linalg.norm(across))
    if length < 0.05:
        return []
    along = (points - np.asarray(cylinder.point)) @ axis
    line = np.asarray(cylinder.point) + np.array([along.min(), along.max()])[:, None] * axis
    return [line + side * cylinder.radius * across / length for side in (-1.0, 1.0)]
