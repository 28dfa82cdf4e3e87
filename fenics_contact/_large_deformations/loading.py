"""What acts on the bodies, at the end of a load step and on the way there, and where supports take them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import zip_longest

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._large_deformations.rigid_surfaces import (
    FARTHEST_TURN,
    Motions,
    TurnedSurface,
    tracked_motions,
)
from fenics_contact._scene.fields import evaluate
from fenics_contact._scene.fluids_of_pairs import pressures_of
from fenics_contact._scene.loads import ThermalStrain
from fenics_contact._scene.local_axes import free_matrix
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.decomposition import Decomposition, prescribed_displacements
from fenics_contact.feti.free_motions import FreeMotions
from fenics_contact.feti.torn import TornSystem, build_torn_system
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.mesh.faces import corners_of
from fenics_contact.mesh.quality import similarity
from fenics_contact.qp.reductions import Vector


@displayed
@dataclass(frozen=True, eq=False)
class UnsymmetricLowRank:
    """An unsymmetric stiffness L Rᵀ of few columns.

    `owner`: node whose rank owns the rows of a column.
    """

    left: sp.csr_matrix
    right: sp.csr_matrix
    owner: np.ndarray


def unsymmetric_at(
    decomposition: Decomposition, stiffness: sp.csr_matrix, nodes: np.ndarray
) -> UnsymmetricLowRank:
    """Return the unsymmetric part of a torn stiffness on the free dofs of some nodes. Collective."""
    tearing, dim = decomposition.tearing, decomposition.tearing.components
    here, block = decomposition.held
    node = np.empty(len(here), dtype=np.int64)
    node[block] = tearing.copy_node[here]
    dof = (dim * node[:, None] + np.arange(dim)).ravel()
    skew = sp.coo_matrix((stiffness - stiffness.T) / 2)
    row, column = dof[skew.row], dof[skew.col]
    free = (~decomposition.fixed).ravel()
    # There components of the coordinates are neither free nor held.
    free.reshape(-1, dim)[decomposition.axes.nodes] = True
    kept = nodes[row // dim] & free[row] & free[column]
    mine = (row[kept], column[kept], skew.data[kept], float(np.abs(stiffness.data).max(initial=0.0)))
    parts = decomposition.comm.allgather(mine)
    rows, columns, values = (np.concatenate([part[place] for part in parts]) for place in range(3))
    matrix = sp.csr_matrix((values, (rows, columns)), shape=(len(free),) * 2)
    if decomposition.axes:
        onto = free_matrix(decomposition.fixed, decomposition.axes)
        matrix = (onto @ matrix @ onto).tocsr()
    # Between neighbours it cancels but for rounding.
    matrix.data[np.abs(matrix.data) <= ROUNDING * max(part[3] for part in parts)] = 0.0
    matrix.eliminate_zeros()
    changed = np.flatnonzero(np.diff(matrix.indptr))
    entries = np.ones(len(changed)), (changed, np.arange(len(changed)))
    left = sp.csr_matrix(entries, shape=(len(free), len(changed)))
    return UnsymmetricLowRank(left, matrix[changed].T.tocsr(), changed // dim)


def with_added(
    decomposition: Decomposition, tangents: Sequence[sp.csr_matrix], added: sp.csr_matrix
) -> list[sp.csr_matrix]:
    """Return the tangents of this rank's subdomains with the blocks of a torn matrix added to them."""
    each = zip(tangents, decomposition.parts, strict=True)
    return [(K + added[part, part]).tocsr() for K, part in each]


#: The load step of loads that change in proportion to the time.
NO_COURSE = LoadStep("")


class DeadLoads:
    """The growth of loads with the displacement where there is none."""

    def plus(self, softening: sp.csr_matrix) -> DeadLoads:
        """Return it with that of further loads, −∂f/∂u of this rank, torn."""
        return GrowingLoads(softening)

    def followed(self, decomposition: Decomposition) -> DeadLoads:
        """Return it on nodes that do not follow others."""
        return self

    def taken_from(self, tangents: list[sp.csr_matrix], decomposition: Decomposition) -> list[sp.csr_matrix]:
        """Return the tangents of this rank's subdomains less its symmetric part."""
        return tangents

    def passed_on(self, torn: TornSystem, moved: Vector) -> Vector:
        """Return what neighbours and supports take of its unsymmetric part. Collective.

        Returns change of multipliers, owned, zero but in gluing rows and those of supports, [force].
        """
        return np.zeros(len(torn.numbering.owned))

    def unsymmetric(self, decomposition: Decomposition, nodes: np.ndarray) -> list[UnsymmetricLowRank]:
        """Return its unsymmetric part on the free dofs of some nodes. Collective."""
        return []

    def work(self, torn: TornSystem, displacement: Vector) -> float:
        """Return the work of loads; NaN where it depends on the way. Collective."""
        return torn.load_work(displacement)


@dataclass(frozen=True, eq=False)
class GrowingLoads(DeadLoads):
    """The growth of loads that depend on the displacement.

    `softening`: −∂f/∂u of this rank, torn.
    """

    softening: sp.csr_matrix

    def plus(self, softening: sp.csr_matrix) -> DeadLoads:
        return GrowingLoads(self.softening + softening)

    def followed(self, decomposition: Decomposition) -> DeadLoads:
        follow = decomposition.following
        return GrowingLoads((follow.T @ self.softening @ follow).tocsr())

    def taken_from(self, tangents: list[sp.csr_matrix], decomposition: Decomposition) -> list[sp.csr_matrix]:
        return with_added(decomposition, tangents, (self.softening + self.softening.T) / 2)

    def passed_on(self, torn: TornSystem, moved: Vector) -> Vector:
        return torn.gluing_of(0.5 * (self.softening.T - self.softening) @ moved)

    def unsymmetric(self, decomposition: Decomposition, nodes: np.ndarray) -> list[UnsymmetricLowRank]:
        return [unsymmetric_at(decomposition, self.softening, nodes)]

    def work(self, torn: TornSystem, displacement: Vector) -> float:
        return np.nan


@displayed
@dataclass(frozen=True, eq=False)
class Loading:
    """What acts on the bodies at one time.

    `torn`: the system with loads and supports; pressures that follow their surfaces act as on undeformed
    ones; `following`: pressures that follow their surfaces, each with the part of them that acts; `heat`:
    changes of temperature of this rank's subdomains by input node, None where materials feel none; () where
    there are none; `fluids`: pressures of fluids in contacts by their names, [force / length²].
    """

    torn: TornSystem
    prescribed: np.ndarray
    time: float
    following: tuple[tuple[float, FollowingPressures], ...] = ()
    turned: tuple[TurnedSurface, ...] = ()
    course: LoadStep = NO_COURSE
    drag: Drag | None = None
    heat: tuple[np.ndarray | None, ...] = ()
    fluids: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        scene: Scene,
        decomposition: Decomposition,
        time: float,
        previous: TornSystem | None,
        *,
        step: LoadStep = NO_COURSE,
        overlap: bool = False,
    ) -> Loading:
        """Return what acts at a time; unchanged parts of a previous system are reused. Collective."""
        torn = build_torn_system(scene, decomposition, overlap=overlap, previous=previous)
        prescribed = prescribed_displacements(scene, decomposition.tearing)
        following: tuple[tuple[float, FollowingPressures], ...] = ()
        if scene.following_pressures:
            following = ((1.0, FollowingPressures(scene, decomposition)),)
        turned = TurnedSurface.all_of(scene, decomposition)
        torn = _without_tracked(torn, turned)
        with together(decomposition.comm):
            heat = temperature_changes(scene, decomposition)
        fluids = pressures_of(scene.contacts)
        return cls(torn, prescribed, time, following, turned, step, heat=heat, fluids=fluids)

    def between(self, first: Loading, part: float) -> Loading:
        """Return the load at a part of the way from another one to this. Collective.

        Numbers change in proportion to the part, those of rotations are angles; functions of time have their
        values.
        """
        if part == 1.0:
            return self
        mixed = self._mixed(first, part)
        if not (callable(self.course.loads) or callable(self.course.supports)):
            return mixed
        decomposition = self.torn.decomposition
        with together(decomposition.comm):
            scene = self.course.at(self.torn.scene, mixed.time)
        now = Loading.of(scene, decomposition, mixed.time, self.torn)
        if callable(self.course.loads):
            pairs = zip(mixed.torn.subdomains, now.torn.subdomains, strict=True)
            subdomains = tuple(replace(a, load=b.load) for a, b in pairs)
            torn = replace(mixed.torn, subdomains=subdomains)
            mixed = replace(mixed, torn=torn, following=now.following, heat=now.heat)
        if callable(self.course.supports):
            torn = replace(mixed.torn, right=now.torn.right, supported=now.torn.supported)
            mixed = replace(mixed, torn=torn, prescribed=now.prescribed, turned=now.turned)
        return mixed

    def _mixed(self, first: Loading, part: float) -> Loading:
        """Return the load at a part of the way, in proportion to it."""
        parts = zip(first.torn.subdomains, self.torn.subdomains, strict=True)
        subdomains = tuple(replace(b, load=(1.0 - part) * a.load + part * b.load) for a, b in parts)

        def mixed(name: str) -> np.ndarray:
            return np.asarray((1.0 - part) * getattr(first.torn, name) + part * getattr(self.torn, name))

        drawn = (1.0 - part) * first.torn.free.load + part * self.torn.free.load
        free = replace(self.torn.free, load=drawn)
        torn = replace(
            self.torn, subdomains=subdomains, right=mixed("right"), supported=mixed("supported"), free=free
        )
        prescribed = (1.0 - part) * first.prescribed + part * self.prescribed
        weighted = [((1.0 - part) * weight, each) for weight, each in first.following]
        weighted += [(part * weight, each) for weight, each in self.following]
        time = (1.0 - part) * first.time + part * self.time
        before = {each.place: each for each in first.turned}
        turned = tuple(each.between(before, part) for each in self.turned)
        pairs = zip_longest(first.heat, self.heat)
        heat = tuple(_between(one, other, part) for one, other in pairs)
        fluids = {
            name: (1.0 - part) * first.fluids.get(name, 0.0) + part * end for name, end in self.fluids.items()
        }
        mixed_load = Loading(torn, prescribed, time, tuple(weighted), heat=heat, fluids=fluids)
        return mixed_load.with_surfaces(turned)

    def longest_part(self, first: Loading) -> float:
        """Return the part of the way from another load to this in which no rigid surface turns too far.

        Against none that rests and against no other: from one displacement to another bodies come the shorter
        way round, after a full turn none at all.
        """
        before = {each.place: each for each in first.turned}
        turns = [each.turn_from(before) for each in self.turned if each.far]
        if not turns:
            return 1.0
        ways = np.array([0.0 * turns[0], *turns])
        farthest = float(np.linalg.norm(ways[:, None] - ways, axis=2).max())
        return min(1.0, FARTHEST_TURN / max(farthest, FARTHEST_TURN))

    def with_surfaces(self, turned: tuple[TurnedSurface, ...]) -> Loading:
        """Return the load with rigid surfaces that have moved elsewhere."""
        if not turned:
            return self
        bent = self.prescribed.copy()
        for surface in turned:
            bent[surface.nodes] = surface.displacement
        torn = self.torn.moved_further(np.nan_to_num(bent - self.prescribed))
        return replace(self, torn=torn, prescribed=bent, turned=turned)

    def at_rest(self, prescribed: np.ndarray) -> Loading:
        """Return the load with supports at other values, shape (n_nodes, dim), NaN where free, [length]."""
        torn = self.torn.moved_further(np.nan_to_num(prescribed - self.prescribed))
        return replace(self, torn=torn, prescribed=prescribed)

    def with_forces(self, force: Vector) -> Loading:
        """Return the load with further forces of this rank, torn, shape (torn_size,), [force]."""
        parts = zip(self.torn.subdomains, self.torn.decomposition.parts, strict=True)
        subdomains = tuple(replace(each, load=each.load + force[part]) for each, part in parts)
        return replace(self, torn=replace(self.torn, subdomains=subdomains))

    @property
    def is_tracked(self) -> bool:
        """Whether rigid surfaces have free components."""
        return any(each.free.any() for each in self.turned)

    @property
    def is_sprung(self) -> bool:
        """Whether springs act on tools."""
        return any(each.springs.any() for each in self.turned)

    @property
    def free_tools(self) -> frozenset[str]:
        """Names of the bodies of rigid surfaces with free components."""
        return frozenset(each.surface.body for each in self.turned if each.free.any())

    def at_motions(self, motions: Motions) -> Loading:
        """Return the load where rigid surfaces have moved as given in their free components."""
        if not self.is_tracked:
            return self
        now = self.with_surfaces(tuple(each.at(motions) for each in self.turned))
        torn = _without_tracked(now.torn, ())
        return replace(now, torn=replace(torn, free=tracked_motions(now.turned, torn)))

    @property
    def motions(self) -> Motions:
        """U, then θ, of all rigid surfaces."""
        return {each.place: each.motion for each in self.turned}

    def removed(self) -> Loading:
        """Return the same supports without movement, at time zero, and no loads."""
        torn = self.torn
        equality = torn.numbering.owned < torn.n_equality
        right = np.where(equality, 0.0, torn.right + torn.supported)
        subdomains = tuple(replace(part, load=np.zeros_like(part.load)) for part in torn.subdomains)
        free = replace(torn.free, load=np.zeros_like(torn.free.load))
        torn = replace(
            torn, subdomains=subdomains, right=right, supported=np.zeros_like(torn.supported), free=free
        )
        still = tuple(each.at_rest for each in self.turned)
        return Loading(torn, 0.0 * self.prescribed, 0.0, turned=still)

    @property
    def rim(self) -> np.ndarray:
        """Marks of the nodes near the rims of surfaces that pressures follow, shape (n_nodes,)."""
        marks = np.zeros(len(self.prescribed), dtype=bool)
        for _, pressures in self.following:
            marks |= pressures.rim
        return marks

    def at(self, displacement: Vector) -> tuple[Vector, DeadLoads]:
        """Return the forces on deformed bodies of this rank, torn, (torn_size,), and their growth."""
        force, growth = self.torn.load, DeadLoads()
        for weight, pressures in self.following:
            more, matrix = pressures.at(displacement)
            force, growth = force + weight * more, growth.plus(weight * matrix)
        if self.drag is not None:
            force = force - self.drag.on(displacement)
            growth = growth.plus(sp.diags(self.drag.viscosity, format="csr"))
        return force, growth


def _between(first: np.ndarray | None, last: np.ndarray | None, part: float) -> np.ndarray | None:
    """Return changes of temperature on the way from one to the other, None for none."""
    if first is None:
        return None if last is None else part * last
    return (1.0 - part) * first + (0.0 if last is None else part * last)


def temperature_changes(scene: Scene, decomposition: Decomposition) -> tuple[np.ndarray | None, ...]:
    """Return the changes of temperature that nonlinear materials feel, of this rank's subdomains.

    Returns values by input node, shape (n,), None where there are none; () where no subdomain has any.
    """
    found: list[np.ndarray | None] = []
    for mesh in decomposition.meshes:
        body = scene.bodies[mesh.body]
        mine = (load for load in scene.loads if load.body == mesh.body)
        loads = [each for load in mine for each in load.temperatures]
        if not loads or not any(map(is_nonlinear, body.materials)):
            found.append(None)
            continue
        points = mesh.by_input_node(body.mesh.points[mesh.nodes])
        found.append(np.sum([_change(load, points) for load in loads], axis=0))
    return tuple(found) if any(each is not None for each in found) else ()


def _change(load: ThermalStrain, points: np.ndarray) -> np.ndarray:
    """Return a change of temperature at points."""
    if load.is_ufl:
        raise InvalidInputError(
            f"nonlinear materials need temperatures at nodes, the ThermalStrain on body {load.body!r} is "
            "given as Ufl: give a function of the points, or a number"
        )
    if load.is_function:
        return evaluate(f"ThermalStrain on body {load.body!r}", load.function, points, ())
    return np.full(len(points), load.numbers[0])


@displayed
@dataclass(frozen=True, eq=False)
class Drag:
    """A viscous medium, in which bodies move on where no equilibrium is near.

    `viscosity`: by how much its forces grow with the way, of this rank, torn; `origin`: displacement at which
    it exerts none, torn.
    """

    viscosity: Vector
    origin: Vector

    def on(self, displacement: Vector) -> Vector:
        """Return the forces against a displacement of this rank, torn, shape (torn_size,), [force]."""
        return self.viscosity * (displacement - self.origin)


@displayed
class FollowingPressures:
    """The pressures of a scene that follow their surfaces, on this rank's subdomains."""

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Bind the forms. Collective."""
        forms = decomposition.forms
        self._scene, self._tearing = scene, decomposition.tearing
        forms.prepare_mechanics(scene)
        self._parts, self._meshes = decomposition.parts, decomposition.meshes
        self._acting = []
        with together(decomposition.comm):
            for number, mesh in enumerate(decomposition.meshes):
                body = scene.bodies[mesh.body]
                for load in scene.following_pressures:
                    if load.body != mesh.body:
                        continue
                    facets = mesh.facets_of(body, load.surface)
                    if not len(facets[0]):
                        continue
                    acted = mesh.acted(body.mesh.surfaces[load.surface])
                    points, kind = mesh.by_input_node(body.mesh.points[mesh.nodes]), body.element
                    pressure = forms.following(load, kind, mesh.space, points, facets, acted)
                    self._acting.append((number, pressure))

    @cached_property
    def rim(self) -> np.ndarray:
        """Marks of the nodes of facets at the rims of the surfaces, shape (n_nodes,), replicated."""
        scene, tearing = self._scene, self._tearing
        marks = np.zeros(tearing.n_nodes, dtype=bool)
        for load in scene.following_pressures:
            facets = scene.bodies[load.body].mesh.surfaces[load.surface]
            marks[tearing.global_nodes(load.body, np.unique(_at_rim(facets, scene.dim)))] = True
        return marks

    def _facts(self) -> dict[str, object]:
        return {"pressures": f"{len(self._acting)} on this rank"}

    def at(self, displacement: Vector) -> tuple[Vector, sp.csr_matrix]:
        """Return what forces are more than on undeformed surfaces, and their stiffness; see `Loading.at`."""
        parts = self._parts
        force, size = np.zeros(displacement.size), displacement.size
        blocks = [sp.csr_matrix((part.stop - part.start,) * 2) for part in parts]
        for number, pressure in self._acting:
            mesh = self._meshes[number]
            more, softening = pressure.at(mesh.on_space(displacement[parts[number]]))
            force[parts[number]] += mesh.force_of(more)
            blocks[number] = blocks[number] + mesh.matrix_of(softening)
        matrix = sp.block_diag(blocks, format="csr") if blocks else sp.csr_matrix((size, size))
        return force, sp.csr_matrix(matrix)


def _without_tracked(torn: TornSystem, turned: Sequence[TurnedSurface]) -> TornSystem:
    """Return a system whose free motions are those of preloads alone."""
    count = sum(int(each.free.sum()) for each in turned) or torn.free.tracked
    if not count:
        return torn
    free = FreeMotions(torn.free.columns[:, count:], torn.free.load[count:])
    return replace(torn, free=free)


def _at_rim(facets: np.ndarray, dim: int) -> np.ndarray:
    """Return the facets with a side that no other one has."""
    corners = corners_of(facets, dim)
    if dim == 2:
        sides = corners[..., None]
    else:
        sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1), axis=-1)
        short = sides[..., 0] == sides[..., 1]  # of triangles among quadrilaterals
    _, number, count = np.unique(
        sides.reshape(-1, sides.shape[-1]), axis=0, return_inverse=True, return_counts=True
    )
    alone = count[number.reshape(corners.shape)] == 1
    if dim > 2:
        alone &= ~short
    return np.asarray(facets[alone.any(axis=1)])


@displayed
class RigidStart:
    """The bodies of a scene with large deformations, moved by their supports like rigid ones."""

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Keep where the nodes are."""
        self._points, self._decomposition = scene.points, decomposition
        self._alone = not (scene.contacts or scene.ties or scene.constraints)
        offset = decomposition.tearing.node_offset
        bodies = (scene.bodies[name] for name in decomposition.tearing.body_names)
        self._bodies = [
            slice(int(offset[number]), int(offset[number + 1]))
            for number, body in enumerate(bodies)
            if body.deforms_much and body.kinematics.can_rotate
        ]

    def moved(self, before: np.ndarray, load: Loading, displacement: Vector) -> Vector | None:
        """Return the displacement after rigid motions of bodies whose supports all move as one.

        Supports hold whole nodes of such a body, and these move from one load to the other like those of a
        rigid body, whose motion they determine. Returns that of this rank, torn; None if no body moves like
        that.
        """
        copy, block = self._decomposition.held
        node, result = self._decomposition.tearing.copy_node[copy], None
        for nodes in self._bodies:
            motion = _rigid(self._points[nodes], before[nodes], load.prescribed[nodes])
            if motion is None:
                continue
            rotation, shift = motion
            result = displacement.copy() if result is None else result
            own = (node >= nodes.start) & (node < nodes.stop)
            moved, rest = result.reshape(-1, len(shift)), self._points[node[own]]
            moved[block[own]] = (rest + moved[block[own]]) @ rotation.T + shift - rest
        return result

    def longest_part(self, first: Loading, last: Loading) -> float:
        """Return the part between two loads in which bodies follow their rigid surfaces; see `Loading`.

        Those that nothing else holds start as rigid ones, however far they turn.
        """
        lone = self._alone and all(self._turn_alone(nodes, first, last) for nodes in self._bodies)
        return 1.0 if lone else last.longest_part(first)

    def _turn_alone(self, nodes: slice, first: Loading, last: Loading) -> bool:
        """Return whether rigid surfaces that all turn alike hold a body, and nothing else does."""
        before = {each.place: each for each in first.turned}
        own = [each for each in last.turned if nodes.start <= each.nodes[0] < nodes.stop]
        turns = [each.turn_from(before) for each in own]
        held = ~np.isnan(last.prescribed[nodes]).all(axis=1)
        for each in own:
            held[each.nodes - nodes.start] = each.free.any()
        return not held.any() and all(np.allclose(turn, turns[0], rtol=0.0, atol=ROUNDING) for turn in turns)

    def _facts(self) -> dict[str, object]:
        return {"bodies": len(self._bodies)}


def _rigid(points: np.ndarray, old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return rotation and shift of a body by prescribed displacements, NaN where free; None if not rigid."""
    held = ~np.isnan(new).all(axis=1)
    if not np.isfinite(new[held]).all() or np.array_equal(old[held], new[held]):
        return None
    start, end, dim = points[held] + old[held], points[held] + new[held], points.shape[1]
    if np.linalg.matrix_rank(start - start.mean(axis=0), tol=1e-6 * np.ptp(points, axis=0).max()) < dim - 1:
        return None
    motion = similarity(start, end)
    if motion is None or abs(motion[2] - 1.0) > 1e-9:
        return None
    return motion[0], motion[1]
