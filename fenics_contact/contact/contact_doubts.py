"""Warnings about states that rest on doubtful gaps, or in which surfaces slide away from each other."""

from __future__ import annotations

import logging

import numpy as np

from fenics_contact.contact.coarse_peaks import ROUGH, coarse_peak
from fenics_contact.contact.passing_nodes import passing_nodes
from fenics_contact.contact.state import State
from fenics_contact.errors import InvalidInputError, safe_log
from fenics_contact.feti import TornSystem
from fenics_contact.mesh import computed_rounding
from fenics_contact.pairing import ContactPoints
from fenics_contact.scene import ContactPair, Scene, Surface, surface_of
from fenics_contact.surfaces import share_areas

#: Errors up to this share of what moves are small.
SHARE = 0.1

_LOG = logging.getLogger(__name__)


class ContactWarnings:
    """What is doubtful about the contact of a problem; each pair is warned of once."""

    def __init__(self) -> None:
        """Start without any."""
        self._points: ContactPoints | None = None
        self._finer = np.zeros(0)
        self._told: set[tuple[int, str]] = set()

    @property
    def asked(self) -> bool:
        """Whether a state with contact points was judged."""
        return self._points is not None

    def warn(self, state: State, *, overlap: bool = False) -> None:
        """Warn of pairs that slide far, or whose measured gaps are not known well enough. Collective.

        The error of flat facets, or of surfaces reconstructed from nodes, is the difference to gaps between
        surfaces that are known better, see `fenics_contact.surfaces.true_surface`; it is computed once for
        all loads, by one more search for contact and without another solve, and only where a surface is
        curved and its shape not known. Gaps that a pair gives are not doubted.

        Args:
            state: The state.
            overlap: Whether surfaces may overlap before they are loaded, as those of a design do.
        """
        for pair, kind, words in self._doubts(state):
            if not (overlap and kind == "overlap"):
                self._tell(state.torn, pair, kind, words)

    def warn_of_sliding(self, state: State) -> None:
        """Warn of pairs that slide far alone, as where materials are nonlinear. Collective."""
        for number in range(len(state.scene.contacts)):
            for doubt in _slid_far(state, number):
                self._tell(state.torn, *doubt)

    def overlaps(self, state: State) -> tuple[str, ...]:
        """Return words about the pairs whose surfaces overlap before they are loaded. Collective."""
        return tuple(words for _, kind, words in self._doubts(state) if kind == "overlap")

    def _doubts(self, state: State) -> list[tuple[int, str, str]]:
        """Return pair, kind and words of all doubts about a state. Collective."""
        torn, contact, found = state.torn, state.contact, list[tuple[int, str, str]]()
        if contact.points.count == 0:
            return found
        if contact.points is not self._points:
            self._points, self._finer = contact.points, _finer_gap(torn)
        change, pressed_in = self._finer - contact.points.gap, _indentation(state)
        for number, pair in enumerate(torn.scene.contacts):
            mine = contact.on_pair(number)
            found += _slid_far(state, number)
            mine = mine[~contact.points.given[mine]]
            before, after = contact.points.gap[mine], contact.gap[mine]
            touching = contact.normal_force[mine] > 0.0
            moved = _largest_motion(after - before, pressed_in[mine], touching)
            if moved <= computed_rounding(torn.scene.bodies[pair.slave.body].mesh.points):
                continue  # nothing moves
            found += passing_nodes(state, number, moved, SHARE)
            nearest = np.minimum(before, after) + np.minimum(change[mine], 0.0)
            error = float(np.abs(change[mine][nearest <= moved]).max(initial=0.0))
            if error > SHARE * moved:  # which points press is not known then
                found.append((number, "facets", _words_of_facets(pair, error, moved)))
            else:
                found += coarse_peak(state, number, pressed_in)
            overlap = -float(before[touching].min(initial=0.0))
            if overlap > max(error, SHARE * moved):
                found.append((number, "overlap", _words_of_overlap(pair, overlap, moved)))
        return found

    def _tell(self, torn: TornSystem, pair: int, kind: str, words: str) -> None:
        if (pair, kind) not in self._told and torn.decomposition.comm.rank == 0:
            safe_log(_LOG.info if kind == ROUGH else _LOG.warning, "%s", words)
        self._told.add((pair, kind))


def _slid_far(state: State, number: int) -> list[tuple[int, str, str]]:
    """Return the doubt about a pair whose points slide farther than they may, where there is one.

    Points that press may slide by a facet of the master, all of them across the slave's surface.
    """
    contact, scene, pair = state.contact, state.scene, state.scene.contacts[number]
    mine = contact.on_pair(number)
    if not isinstance(pair.master, Surface):
        return []
    slid = np.linalg.norm(contact.total_slip[mine], axis=1)
    mesh = scene.bodies[pair.slave.body].mesh
    places = mesh.points[np.unique(mesh.surfaces[pair.slave.name])]
    farthest, reach = float(slid.max(initial=0.0)), float(np.linalg.norm(np.ptp(places, axis=0)))
    if farthest > reach:
        return [(number, "sliding", _words_of_sliding(pair, farthest, reach))]
    master = scene.bodies[pair.master.body].mesh
    area = float(share_areas(master, pair.master.name).sum()) / len(master.surfaces[pair.master.name])
    pressed, facet = slid[contact.normal_force[mine] > 0.0].max(initial=0.0), area ** (1.0 / (scene.dim - 1))
    return [(number, "facets slid", _words_of_facets_slid(pair, pressed, facet))] if pressed > facet else []


def _words_of_facets_slid(pair: ContactPair, slid: float, facet: float) -> str:
    return (
        f"surfaces of {pair.place} that press slide by up to {slid:.3g} along each other, {slid / facet:.2g} "
        "facets of the master, but with small strains contact points keep the place that they meet at the "
        "start, also beyond the master's edge: move the body in the mesh, or give one of both a material for "
        "large deformations, such as StVenantKirchhoff, whose contact follows"
    )


def _words_of_sliding(pair: ContactPair, slid: float, reach: float) -> str:
    return (
        f"surfaces of {pair.place} slide by up to {slid:.3g} along each other, farther than the slave "
        f"reaches ({reach:.3g}), but contact points keep the place that they meet at the start: hold by a "
        "support what only the facets keep from turning or shifting, or move it in the mesh"
    )


def _indentation(state: State) -> np.ndarray:
    """Return how far the force of each point presses its own node in, shape (n,), [length]. Collective."""
    stiffness = state.torn.numbering.gather(state.rows.step, state.torn.normal_rows)
    return np.asarray(state.contact.normal_force / stiffness)


def _largest_motion(closing: np.ndarray, pressed_in: np.ndarray, touching: np.ndarray) -> float:
    """Return how far surfaces move against each other where they touch, anywhere if they do not, [length].

    Where surfaces touched from the start, that is how far they are pressed in.
    """
    if not touching.any():
        return float(np.abs(closing).max(initial=0.0))
    return float(max(np.abs(closing[touching]).max(), pressed_in[touching].max()))


def _words_of_facets(pair: ContactPair, error: float, moved: float) -> str:
    what, remedy = "surfaces reconstructed from the nodes miss", ""
    if pair.geometry == "faceted":
        what, remedy = "flat facets miss", "take geometry='best', "
    return (
        f"gaps of {pair.place} are uncertain: {what} the true surfaces by up to {error:.2g}, where these "
        f"move by {moved:.2g} against each other: {remedy}give the meshes their shapes (BodyMesh.shapes, or "
        "read them from CAD), or say what the gap is, by ContactPair(gap=...) or interference=..., or by "
        "adjust=..., which puts points in touch that lie nearer than that"
    )


def _words_of_overlap(pair: ContactPair, overlap: float, moved: float) -> str:
    return (
        f"surfaces of {pair.place} overlap by up to {overlap:.2g} before they are loaded and are pressed "
        f"apart by that, where they move by {moved:.2g} against each other: if that is a press fit, declare "
        "it by ContactPair(interference='measured'); if not, adjust=... or gap=0 puts them in touch without "
        "strain"
    )


def _finer_gap(torn: TornSystem) -> np.ndarray:
    """Return gaps between surfaces that are known better, [length]; the same where none are. Collective."""
    if not any(_is_approximate(torn.scene, pair) for pair in torn.scene.contacts):
        return torn.points.gap
    try:
        return torn.finer_gap()
    except InvalidInputError as error:
        if torn.decomposition.comm.rank == 0:
            safe_log(_LOG.info, "the error of the facets is not known: %s", error)
        return torn.points.gap


def _is_approximate(scene: Scene, pair: ContactPair) -> bool:
    """Return whether gaps are measured between curved surfaces that are only known by their nodes."""
    if not isinstance(pair.master, Surface):
        return False
    # Slave nodes lie on their surface; mortar contact also uses what is between them.
    sides = (pair.master, pair.slave) if pair.by_mortar else (pair.master,)
    return any(_is_curved(scene, side, pair) for side in sides)


def _is_curved(scene: Scene, side: Surface, pair: ContactPair) -> bool:
    shapes = scene.bodies[side.body].mesh.origin.shapes
    known = pair.geometry == "best" and side.name in shapes
    return not known and surface_of(scene, side, "reconstructed").relief is not None
