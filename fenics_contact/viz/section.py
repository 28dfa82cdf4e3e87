"""Plane sections through deformed bodies at their contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv

from fenics_contact.contact import ContactResult
from fenics_contact.viz.colours import INK
from fenics_contact.viz.fields import Bodies
from fenics_contact.viz.stage import Layer
from fenics_contact.viz.view import Frame, View, frame_around, looking_along

#: Half height of a section, relative to the size of the contact.
REACH = 5.0
#: Ratio of width to height of a section, unless the bodies are smaller.
PROPORTION = 1.4
#: Margin around the bodies, relative to the half height.
BORDER = 0.03

#: Dark on a light border, visible on every colour.
_OUTLINE = (("white", 6), (INK, 3))


@dataclass(frozen=True)
class Spot:
    """Location and size of the contact of a pair.

    Attributes:
        centre: Force-weighted middle, (dim,).
        normal: Mean unit normal, from master to slave, (dim,).
        radius: Radius of a disc, or half length of a line, of the size of the closed part of the surface,
            [length].
    """

    centre: np.ndarray
    normal: np.ndarray
    radius: float


def strongest_contact(contact: ContactResult, places: np.ndarray) -> Spot:
    """Return the contact of the pair with the largest normal force.

    Args:
        contact: Result on the contact points; some force must act.
        places: Positions of the contact points, (n, dim), [length].
    """
    force, points = contact.normal_force, contact.points
    pair = int(np.argmax(np.bincount(points.pair, weights=force)))
    weight = np.where(points.pair == pair, force, 0.0)
    normal = weight @ points.normal
    # Around a pin the normals cancel: there the point of largest force is used.
    if np.linalg.norm(normal) < 1e-3 * weight.sum():
        normal = points.normal[int(np.argmax(weight))]
    area = float(points.area[weight > 0].sum())
    radius = float(np.sqrt(area / np.pi)) if places.shape[1] == 3 else area / 2
    return Spot(weight @ places / weight.sum(), normal / np.linalg.norm(normal), radius)


def section_views(spot: Spot, main: View) -> list[View]:
    """Return the views onto two planes that hold the contact normal, perpendicular to each other.

    Both are seen from the side of the main view, and horizontal directions stay horizontal where possible.
    """
    helper = np.eye(3)[int(np.argmin(np.round(np.abs(spot.normal), 6)))]
    first = np.cross(spot.normal, helper)
    first /= np.linalg.norm(first)
    views = []
    for across in (first, np.cross(first, spot.normal)):
        towards = across if across @ main.towards > 0 else -across
        inside = (spot.normal, np.cross(spot.normal, towards))
        horizontal = max(inside, key=lambda direction: abs(float(direction @ main.right)))
        views.append(looking_along(towards, np.sign(horizontal @ main.right) * horizontal))
    return sorted(views, key=lambda view: -float(view.towards @ main.towards))


def section_frame(view: View, spot: Spot, points: np.ndarray, reach: float | None = None) -> Frame:
    """Return the frame around a contact, limited to the visible bodies.

    Args:
        view: View onto the section.
        spot: Centre and size of the contact.
        points: All nodes of the bodies, (n, 3).
        reach: Extent up and down, [length]; by default five times the radius of the contact.
    """
    bodies = frame_around(view, points, 0.0)
    middle = view.project(spot.centre[None])[0]
    half = (REACH * spot.radius if reach is None else reach) * np.array([PROPORTION, 1.0])
    border = BORDER * min(float(half[1]), float(np.max(bodies.size)) / 2)
    return Frame(
        np.maximum(middle - half, bodies.low - border), np.minimum(middle + half, bodies.high + border)
    )


def cut(body: pv.DataSet, view: View, origin: np.ndarray) -> pv.PolyData:
    """Cut a body, or its surface, by the plane through a point normal to a view.

    Slightly offset: where it runs along faces of cells, both neighbours would be cut or none.
    """
    beside = origin + 1e-6 * float(np.ptp(body.points)) * view.towards
    return body.slice(normal=view.towards, origin=beside)


def section_layers(bodies: Bodies, view: View, origin: np.ndarray, look: Mapping[str, Any]) -> list[Layer]:
    """Cut all bodies by a plane through ``origin``, normal to the view, and draw the cut in colours.

    Args:
        bodies: The bodies, deformed, by name.
        view: Its direction is the plane's normal.
        origin: A point of the plane, (3,).
        look: Keywords of ``add_mesh`` that turn values into colours.
    """
    layers = []
    for body in bodies.values():
        face = cut(body, view, origin)
        if face.n_points:
            layers.append(Layer(face, {"lighting": False, **look}))
            edge = face.extract_feature_edges(boundary_edges=True, feature_edges=False, manifold_edges=False)
            layers += [Layer(edge, {"color": c, "line_width": w, "lighting": False}) for c, w in _OUTLINE]
    return layers
