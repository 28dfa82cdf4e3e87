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
from fenics_contact.viz.view import Frame, View, axis_label, frame_around, looking_along

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
        centre: Force-weighted middle, (dim,); in space on the planes of symmetry that cut the contact.
        normal: Mean unit normal, from master to slave, (dim,); in space within these planes.
        radius: Radius of a disc, or half length of a line, of the size of the closed part of the surface,
            [length].
        inside: From planes of symmetry into the modelled part of the contact, 0 along other axes, (dim,).
    """

    centre: np.ndarray
    normal: np.ndarray
    radius: float
    inside: np.ndarray


@dataclass(frozen=True)
class Section:
    """A plane through bodies.

    Attributes:
        origin: A point of it, (3,).
        inside: Side to which it is shifted slightly, (3,).
    """

    view: View
    origin: np.ndarray
    inside: np.ndarray

    def title(self, frame: Frame, unit: str) -> str:
        """Return where it lies, to a thousandth of what is seen: "section at y = 0 mm"."""
        axis = axis_label(self.view.towards).strip("−")
        if not axis:
            return "section"
        place, step = float(self.origin["xyz".index(axis)]), 1e-3 * float(np.max(frame.size))
        # Adding zero makes a positive zero of a negative one.
        place = round(place, -int(np.floor(np.log10(step)))) + 0.0
        return f"section at {axis} = {place:g} {unit}".replace("-", "−")


def strongest_contact(contact: ContactResult, places: np.ndarray) -> Spot:
    """Return the contact of the pair with the largest normal force.

    In space planes of symmetry count: half a contact's middle lies on the plane that halves it.

    Args:
        contact: Result on the contact points; some force must act.
        places: Positions of the contact points, (n, dim), [length].
    """
    force, points = contact.normal_force, contact.points
    pair = int(np.argmax(np.bincount(points.pair, weights=force)))
    weight = np.where(points.pair == pair, force, 0.0)
    middle = weight @ places / weight.sum()
    centre, mirrors = _on_mirrors(middle, places, points.symmetric & (weight > 0)[:, None])
    normal = np.where(mirrors, 0.0, weight @ points.normal)
    # Around a pin the normals cancel: there the point of largest force is used, best one on a mirror, and the
    # axis that is nearest to its normal.
    if np.linalg.norm(normal) < 1e-3 * weight.sum():
        held = points.symmetric.sum(axis=1)
        normal = points.normal[int(np.argmax(np.where(held == held[weight > 0].max(), weight, 0.0)))]
        normal = np.eye(len(normal))[int(np.argmax(np.round(np.abs(normal), 6)))]
    area = float(points.area[weight > 0].sum())
    radius = float(np.sqrt(area / np.pi)) if places.shape[1] == 3 else area / 2
    inside = np.where(mirrors, np.sign(middle - centre), 0.0)
    return Spot(centre, normal / np.linalg.norm(normal), radius, inside)


def _on_mirrors(middle: np.ndarray, places: np.ndarray, marks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move a contact's middle to the nearest planes of symmetry; return it and the axes normal to them."""
    mirrors = marks.any(axis=0) & (len(middle) == 3)
    distance = np.where(marks, np.abs(places - middle), np.inf)
    nearest = places[np.argmin(distance, axis=0), np.arange(len(middle))] if len(places) else middle
    return np.where(mirrors, nearest, middle), np.asarray(mirrors)


def sections_of(spot: Spot, main: View) -> list[Section]:
    """Return two planes that hold the middle and the normal of a contact, perpendicular to each other.

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
    return [
        Section(view, spot.centre, spot.inside if abs(spot.inside @ view.towards) > 0.5 else view.towards)
        for view in sorted(views, key=lambda view: -float(view.towards @ main.towards))
    ]


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


def cut(bodies: Mapping[str, pv.DataSet], section: Section) -> dict[str, pv.PolyData]:
    """Cut bodies, or their surfaces, by a plane.

    It is shifted slightly: where it ran along faces of cells, both neighbours would be cut or none. Where it
    misses all bodies it is shifted to the other side.
    """
    faces = {}
    for side in (section.inside, -section.inside):
        for name, body in bodies.items():
            beside = section.origin + 1e-6 * float(np.ptp(body.points)) * side
            faces[name] = body.slice(normal=section.view.towards, origin=beside)
        if any(face.n_points for face in faces.values()):
            break
    return faces


def section_layers(bodies: Bodies, section: Section, look: Mapping[str, Any]) -> list[Layer]:
    """Cut all bodies and draw the cut in colours."""
    layers = []
    for face in cut(bodies, section).values():
        if face.n_points:
            layers.append(Layer(face, {"lighting": False, **look}))
            edge = face.extract_feature_edges(boundary_edges=True, feature_edges=False, manifold_edges=False)
            layers += [Layer(edge, {"color": c, "line_width": w, "lighting": False}) for c, w in _OUTLINE]
    return layers
