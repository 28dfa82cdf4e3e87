"""Plane sections through deformed bodies where they touch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyvista as pv

from fenics_contact.contact import ContactResult
from fenics_contact.viz.colours import INK
from fenics_contact.viz.fields import BodyFields
from fenics_contact.viz.stage import Layer
from fenics_contact.viz.view import Frame, View, looking_along

#: Half width of a section, in radii of a disc as large as the closed part of the contact surface.
REACH = 5.0

_OUTLINE = (("white", 7), (INK, 3))
_CELL_TYPES = {"hexahedron": pv.CellType.HEXAHEDRON, "tetrahedron": pv.CellType.TETRA}


def contact_centre(contact: ContactResult, points: np.ndarray) -> np.ndarray:
    """Return the force-weighted middle of the contact, (3,).

    Args:
        contact: Forces on the contact points; some force must act.
        points: Places of the contact points, (n, 3).
    """
    weight = contact.normal_force / contact.normal_force.sum()
    return np.asarray(weight @ points)


def section_views(contact: ContactResult, main: View) -> list[View]:
    """Return the views onto two planes that hold the mean contact normal, perpendicular to each other.

    Both are seen from the side of the main view, and what is horizontal there stays so where it can.
    """
    normal = contact.normal_force @ contact.points.normal
    normal = normal / np.linalg.norm(normal)
    helper = np.eye(3)[int(np.argmin(np.round(np.abs(normal), 6)))]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first)
    views = []
    for across in (first, np.cross(first, normal)):
        towards = across if across @ main.towards > 0 else -across
        inside = (normal, np.cross(normal, towards))
        horizontal = max(inside, key=lambda d: abs(float(d @ main.right)))
        sign = 1.0 if horizontal @ main.right > 0 else -1.0
        views.append(looking_along(towards, sign * horizontal))
    return sorted(views, key=lambda view: -float(view.towards @ main.towards))


def half_width(contact: ContactResult, points: np.ndarray) -> float:
    """Return how far around the contact a section reaches, [length].

    Args:
        contact: Tells the closed part of the surface.
        points: All nodes of the bodies, (n, 3): it never reaches beyond their size.
    """
    closed = contact.normal_force > 0
    radius = float(np.sqrt(contact.points.area[closed].sum() / np.pi))
    return min(REACH * radius, 0.6 * float(np.ptp(points, axis=0).max()))


def section_frame(view: View, centre: np.ndarray, half: float, proportion: float) -> Frame:
    """Return a frame of given half height around a point, ``proportion`` times as wide as high."""
    middle = view.project(centre[None])[0]
    reach = half * np.array([proportion, 1.0])
    return Frame(middle - reach, middle + reach)


def section_layers(
    bodies: Mapping[str, BodyFields],
    scalars: Mapping[str, np.ndarray],
    view: View,
    origin: np.ndarray,
    colours: Mapping[str, Any],
) -> list[Layer]:
    """Cut all bodies, as they are after deformation, by a plane and draw the cut in colours.

    Args:
        bodies: Fields of the bodies.
        scalars: Body name -> values on nodes or cells.
        view: Its direction is the plane's normal.
        origin: A point of the plane, (3,).
        colours: Keywords of ``add_mesh`` that turn values into colours.
    """
    layers = []
    for name, body in bodies.items():
        points = body.deformed(1.0)
        kind = _CELL_TYPES[body.mesh.cell_type]
        grid = pv.UnstructuredGrid({kind: body.mesh.cells}, points)
        on_nodes = len(scalars[name]) == body.mesh.n_nodes
        (grid.point_data if on_nodes else grid.cell_data)["shown"] = scalars[name]
        # A hair beside the plane: where it runs along faces of cells, both neighbours would be cut or none.
        beside = origin + 1e-6 * float(np.ptp(points)) * view.towards
        cut = grid.slice(normal=view.towards, origin=beside)
        if cut.n_points:
            layers.append(Layer(cut, {"scalars": "shown", "lighting": False, **colours}))
            edge = cut.extract_feature_edges(boundary_edges=True, feature_edges=False, manifold_edges=False)
            # Dark on a light border, to be seen on every colour.
            layers += [Layer(edge, {"color": c, "line_width": w, "lighting": False}) for c, w in _OUTLINE]
    return layers
