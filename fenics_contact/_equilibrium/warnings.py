"""Warnings about states: doubtful gaps and pressures, bodies that turn or pass; hints where steps end."""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.display import counted
from fenics_contact._base.libraries import MPI
from fenics_contact._equilibrium.between_nodes import (
    between_nodes,
    displaced_at,
    more_press_than_a_facet_has,
)
from fenics_contact._equilibrium.corners_inside import corner_between_nodes
from fenics_contact._equilibrium.peaks import coarse_peak, unmatched_nodes
from fenics_contact._equilibrium.rolling import rolling
from fenics_contact._equilibrium.turning import Turning
from fenics_contact._pairing.points import ContactPoints, NodeNumbers
from fenics_contact._scene.local_axes import TILT
from fenics_contact._scene.pair_geometry import Outline, bodies_near, has_same_outline, outline_of, unpaired
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.parts import surface_of
from fenics_contact._scene.plausible import odd_values
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import outside, share_areas
from fenics_contact._surfaces.projection import node_weights, project
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.torn import TornSystem
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import computed_rounding, vector_areas
from fenics_contact.results.contact import ContactResult
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.resolution import BetweenNodes, FacetsOutside, PeakUncertainty
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from fenics_contact.results.deformed_state import AnyState

#: Errors up to this share of what moves are small.
SHARE = 0.1
#: Rotation [rad], as the root mean square of all cells, that triggers the warning: it strains a body of small
#: strain by half of its square.
FAR = 0.05
#: Strain, likewise, at which a material of small strain, or its constants, can hardly be what is meant.
STRAINED = 0.25

_LOG = logging.getLogger(__name__)


class Kind(Enum):
    """What is doubtful about a pair; of each kind a pair is warned of once."""

    SLIDING = auto()
    FACETS_SLID = auto()
    ROLLING = auto()
    PASSING_NODES = auto()
    OPEN_MEANS = auto()
    FACETS = auto()
    OVERLAP = auto()
    INSIDE_FACETS = auto()
    PEAK = auto()


@dataclass(frozen=True)
class Doubt:
    """A doubt about a pair.

    `is_small`: whether most of the contact is resolved all the same: that is information, no warning.
    """

    pair: int
    kind: Kind
    words: str
    is_small: bool = False


class ContactWarnings:
    """Warnings about the states of a problem; each pair, body and two bodies are warned of once."""

    def __init__(self) -> None:
        """Start without any."""
        self._given: set[Hashable] = set()
        self._values: set[str] = set()
        self._points: ContactPoints | None = None
        self._finer = np.zeros(0)
        # Of each body the mesh of its last state, and a bound on rotations by displacements of length one.
        self._rotations = dict[str, tuple[BodyMesh, float]]()
        self._outlines: dict[str, tuple[BodyMesh, Outline]] = {}

    def examined(self, state: AnyState, *, design: bool = False) -> AnyState:
        """Return a state with its doubts about peaks, and warn of what is doubtful. Collective."""
        self._begin()
        if isinstance(state, LinearState):
            if design and self._points is not None:
                return state
            found, peaks = self._doubts(state)
            for doubt in found:
                if not (design and doubt.kind is Kind.OVERLAP):
                    self._log_doubt(state, doubt)
        else:
            peaks = self._doubts_of_deformed(state)
        self._warn_of_large_rotations(state)
        return replace(state, peak_uncertainties=(*peaks, *self._passing_bodies(state)))

    def _doubts_of_deformed(self, state: State) -> tuple[PeakUncertainty, ...]:
        """Warn of pairs of nonlinear materials that slide too far or are too small for cells. Collective."""
        peaks, scene, pressed_in = list[PeakUncertainty](), state.scene, _indentation(state)
        for number, pair in enumerate(scene.contacts):
            deepest = float(pressed_in[state.contact.on_pair(number)].max(initial=0.0))
            if not scene.deforms_much:
                for each in _slid_far(state, number) + _rolling(state, number, deepest):
                    self._log_doubt(state, each)
            if doubt := _between_nodes(state, number, deepest):
                peaks.append(doubt)
                # Load histories pass through first touches: what is pressed is named in the states alone.
                small = deepest > 0.0 and doubt.can_be_small
                small &= not np.isin(state.contact.on_pair(number), state.contact.points.are_inside).any()
                self._log_doubt(state, Doubt(number, Kind.INSIDE_FACETS, doubt.warning, small))
            if deepest <= computed_rounding(scene.bodies[pair.slave.body].mesh.points):
                continue  # nothing presses
            if peak := coarse_peak(state, number, pressed_in):
                peaks.append(peak)
                self._log_doubt(state, Doubt(number, Kind.PEAK, peak.warning, is_small=True))
        return tuple(peaks)

    def warn_of_values(self, scene: Scene, comm: MPI.Comm) -> None:
        """Warn of constants of a scene that are hardly meant, of each once, also on other meshes."""
        for words in odd_values(scene):
            if words not in self._values and comm.rank == 0:
                safe_log(_LOG.warning, "%s", words)
            self._values.add(words)

    def overlaps(self, state: LinearState) -> tuple[str, ...]:
        """Return words about the pairs whose surfaces overlap before they are loaded. Collective."""
        return tuple(each.words for each in self._doubts(state)[0] if each.kind is Kind.OVERLAP)

    def _log(self, state: State, key: Hashable, words: str, log: Callable[..., None] | None = None) -> None:
        if key not in self._given and state.torn.decomposition.comm.rank == 0:
            self._write(log or _LOG.warning, words)
        self._given.add(key)

    def _begin(self) -> None:
        """Begin with another state."""

    def _write(self, log: Callable[..., None], words: str) -> None:
        safe_log(log, "%s", words)

    def _log_doubt(self, state: State, doubt: Doubt) -> None:
        key = doubt.pair, doubt.kind, doubt.is_small
        self._log(state, key, doubt.words, _LOG.info if doubt.is_small else None)

    def _doubts(self, state: LinearState) -> tuple[list[Doubt], tuple[PeakUncertainty, ...]]:
        """Return all doubts about a state, and those about peaks. Collective."""
        torn, contact, found = state.torn, state.contact, list[Doubt]()
        peaks = list[PeakUncertainty]()
        if contact.points.count == 0:
            return found, ()
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
            found += _rolling(state, number, moved)
            found += _passing_nodes(state, number, moved) + _open_means(state, number, moved)
            nearest = np.minimum(before, after) + np.minimum(change[mine], 0.0)
            error = float(np.abs(change[mine][nearest <= moved]).max(initial=0.0))
            doubt = None if error > SHARE * moved else _between_nodes(state, number, moved)
            if doubt is not None:
                peaks.append(doubt)
                found.append(_of_missed(state, number, doubt))
            if error > SHARE * moved:  # which points press is not known then
                found.append(Doubt(number, Kind.FACETS, _words_of_facets(pair, error, moved)))
            elif peak := coarse_peak(state, number, pressed_in):
                peaks.append(peak)
                found.append(Doubt(number, Kind.PEAK, peak.warning, peak.cells > 1))
            elif unmatched := unmatched_nodes(state, number):
                peaks.append(unmatched)
            overlap = -float(before[touching].min(initial=0.0))
            if overlap > max(error, SHARE * moved):
                found.append(Doubt(number, Kind.OVERLAP, _words_of_overlap(pair, overlap, moved)))
        return found, tuple(peaks)

    def _warn_of_large_rotations(self, state: State) -> None:
        """Warn of bodies of small strain that turn so far that they are strained by it. Collective."""
        comm = state.torn.decomposition.comm
        moved = state.torn_displacement.reshape(-1, state.torn.components)
        longest = float(comm.allreduce(np.linalg.norm(moved, axis=1).max(initial=0.0), op=MPI.MAX))
        for name, body in state.scene.deforming.items():
            mesh, bound = self._rotations.get(name, (None, np.inf))
            small = mesh is body.mesh and longest * bound <= FAR
            if body.deforms_much or name in self._given or small:
                continue
            turned = Turning.of(state, name)
            self._rotations[name] = body.mesh, turned.bound
            if turned.rotation > FAR:
                words = (
                    f"body {name!r} has turned by {turned.rotation:.2g} rad; its material is for small "
                    f"rotations, {turned.rotation**2 / 2:.1g} of strain is due to this alone: "
                    f"{'take it in space and ' * body.torsion}give it a material for large "
                    "deformations, such as StVenantKirchhoff"
                )
                self._log(state, name, words)
            if turned.strain > STRAINED:
                self._log(state, (name, "strain"), _words_of_strain(name, turned.strain))

    def _passing_bodies(self, state: State) -> list[FacetsOutside]:
        """Warn of bodies with facets in one another, or that touch without a pair or tie. Collective.

        Only bodies whose bounding boxes come near each other are gathered; ranks share their facets.
        """
        scene, comm = state.scene, state.torn.decomposition.comm
        moved = state.torn_displacement.reshape(-1, scene.components)
        reach = max(comm.allgather(float(np.linalg.norm(moved, axis=1).max(initial=0.0))))
        near = bodies_near(scene, reach)
        names = sorted({name for both in near for name in both})
        numbers = NodeNumbers.of(scene)
        own = {name: numbers.global_nodes(name, np.arange(scene.bodies[name].mesh.n_nodes)) for name in names}
        every = displaced_at(state, np.concatenate([np.zeros(0, dtype=np.int64), *own.values()]))
        displacement = {name: every[nodes] for name, nodes in own.items()}
        share = slice(comm.rank, None, comm.size)
        with together(comm):
            outlines = {name: self._outline(scene, name) for name in names}
            parts = [unpaired(scene, both, outlines, displacement, reach, share) for both in near]
        counts = comm.allreduce(np.array([part.counts for part in parts], dtype=int)).tolist()
        outside = list[FacetsOutside]()
        for part, whole in zip(parts, counts, strict=True):
            if words := replace(part, counts=tuple(whole)).in_words():
                self._log(state, part.bodies, words)
            passing = [pair for pair in scene.contacts if whole[2] and part.is_of(pair)]
            outside += [FacetsOutside(pair.place, whole[2]) for pair in passing]
        return outside

    def _outline(self, scene: Scene, name: str) -> Outline:
        """Return the boundary of a body, which meshes of the same cells share."""
        mesh = scene.bodies[name].mesh
        same = (outline for known, outline in self._outlines.values() if has_same_outline(known, mesh))
        self._outlines[name] = mesh, next(same, ()) or outline_of(mesh)
        return self._outlines[name][1]


class DeferredWarnings(ContactWarnings):
    """Warnings of which those about the last state count, and are logged when `tell` asks for them."""

    def __init__(self) -> None:
        """Start without any."""
        super().__init__()
        self._deferred: list[tuple[Callable[..., None], str]] = []

    def tell(self) -> None:
        """Log the warnings about the last state."""
        for log, words in self._deferred:
            safe_log(log, "%s", words)

    def _begin(self) -> None:
        self._deferred.clear()
        self._given.clear()

    def _write(self, log: Callable[..., None], words: str) -> None:
        self._deferred.append((log, words))


def _words_of_strain(name: str, strain: float) -> str:
    return (
        f"body {name!r} is strained by {strain:.2g} on the average, its material is for small strains: are "
        "Young's modulus and loads in units that belong together, such as N, mm and N/mm² (steel has 2.1e5 "
        "N/mm²) or N, m and Pa? If they are, give it a material for large deformations"
    )


def _slid_far(state: State, number: int) -> list[Doubt]:
    """Return the doubt about a pair whose points slide farther than they may, where there is one.

    Points that press may slide by a facet of the master, all of them across the slave's surface.
    """
    contact, scene, pair = state.contact, state.scene, state.scene.contacts[number]
    mine = contact.on_pair(number)
    if not pair.between_bodies:
        return []
    # Around an axis of revolution surfaces are alike.
    slid = np.linalg.norm(contact.total_slip[mine][:, : scene.dim - 1], axis=1)
    mesh = scene.bodies[pair.slave.body].mesh
    places = mesh.points[np.unique(mesh.surfaces[pair.slave.name])]
    farthest, reach = float(slid.max(initial=0.0)), float(np.linalg.norm(np.ptp(places, axis=0)))
    if farthest > reach:
        return [Doubt(number, Kind.SLIDING, _words_of_sliding(pair, farthest, reach))]
    master = scene.bodies[pair.master_surface.body].mesh
    area = float(share_areas(master, pair.master_surface.name).sum()) / len(
        master.surfaces[pair.master_surface.name]
    )
    pressed, facet = slid[contact.normal_force[mine] > 0.0].max(initial=0.0), area ** (1.0 / (scene.dim - 1))
    words = _words_of_facets_slid(pair, pressed, facet)
    return [Doubt(number, Kind.FACETS_SLID, words)] if pressed > facet else []


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


def _rolling(state: State, number: int, moved: float) -> list[Doubt]:
    """Return the doubt about a pair with a rounded surface that rolls where it should slide. Collective."""
    found, place = rolling(state, number, SHARE * moved), state.scene.contacts[number].place
    words = (
        f"surfaces of {place} that press slide by up to {found.slip:.3g} along each other, but with "
        f"small strains normals stay: surface {found.surface.name!r} of {found.surface.body!r} is rounded, "
        f"and gaps along its normals change by up to {found.gap:.2g} as if it rolled, where surfaces move "
        f"by {moved:.2g} against each other: let the flatter surface be the slave of a pair by mortar, or "
        "the master of one by nodes, or give one of both a material for large deformations, such as "
        "StVenantKirchhoff, whose contact follows"
    )
    return [Doubt(number, Kind.ROLLING, words)] if found.gap > 0.0 else []


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


def _of_missed(state: State, number: int, doubt: BetweenNodes) -> Doubt:
    """Return the doubt, a small one where more points press than a facet has: most of the force is found."""
    small = doubt.can_be_small and more_press_than_a_facet_has(state, number)
    return Doubt(number, Kind.INSIDE_FACETS, doubt.warning, small)


def _between_nodes(state: State, number: int, moved: float) -> BetweenNodes | None:
    """Return what a pair misses between its nodes, by a corner of its master or inside facets. Collective."""
    corner = corner_between_nodes(state, number)
    missed = None if corner else between_nodes(state, number, moved)
    return missed.doubt(state.scene.contacts[number].place) if missed else corner


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
    try:
        return torn.finer_gap()
    except InvalidInputError as error:
        if torn.decomposition.comm.rank == 0:
            safe_log(_LOG.info, "the error of the facets is not known: %s", error)
        return torn.points.gap


def _passing_nodes(state: State, number: int, moved: float) -> list[Doubt]:
    """Return the doubt about a pair whose master passes between the nodes of its slave. Collective."""
    pair = state.scene.contacts[number]
    if pair.by_mortar or not pair.between_bodies or pair.is_self_contact or pair.single_nodes:
        return []
    deep = _depth(state, number, pair, pair.master_surface)
    deep += _nearest(state.contact, number)
    if deep <= SHARE * moved:
        return []
    words = (
        f"nodes of the master of {pair.place} pass between those of the slave, which is too coarse, by up to "
        f"{deep:.2g}, where surfaces move by {moved:.2g} against each other: refine the slave, or let the "
        "finer surface be the slave; discretisation='mortar' has no such error"
    )
    return [Doubt(number, Kind.PASSING_NODES, words)]


def _open_means(state: State, number: int, moved: float, most: float = 0.5) -> list[Doubt]:
    """Return the doubt about a pair by mortar that nothing closes although nodes lie inside the master.

    A round body on coarse facets is so, as means over its facets are open where its lowest node is not.
    Collective. `most`: depth of nodes, relative to it, that is no doubt yet.
    """
    contact, scene, pair = state.contact, state.scene, state.scene.contacts[number]
    presses = contact.normal_force[contact.on_pair(number)].any()
    if presses or not pair.by_mortar or pair.given_gap:
        return []
    slave, master = (surface_of(scene, side, pair.geometry) for side in pair.surfaces)
    hit = project(slave.points, slave.normals, master)
    own = _moves(state, pair.slave)[slave.nodes[hit.point]]
    other = _moves(state, pair.master_surface)[master.nodes]
    gap = hit.gap + np.einsum("nd,nd->n", hit.normal, own - node_weights(master, hit) @ other)
    deep = -float(gap.min(initial=0.0)) + _nearest(contact, number)
    if deep <= most * moved:
        return []
    words = (
        f"nothing presses on {pair.place}, as means over its facets are open, but nodes lie up to {deep:.2g} "
        f"inside the master, where surfaces move by {moved:.2g} against each other: the facets are too large "
        "for this contact, refine them there; discretisation='node' closes single nodes"
    )
    return [Doubt(number, Kind.OPEN_MEANS, words)]


def _nearest(contact: ContactResult, number: int) -> float:
    """Return minus how far unworn surfaces may be inside one another, by closures and wear, [length]."""
    mine = contact.on_pair(number)
    return float((contact.gap - contact.worn_depth)[mine].min(initial=0.0))


def _moves(state: State, surface: Surface) -> np.ndarray:
    """Return the displacements of a body in space, of one that may twist in its section. Collective."""
    return state.gather_displacement(surface.body)[:, : state.scene.dim]


def _depth(state: State, number: int, pair: ContactPair, other: Surface) -> float:
    """Return the largest depth of master nodes below facets of the slave that press, [length].

    Zero where no more master nodes meet these than they have nodes: the slave is the finer surface.
    """
    contact, scene = state.contact, state.scene
    mine = contact.on_pair(number)
    mine = mine[contact.normal_force[mine] > 0.0]
    slave, master = (surface_of(scene, side, pair.geometry) for side in (pair.slave, other))
    first = NodeNumbers.of(scene).first_of(pair.slave.body)
    presses = np.isin(slave.nodes, contact.points.slave[mine] - first)
    if not presses.any():
        return 0.0
    pressed = slave.facets[presses[slave.facets].any(axis=1)]
    size = np.linalg.norm(np.ptp(slave.points[pressed], axis=1), axis=1).max()
    reach = size + np.abs(contact.points.gap[mine]).max()
    away, _ = cKDTree(slave.points[presses]).query(master.points, distance_upper_bound=reach)
    near = np.flatnonzero(np.isfinite(away))
    hit = project(master.points[near], master.normals[near], slave)
    inside = presses[slave.facets[hit.facet]].all(axis=1)
    if np.count_nonzero(inside) <= np.count_nonzero(presses):
        return 0.0
    own = _moves(state, pair.slave)[slave.nodes]
    moves = _moves(state, other)[master.nodes[near[hit.point]]]
    gap = hit.gap + np.einsum("nd,nd->n", hit.normal, moves - node_weights(slave, hit) @ own)
    return -float(gap[inside].min(initial=0.0))


def advice(scene: Scene, last: State | None) -> str:
    """Return words to append to the message of a load step that ends, empty where there is nothing to say."""
    if not scene.deforms_much:
        return _on_symmetry(scene)
    return _on_contact(scene) + ("" if last is None else _on_ends(last)) + _on_symmetry(scene)


def _on_ends(last: State) -> str:
    """Return words on nodes that press on masters from beyond their ends, empty if there are none.

    Where such a node is lost, its force ends at once, and it may come back: no equilibrium is near.
    """
    contact, points, found = last.contact, last.contact.points, []
    total = contact.normal_force.sum()
    for index, pair in enumerate(last.scene.contacts):
        mine = np.flatnonzero((points.pair == index) & (points.facet >= 0) & (contact.normal_force > 0.0))
        if pair.between_bodies and len(mine):
            corners = last.scene.facets(pair.master_surface).shape[1]
            beyond = mine[outside(points.local[mine], corners) > 0.0]
            share = contact.normal_force[beyond].sum() / total
            if share > 0.0:
                surface = f"of surface {pair.slave.name!r}"
                nodes = counted(len(beyond), f"node {surface} presses", f"nodes {surface} press")
                found.append(
                    f"; {nodes} on {pair.master_surface.name!r} from beyond its end with {share:.1%} of the "
                    "normal force, which ends where the master is left: let that reach further there"
                )
    return "".join(found)


def _on_contact(scene: Scene) -> str:
    """Return words on surfaces that slide by nodes and could by mortar, empty if there are none.

    Slave nodes rest in hollows between nodes of the master; where they leave them together, as two bodies
    that are pressed in perfect symmetry, no equilibrium may be near that mortar has.
    """

    def by_nodes(pair: ContactPair) -> bool:
        return pair.between_bodies and not pair.by_mortar and not pair.is_self_contact

    if not any(map(by_nodes, scene.contacts)):
        return ""
    return "; surfaces of bodies meet more smoothly with discretisation='mortar' than by nodes"


def _on_symmetry(scene: Scene) -> str:
    """Return words on flat sides next to contact on which nothing acts, as on a forgotten plane of symmetry.

    A side with another one parallel to it is more likely to be free.
    """
    acting = [*scene.supports, *(load for load in scene.loads if hasattr(load, "surface"))]
    used = {(each.body, each.surface) for each in acting}
    sides = [side for pair in (*scene.contacts, *scene.ties) for side in pair.surfaces]
    used |= {(side.body, side.name) for side in sides}
    found = []
    for name, body in scene.bodies.items():
        mesh = body.mesh
        touching = [mesh.surfaces[side].ravel() for side in mesh.surfaces if _meets(scene, name, side)]
        flat = {side: normal for side in mesh.surfaces if (normal := _normal(scene, name, side)) is not None}
        for side, normal in flat.items():
            alone = sum(abs(normal @ other) > 1.0 - TILT for other in flat.values()) == 1
            adjacent = touching and np.isin(mesh.surfaces[side], np.concatenate(touching)).any()
            if alone and adjacent and (name, side) not in used:
                found.append(f"surface {side!r} of body {name!r}")
    if not found:
        return ""
    which = f"{', '.join(found)}, on which nothing acts"
    return f"; where a flat side is a plane of symmetry it needs a support along its normal: see {which}"


def _meets(scene: Scene, body: str, side: str) -> bool:
    """Return whether a surface is one of a contact pair."""
    return any(Surface(body, side) in (pair.slave, pair.master) for pair in scene.contacts)


def _normal(scene: Scene, body: str, side: str) -> np.ndarray | None:
    """Return the normal of a surface, shape (dim,), None where it is not flat."""
    mesh = scene.bodies[body].mesh
    areas = vector_areas(mesh.points, mesh.surfaces[side])
    normals = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    return normals[0] if len(normals) and np.all(normals @ normals[0] >= 1.0 - TILT) else None
