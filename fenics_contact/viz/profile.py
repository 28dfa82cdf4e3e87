"""Outlines of bodies where they touch, before and after a design moved them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.contact import State
from fenics_contact.mesh import boundary_faces
from fenics_contact.viz.painting_in_plane import contact_window
from fenics_contact.viz.section import section_frame, section_views, strongest_contact
from fenics_contact.viz.stage import surface
from fenics_contact.viz.view import View, axis_label, oblique_view
from fenics_contact.viz.words import nice_number

#: Fraction of the picture's size that the largest movement appears to have.
VISIBLE = 0.06
#: Room around the bodies, relative to their size.
BORDER = 0.08
#: Places along each side at which room for a name is sought.
GRID = 40


@dataclass(frozen=True)
class Profile:
    """Outlines in a picture; lines are pairs of places, (n, 2 ends, 2).

    Attributes:
        title: What is shown.
        axes: Names of the two axes, such as "x"; "" where they run along none.
        before: Body name -> lines before.
        moves: Body name -> how the ends of these lines move.
        low: Lower left corner of what is shown, (2,).
        high: Upper right corner, (2,).
    """

    title: str
    axes: tuple[str, str]
    before: dict[str, np.ndarray]
    moves: dict[str, np.ndarray]
    low: np.ndarray
    high: np.ndarray

    @property
    def largest(self) -> float:
        """Largest movement that is seen, [length]."""
        seen = 0.0
        for name, lines in self.before.items():
            inside = np.all((lines > self.low) & (lines < self.high), axis=(1, 2))
            seen = max(seen, float(np.linalg.norm(self.moves[name][inside], axis=-1).max(initial=0.0)))
        return seen

    @property
    def factor(self) -> float:
        """Round factor, at least 1, that makes the movement visible."""
        size = float(np.max(self.high - self.low))
        return max(1.0, nice_number(VISIBLE * size / self.largest)) if self.largest > 0 else 1.0

    def place_in(self, body: str) -> np.ndarray | None:
        """Return where in a body, far from all outlines, its name fits; None if it is not seen."""
        size = self.high - self.low
        steps = (np.arange(GRID) + 0.5) / GRID
        grid = self.low + size * np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
        grid = grid[_inside(grid, self.before[body])]
        if not len(grid):
            return None
        middles = np.concatenate([lines.mean(axis=1) for lines in self.before.values()])
        ends = np.concatenate([lines.reshape(-1, 2) for lines in self.before.values()])
        room = cKDTree(np.concatenate([middles, ends])).query(grid)[0]
        border = np.minimum(grid - self.low, self.high - grid).min(axis=1)
        return np.asarray(grid[np.argmax(np.minimum(room, border))])


def _inside(points: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Tell which points lie inside closed outlines: rays to the right cross them an odd number of times."""
    (x, y), first, second = points.T[..., None], lines[:, 0], lines[:, 1]
    spans = (first[:, 1] > y) != (second[:, 1] > y)
    rise = np.where(first[:, 1] == second[:, 1], 1.0, second[:, 1] - first[:, 1])
    meets = first[:, 0] + (y - first[:, 1]) / rise * (second[:, 0] - first[:, 0])
    return np.asarray(np.sum(spans & (meets > x), axis=1) % 2 == 1)


def profiles(first: State, best: State, reach: float | None) -> list[Profile]:
    """Return the outlines around the strongest contact before: in the plane one, in space two sections.

    Args:
        first: State before, some force acts on its contact.
        best: State after, on the same meshes with other coordinates.
        reach: How far they reach from the contact's middle, [length], or None.
    """
    points = {name: body.mesh.points for name, body in first.scene.bodies.items()}
    moves = {name: body.mesh.points - points[name] for name, body in best.scene.bodies.items()}
    places = first.contact_places
    if first.scene.dim == 2:
        return [_plane_profile(first, points, moves, places, reach)]
    spot, everything = strongest_contact(first.contact, places), np.concatenate(list(points.values()))
    found = []
    for view in section_views(spot, oblique_view(everything)):
        frame = section_frame(view, spot, everything, reach)
        cuts = {name: _cut(first, name, moves[name], view, spot.centre) for name in points}
        across = axis_label(view.towards).strip("−")
        names = axis_label(view.right), axis_label(view.up)
        before, moved = ({name: cut[k] for name, cut in cuts.items()} for k in (0, 1))
        title = f"section across {across}" if across else "section"
        found.append(Profile(title, names, before, moved, frame.low, frame.high))
    return found


def _plane_profile(
    first: State,
    points: dict[str, np.ndarray],
    moves: dict[str, np.ndarray],
    places: np.ndarray,
    reach: float | None,
) -> Profile:
    window = contact_window(first.contact, places, reach)
    assert window is not None, "no force acts on the contact"
    edges = {name: boundary_faces(body.mesh.linear.cells, 2)[0] for name, body in first.scene.bodies.items()}
    before = {name: points[name][edges[name]] for name in points}
    everything = np.concatenate(list(points.values()))
    border = BORDER * float(np.ptp(everything, axis=0).max())
    low = np.maximum(window[0], everything.min(axis=0) - border)
    high = np.minimum(window[1], everything.max(axis=0) + border)
    return Profile("outlines", ("x", "y"), before, {n: moves[n][edges[n]] for n in points}, low, high)


def _cut(
    state: State, body: str, moves: np.ndarray, view: View, origin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lines in which a plane cuts the surface of a body, and how their ends move."""
    mesh = state.scene.bodies[body].mesh.linear
    skin = surface(mesh.points, boundary_faces(mesh.cells, 3)[0])
    skin.point_data["moves"] = moves[skin.point_data["node"]]
    # A hair beside the plane, as in `section_layers`.
    beside = origin + 1e-6 * float(np.ptp(mesh.points)) * view.towards
    cut = skin.slice(normal=view.towards, origin=beside)
    if not cut.n_points:
        return np.zeros((0, 2, 2)), np.zeros((0, 2, 2))
    ends = cut.lines.reshape(-1, 3)[:, 1:]
    return view.project(cut.points)[ends], view.project(np.asarray(cut.point_data["moves"]))[ends]
