"""Outlines of bodies near their contact, before and after a design change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy.spatial import cKDTree

from fenics_contact.contact import State, body_grid, in_space
from fenics_contact.viz.fields import points_of
from fenics_contact.viz.painting import REACH as PLANE_REACH
from fenics_contact.viz.section import cut, section_frame, sections_of, strongest_contact
from fenics_contact.viz.view import IN_PLANE, Frame, View, frame_around, oblique_view
from fenics_contact.viz.words import nice_number

#: Apparent size of the largest movement relative to the picture.
VISIBLE = 0.06
#: Margin around the bodies, relative to their size.
BORDER = 0.08


@dataclass(frozen=True)
class Profile:
    """Outlines in a picture; lines are pairs of points, (n, 2 ends, 2).

    Attributes:
        title: Title of the picture.
        view: Direction of view.
        before: Body name -> lines before.
        moves: Body name -> displacement of the ends of these lines.
        inside: Body name -> points within it, (n, 2).
        frame: The visible frame.
    """

    title: str
    view: View
    before: dict[str, np.ndarray]
    moves: dict[str, np.ndarray]
    inside: dict[str, np.ndarray]
    frame: Frame

    @property
    def largest(self) -> float:
        """Largest visible movement, [length]."""
        seen = 0.0
        for name, lines in self.before.items():
            inside = self.frame.holds(lines).all(axis=1)
            seen = max(seen, float(np.linalg.norm(self.moves[name][inside], axis=-1).max(initial=0.0)))
        return seen

    @property
    def factor(self) -> float:
        """Round factor, at least 1, that makes the movement visible."""
        size = float(np.max(self.frame.size))
        return max(1.0, nice_number(VISIBLE * size / self.largest)) if self.largest > 0 else 1.0

    def place_in(self, body: str) -> np.ndarray | None:
        """Return a position for a body's name, far from all outlines; None if it is not visible."""
        places = self.inside[body][self.frame.holds(self.inside[body])]
        if not len(places):
            return None
        lines = np.concatenate(list(self.before.values()))
        room = cKDTree(np.concatenate([lines.mean(axis=1), lines.reshape(-1, 2)])).query(places)[0]
        border = np.minimum(places - self.frame.low, self.frame.high - places).min(axis=1)
        return np.asarray(places[np.argmax(np.minimum(room, border))])


def profiles(first: State, best: State, reach: float | None, unit: str) -> list[Profile]:
    """Return the outlines around the strongest contact before: in the plane one, in space two sections.

    Args:
        first: State before, with some contact force.
        best: State after, on the same meshes with other coordinates.
        reach: Extent from the contact's centre, [length], or None.
        unit: Name of the unit of length.
    """
    bodies = {}
    for name, body in first.scene.bodies.items():
        bodies[name] = body_grid(body.mesh.linear, in_space(body.mesh.points))
        bodies[name].point_data["moves"] = in_space(best.scene.bodies[name].mesh.points - body.mesh.points)
    spot, points = strongest_contact(first.contact, first.contact_places), points_of(bodies)
    if first.scene.dim == 2:
        half = PLANE_REACH * spot.radius if reach is None else reach
        whole = frame_around(IN_PLANE, points, BORDER)
        frame = Frame(np.maximum(spot.centre - half, whole.low), np.minimum(spot.centre + half, whole.high))
        return [_profile("outlines", bodies, IN_PLANE, frame)]
    outlines = []
    for section in sections_of(spot, oblique_view(points)):
        frame = section_frame(section.view, spot, points, reach)
        title = section.title(frame, unit)
        outlines.append(_profile(title, cut(bodies, section), section.view, frame))
    return outlines


def _profile(title: str, faces: Mapping[str, pv.DataSet], view: View, frame: Frame) -> Profile:
    """Return the outlines of plane faces, how they move, and the middles of their cells."""
    before, moves, inside = {}, {}, {}
    for name, face in faces.items():
        edge = face.extract_feature_edges(feature_edges=False, manifold_edges=False)
        ends = edge.lines.reshape(-1, 3)[:, 1:] if edge.n_cells else np.zeros((0, 2), dtype=int)
        before[name] = view.project(np.asarray(edge.points))[ends]
        moves[name] = view.project(np.asarray(edge["moves"]))[ends] if len(ends) else before[name]
        inside[name] = view.project(np.asarray(face.cell_centers().points))
    return Profile(title, view, before, moves, inside, frame)
