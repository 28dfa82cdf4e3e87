"""Forces on nodes by what exerts them, and what follows: reactions, resultants, their balance."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fenics_contact._base.checks import GivenVector, unit_vector
from fenics_contact._base.display import Table, displayed, tabled
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._kinematics.base import Kinematics, moment_of
from fenics_contact._pairing.points import ContactPoints, NodeNumbers
from fenics_contact._scene.foundations import ElasticFoundation
from fenics_contact._scene.pairs import ContactPair, Surface, named
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._scene.supports import RigidSurface, Roller
from fenics_contact._surfaces.facets import share_areas, surface_moments
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.averages import nodal_sum
from fenics_contact.feti.row_groups import Joint
from fenics_contact.feti.subdomain import common_kernel, foundation_of
from fenics_contact.feti.torn import TornSystem


@dataclass(frozen=True, eq=False)
class NodalForces:
    """Forces on nodes; all replicated, [force].

    The multipliers act on the torn bodies as f − Bᵀλ = K u. Summed over the copies of a node, gluing cancels,
    and −Bᵀλ is the reaction, where a component is prescribed, less what contacts and ties exert there (their
    rows of B leave prescribed components out). `places`: where the nodes of all bodies are for moments:
    undeformed, on bodies that deform much deformed; `load`: f; thermal strain included, which has no
    resultant; `reaction`: of supports, zero on free components; `contact`: on the slave at each contact
    point; `joints`: of each joint, see `Joint.forces`; `bed`: what materials exert that resist rigid motions
    (elastic beds); `foundations`: what each elastic foundation of the scene exerts; `moved`: displacement of
    the points of rigid surfaces by body and surface; their loads act there; at undeformed ones where they are
    not among them; `springs`: what springs of tools exert that are not among the beds, by body and surface.
    """

    places: np.ndarray
    load: np.ndarray
    reaction: np.ndarray
    contact: np.ndarray
    joints: Mapping[Joint, np.ndarray]
    bed: np.ndarray
    foundations: tuple[np.ndarray, ...] = ()
    moved: Mapping[tuple[str, str], np.ndarray] = field(default_factory=dict)
    springs: Mapping[tuple[str, str], Resultant] = field(default_factory=dict)

    def point_load(self, support: RigidSurface, about: np.ndarray, kinematics: Kinematics) -> Resultant:
        """Return the load at the point of a rigid surface, about another point."""
        force, moment = np.split(support.load, [support.dim])
        point = np.array(support.at) + self.moved.get((support.body, support.surface), 0.0)
        return Resultant(force, kinematics.moment_at(force, moment, point, about), about)

    def exerted(self, support: RigidSurface, about: np.ndarray) -> list[Resultant]:
        """Return what the springs of a tool exert, about another point; nothing without any."""
        own, springs = (support.body, support.surface), self.springs.items()
        return [Resultant(each.force, each.moment_about(about), about) for key, each in springs if key == own]


def nodal_forces(torn: TornSystem, multiplier: np.ndarray, displacement: np.ndarray) -> NodalForces:
    """Return the forces on all nodes. Collective.

    `displacement`: torn displacement of this rank as the solver returned it.
    """
    decomposition = torn.decomposition
    fixed, axes, contact = decomposition.fixed, decomposition.axes, _contact_forces(torn, multiplier)
    joints = {each: each.forces(torn.gathered(multiplier, each), fixed) for each in torn.groups.joints}
    joined = torn.points.on_nodes(contact)
    for joint, forces in joints.items():
        joined += joint.on_nodes(forces)
    acting = -nodal_sum(decomposition, torn.force(multiplier)) - joined
    reaction = axes.to_global(np.where(fixed, axes.to_local(acting), 0.0))
    return NodalForces(
        torn.scene.points,
        nodal_sum(decomposition, torn.load),
        reaction,
        contact,
        joints,
        nodal_sum(decomposition, -_resisted(torn, displacement)),
        tuple(
            nodal_sum(decomposition, -_sprung(torn, displacement, each)) for each in torn.scene.foundations
        ),
    )


def _contact_forces(torn: TornSystem, multiplier: np.ndarray) -> np.ndarray:
    """Return the forces on the slave nodes of contacts, shape (n_contact, dim), [force]. Collective.

    They balance the others, also where a solver that ends at its tolerance leaves a pull.
    """
    points, frictional = torn.points, torn.frictional
    rows = np.concatenate([torn.normal_rows, torn.tangential_rows.ravel()])
    normal, friction = np.split(torn.numbering.gather(multiplier, rows), [points.count])
    force = normal[:, None] * points.normal
    tangential = friction.reshape(-1, torn.components - 1)
    force[frictional] -= np.einsum("na,nad->nd", tangential, points.tangents[frictional])
    return force


def by_node(points: ContactPoints, force: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the forces of chosen points on the nodes of slaves and masters, shape (n_nodes, dim)."""
    return points.part(chosen).on_nodes(force[chosen])


def _resisted(torn: TornSystem, displacement: np.ndarray) -> np.ndarray:
    """Return K u of the subdomains whose material resists a rigid motion, zero on others, (torn_size,)."""
    found = []
    for part, where in zip(torn.subdomains, torn.decomposition.parts, strict=True):
        body = torn.scene.bodies[part.mesh.body]
        kernel, force = part.kernel.shape[1], np.zeros(part.mesh.size)
        if part.foundations:
            kernel = common_kernel(part.material.materials, part.points, body.kinematics).shape[-1]
        if kernel < body.motions:
            u = displacement[where]
            force = part.stiffness @ u - foundation_of(part.mesh, body, part.foundations) @ u
        found.append(force)
    return np.concatenate([np.zeros(0), *found])


def _sprung(torn: TornSystem, displacement: np.ndarray, foundation: ElasticFoundation) -> np.ndarray:
    """Return k u of a foundation on this rank's torn dofs, shape (torn_size,), [force]."""
    springs = (foundation_of(p.mesh, torn.scene.bodies[p.mesh.body], [foundation]) for p in torn.subdomains)
    pairs = zip(springs, torn.decomposition.parts, strict=True)
    return np.concatenate([np.zeros(0), *(spring @ displacement[where] for spring, where in pairs)])


@displayed
@dataclass(frozen=True, eq=False)
class Resultant:
    """The resultant of forces that act on a body, in the undeformed geometry.

    Attributes:
        force: Sum of the forces, shape (dim,), [force].
        moment: Sum of their moments about ``about``, shape (3,) in space; one number in the plane, positive
            from x to y; [force·length]. Plane bodies have forces and moments a unit of thickness. Bodies of
            revolution have those of a full revolution: the sum of the radial forces, the axial force, and no
            moment, shape (0,); with torsion the torque about the axis, shape (1,).
        about: The point, shape (dim,), [length].
        surface: The surface on which they act; None for a sum over surfaces.
    """

    force: np.ndarray
    moment: np.ndarray | float
    about: np.ndarray
    surface: Surface | None = None

    def moment_about(self, point: GivenVector | np.ndarray) -> np.ndarray | float:
        """Return the moment about another point, shape (3,) or a number, [force·length].

        Args:
            point: The point, shape (dim,), [length].

        Raises:
            InvalidInputError: If it is no point of the bodies' space.
        """
        if self.axisymmetric:
            return self.moment
        return self.moment + moment_of(self.force, self.about - point_of(point, len(self.force)))

    @property
    def axisymmetric(self) -> bool:
        """Whether it is that of forces all around bodies of revolution."""
        return np.ndim(self.moment) == 1 and np.size(self.moment) < 3

    @property
    def heads(self) -> tuple[str, ...]:
        """Names of the components of force and moment in tables."""
        if self.axisymmetric:
            return ("Fr", "Fz", "T")[: 2 + np.size(self.moment)]
        return ("Fx", "Fy", "Fz", "Mx", "My", "Mz") if len(self.force) == 3 else ("Fx", "Fy", "M")

    def __add__(self, other: Resultant) -> Resultant:
        """Return the sum with another one about the same point."""
        return Resultant(self.force + other.force, self.moment + other.moment, self.about, self.surface)

    def __sub__(self, other: Resultant) -> Resultant:
        """Return the difference to another one about the same point."""
        return Resultant(self.force - other.force, self.moment - other.moment, self.about, self.surface)

    def torque(self, point: GivenVector | np.ndarray, direction: GivenVector) -> float:
        """Return the moment about an axis in space, [force·length].

        Of bodies of revolution with torsion ``moment`` holds the torque about their axis.

        Args:
            point: A point on the axis, shape (3,), [length].
            direction: Direction of the axis, of any length, shape (3,); turning as a right-handed screw is
                positive.

        Raises:
            InvalidInputError: If the bodies are plane, or point or direction are not three numbers.
        """
        if len(self.force) == 2:
            raise InvalidInputError(
                "an axis needs bodies in space: use moment_about(point) for plane bodies, and moment for "
                "bodies of revolution with torsion"
            )
        return float(np.dot(self.moment_about(point), unit_vector("the direction of an axis", direction, 3)))

    def __str__(self) -> str:
        """Return it in words."""
        if self.axisymmetric:
            torque = "".join(f", torque {value:.5g} [force·length]" for value in np.atleast_1d(self.moment))
            return f"radial and axial force {_in_brackets(self.force)} [force]{torque} per revolution"
        moment = _in_brackets(_row(self.moment))
        return (
            f"force {_in_brackets(self.force)} [force], moment {moment} [force·length] about "
            f"{_in_brackets(self.about)}"
        )


@tabled
@dataclass(frozen=True, eq=False)
class Resultants:
    """Resultants in the order of a list of the scene.

    Attributes:
        kind: What they are, such as "reaction".
        entries: One for each entry of that list.
        places: Where each acts: "lid top", of a contact pair "lid bottom on pot rim".

    Example:
        >>> state.reactions()["lid top"].force  # of all supports of this surface  # doctest: +SKIP
        >>> state.resultants().contacts["lid bottom on pot rim"].force  # doctest: +SKIP
    """

    kind: str
    entries: tuple[Resultant, ...]
    places: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of entries."""
        return len(self.entries)

    def __getitem__(self, which: int | str) -> Resultant:
        """Return an entry by its number, or the sum of the entries of a name, about the point of the first.

        Args:
            which: Number in the list, or body and surface as in "lid top"; of pairs also both surfaces, as
                in "lid bottom on pot rim".

        Raises:
            InvalidInputError: If no entry has this name; lists those that exist.
        """
        if not isinstance(which, str):
            return self.entries[which]
        first, *others = (self.entries[number] for number in named(which, self._surfaces, self.places))
        for other in others:
            first += Resultant(other.force, other.moment_about(first.about), first.about)
        return first

    @property
    def _surfaces(self) -> list[str]:
        return [each.surface.in_words if each.surface else "" for each in self.entries]

    def __iter__(self) -> Iterator[Resultant]:
        """Return the entries in their order."""
        return iter(self.entries)

    def _tables(self) -> list[Table]:
        """Return a table with one line for each entry."""
        return table_of([(f"{self.kind} {i}", name) for i, name in enumerate(self._surfaces)], self.entries)


def table_of(
    names: list[tuple[str, ...]],
    resultants: tuple[Resultant, ...],
    scales: tuple[float, float] | None = None,
    *notes: str,
) -> list[Table]:
    """Return forces and moments of several resultants, one per line behind its names, with their units.

    `scales`: reference force and moment; what is rounding of these is shown as zero; by default the largest
    components.
    """
    if not resultants:
        return []
    columns = [
        np.stack([each.force for each in resultants]),
        np.stack([_row(each.moment) for each in resultants]),
    ]
    sizes = scales or tuple(float(np.abs(part).max(initial=0.0)) for part in columns)
    shown = [
        np.where(np.abs(part) > ROUNDING * size, part, 0.0) for part, size in zip(columns, sizes, strict=True)
    ]
    cells = [
        (*name, *(f"{value:.5g}" for value in row)) for name, row in zip(names, np.hstack(shown), strict=True)
    ]
    revolved, head = resultants[0].axisymmetric, (*[""] * len(names[0]), *resultants[0].heads)
    units = "F in [force], M in [force·length]"
    if revolved:
        torque = ", T in [force·length]" * np.size(resultants[0].moment)
        units = f"F in [force]{torque} per revolution"
    return [Table([head, *cells], len(names[0]), (units, *notes))]


def resultant(
    forces: np.ndarray,
    places: np.ndarray,
    about: np.ndarray,
    kinematics: Kinematics,
    surface: Surface | None = None,
) -> Resultant:
    """Return force and moment of forces that act at places, both of shape (n, dim), about a point, (dim,)."""
    return Resultant(*kinematics.resultant(forces, places, about), about, surface)


def moments_about(about: GivenVector | np.ndarray | None, dim: int) -> Callable[..., np.ndarray]:
    """Return what chooses the point of moments: the one given, or the one that a function finds.

    It takes the function and its arguments.
    """
    if about is None:
        return lambda own, *of: own(*of)
    return lambda own, *of: point_of(about, dim)


def point_of(given: GivenVector | np.ndarray, dim: int) -> np.ndarray:
    """Return a point as an array, shape (dim,)."""
    point = np.asarray(given, dtype=np.float64)
    if point.shape != (dim,) or not np.isfinite(point).all():
        raise InvalidInputError(
            f"the point that moments refer to needs {dim} finite coordinates, got {given!r}: give a point in "
            "the bodies' unit of length, or none for the default"
        )
    return point


def _row(moment: np.ndarray | float) -> np.ndarray:
    return np.atleast_1d(np.asarray(moment, dtype=np.float64))


def _in_brackets(values: np.ndarray) -> str:
    return f"({', '.join(f'{value:.5g}' for value in values)})"


def support_reactions(
    torn: TornSystem, forces: NodalForces, about: GivenVector | np.ndarray | None
) -> Resultants:
    """Return the reaction of every support, about a point or the centroid of its surface.

    That of a rigid surface is less the load at its point, to which it refers by default, and springs.
    """
    scene = torn.scene
    shares, place = support_shares(scene, NodeNumbers.of(scene)), moments_about(about, scene.dim)
    entries = []
    for support, share in zip(scene.supports, shares, strict=True):
        surface = Surface(support.body, support.surface)
        point = place(support.reference, scene)
        total = resultant(share.of(forces.reaction), forces.places, point, scene.kinematics, surface)
        for rigid in support.rigid_surfaces:
            for spring in forces.exerted(rigid, point):
                total = total - spring
            total = total - forces.point_load(rigid, point, scene.kinematics)
            if support.body in _uncarried(torn):
                total = on_tool(torn, forces, support.body, point)
                total = Resultant(-total.force, -total.moment, point, surface)
        entries.append(total)
    places = tuple(Surface(each.body, each.surface).in_words for each in scene.supports)
    return Resultants("reaction", tuple(entries), places)


def _uncarried(torn: TornSystem) -> set[str]:
    """Return the tools that bodies meet like obstacles: their rows act on the slave alone."""
    met = np.unique(torn.points.pair[np.diff(torn.points.master.indptr) == 0])
    return {torn.scene.contacts[pair].tool for pair in met} - {""}


def on_tool(torn: TornSystem, forces: NodalForces, tool: str, about: np.ndarray) -> Resultant:
    """Return the resultant of the contact on a rigid tool, about a point."""
    pairs = [k for k, pair in enumerate(torn.scene.contacts) if pair.tool == tool]
    mine = np.flatnonzero(np.isin(torn.points.pair, pairs))
    places, kinematics = torn.points.own[mine] @ forces.places, torn.scene.kinematics
    master = torn.points.master[mine]
    carried = np.diff(master.indptr) > 0  # where the tool is, also where surfaces that give way keep apart
    places = np.where(carried[:, None], master @ forces.places, places)
    return resultant(-forces.contact[mine] * kinematics.balanced, places, about, kinematics)


def foundation_forces(
    scene: Scene, forces: NodalForces, about: GivenVector | np.ndarray | None
) -> Resultants:
    """Return the force of every elastic foundation on its body, about a point or its centroid."""
    entries, place = [], moments_about(about, scene.dim)
    for foundation, force in zip(scene.foundations, forces.foundations, strict=True):
        surface = Surface(foundation.body, foundation.surface)
        point = place(centroid, scene, surface)
        entries.append(resultant(force, forces.places, point, scene.kinematics, surface))
    return Resultants("foundation", tuple(entries), tuple(each.place for each in scene.foundations))


@dataclass(frozen=True, eq=False)
class SupportShare:
    """The part of a support in the reactions of nodes.

    `components`: its part in every component, zero where it holds nothing; `nodes`: nodes at which rollers
    hold; `matrices`: its parts in the reactions there, which take the place of these.
    """

    components: np.ndarray
    nodes: np.ndarray
    matrices: np.ndarray

    def of(self, reaction: np.ndarray) -> np.ndarray:
        """Return the part of reactions, both of shape (n_nodes, dim), [force]."""
        part = self.components * reaction
        part[self.nodes] = np.einsum("nde,ne->nd", self.matrices, reaction[self.nodes])
        return part


def support_shares(scene: Scene, numbers: NodeNumbers) -> list[SupportShare]:
    """Return the part of each support in the reactions on nodes.

    A component that several supports prescribe at a node is shared by the areas that belong to the node on
    their surfaces: the forces of an even pressure on both. Where rollers hold, too, each support exerts
    forces along the directions that it holds, with the smallest sum of squares over areas. The parts sum to
    one.
    """
    areas, count = [], numbers.n_nodes
    held = ((number, roller) for number, each in enumerate(scene.supports) for roller in each.rollers)
    rolled = {number: _rolled(scene, roller, numbers) for number, roller in held}
    nodes = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(n for n, _ in rolled.values())]))
    squares = np.zeros((len(scene.supports), len(nodes), scene.components, scene.components))
    for number, support in enumerate(scene.supports):
        mesh = scene.bodies[support.body].mesh
        own = np.zeros(count)
        every = numbers.global_nodes(support.body, np.arange(mesh.n_nodes))
        own[every] = share_areas(mesh, support.surface)
        areas.append(own[:, None] * support.holds(scene.components))
        squares[number] = areas[-1][nodes][:, :, None] * np.eye(scene.components)
        if number in rolled:
            held_at, along = rolled[number]
            np.add.at(squares[number], np.searchsorted(nodes, held_at), along[:, :, None] * along[:, None, :])
            squares[number] *= own[nodes, None, None]
    total = sum(areas, np.zeros((count, scene.components)))
    parts = [area / np.where(total > 0.0, total, 1.0) for area in areas]
    inverse = np.linalg.pinv(squares.sum(axis=0), rcond=1e-10, hermitian=True)
    return [SupportShare(part, nodes, own @ inverse) for part, own in zip(parts, squares, strict=True)]


def _rolled(scene: Scene, roller: Roller, numbers: NodeNumbers) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes that a roller holds, numbered among all, and its directions there."""
    held = scene.directions_of(roller)
    return numbers.global_nodes(roller.body, held.nodes), held.directions


def centroid(scene: Scene, surface: Surface) -> np.ndarray:
    """Return the centroid of a surface, of a node set the mean of its points, shape (dim,)."""
    mesh = scene.bodies[surface.body].mesh
    if surface.name in mesh.node_sets:
        return np.asarray(mesh.points[mesh.node_sets[surface.name]].mean(axis=0))
    return surface_moments(mesh.points, mesh.surfaces[surface.name], scene.kinematics.measure).centroid


@tabled
@dataclass(frozen=True, eq=False)
class Balance:
    """Forces and moments on all bodies together, about one point, and what is missing to equilibrium.

    Moments on bodies of small strain are those of the undeformed geometry, as in their linear theory, on
    bodies that deform much those of the deformed one. The imbalance is
    governed by the equilibrium of the multipliers with the load (``State.solution.coarse_residual``), which
    every step of a solver keeps to rounding; for one body without multipliers by the rounding of its
    factorisation, which is larger in slender bodies. It says that no force was forgotten, not how accurate
    the forces are. That is governed by the tolerance of the solver, and by the mesh.

    Attributes:
        loads: Of the loads.
        reactions: Of all supports.
        obstacles: Of rigid obstacles that are no tools.
        gaps: Of contacts and ties between bodies, and of tools: both sides together have no force, but a
            moment where friction, a tie or a mean over facets transmits forces across a gap, or where one
            body has moments about undeformed places and the other about deformed ones. Linear constraints
            are among them, which have a force, too, unless the factors of every equation cancel.
        beds: Of elastic foundations, springs, also those of tools, and materials that resist rigid motions.
        force_scale: Largest sum of the sizes of the nodal forces of one of these, [force]; where nothing acts
            a force below which bodies count as free of forces.
        moment_scale: Largest sum of the sizes of nodal forces times their distances from the point,
            [force·length]; never zero by symmetry, as are the moments of forces that point at the point.
    """

    loads: Resultant
    reactions: Resultant
    obstacles: Resultant
    gaps: Resultant
    beds: Resultant
    force_scale: float
    moment_scale: float

    @property
    def parts(self) -> dict[str, Resultant]:
        """All parts by name."""
        return {name: getattr(self, name) for name in ("loads", "reactions", "obstacles", "gaps", "beds")}

    @property
    def total(self) -> Resultant:
        """The sum of all parts, zero in equilibrium."""
        forces, moments = zip(*((part.force, part.moment) for part in self.parts.values()), strict=True)
        return Resultant(np.sum(forces, axis=0), np.sum(moments, axis=0), self.loads.about)

    @property
    def imbalance(self) -> float:
        """The larger of the total force and moment, each relative to its scale, dimensionless."""
        return self._relative(self.total)

    def _relative(self, part: Resultant) -> float:
        force, moment = np.linalg.norm(part.force), np.linalg.norm(np.atleast_1d(part.moment))
        return float(max(force / (self.force_scale or 1.0), moment / (self.moment_scale or 1.0)))

    def _tables(self) -> list[Table]:
        """Return a table of all parts that are not zero, their total and the imbalance."""
        shown = {name: part for name, part in self.parts.items() if self._relative(part) > ROUNDING}
        shown["total"] = self.total
        scales = self.force_scale, self.moment_scale
        notes = f"imbalance {self.imbalance:.1e}"
        return table_of([(name,) for name in shown], tuple(shown.values()), scales, notes)


def force_balance(
    torn: TornSystem, forces: NodalForces, about: GivenVector | np.ndarray | None, least: float
) -> Balance:
    """Return the balance of all forces, about a point or the middle of the box around all bodies.

    Radial forces all around an axis balance each other. `least`: a force below which bodies count as free of
    forces.
    """

    def middle() -> np.ndarray:
        carriers = [body.is_rigid for body in torn.scene.bodies.values()]
        of_tool = np.repeat(carriers, np.diff(torn.decomposition.tearing.node_offset))
        return _middle(forces.places[~of_tool])

    point = moments_about(about, torn.scene.dim)(middle)
    parts, kinematics = _parts(torn, forces), torn.scene.kinematics
    resultants = {
        name: resultant(force * kinematics.balanced, forces.places, point, kinematics)
        for name, force in parts.items()
    }
    for rigid in torn.scene.rigid_surfaces:  # the load at its point comes in through its nodes
        load = forces.point_load(rigid, point, kinematics)
        resultants["loads"] += load
        resultants["reactions"] -= load
        for spring in forces.exerted(rigid, point):
            resultants["beds"] += spring
            resultants["reactions"] -= spring
    arms = kinematics.arms(forces.places, point)
    sizes = [np.linalg.norm(force, axis=1) for force in parts.values()]
    reach = np.linalg.norm(arms, axis=1)
    return Balance(
        **resultants,
        force_scale=float(max(least, *(size.sum() for size in sizes))),
        moment_scale=float(max(least * reach.max(), *(size @ reach for size in sizes))),
    )


def _parts(torn: TornSystem, forces: NodalForces) -> dict[str, np.ndarray]:
    """Return the nodal forces of each part, shape (n_nodes, dim)."""
    tools = np.array([bool(pair.tool) for pair in torn.scene.contacts], dtype=bool)[torn.points.pair]
    meets_body = np.diff(torn.points.master.indptr) > 0
    driven = np.flatnonzero(tools & ~meets_body)  # supports of such a tool hold what presses on it
    parts = {
        "loads": forces.load,
        "reactions": forces.reaction + by_node(torn.points, forces.contact, driven),
        "obstacles": by_node(torn.points, forces.contact, np.flatnonzero(~meets_body & ~tools)),
        "gaps": by_node(torn.points, forces.contact, np.flatnonzero(meets_body)),
        "beds": sum(forces.foundations, forces.bed),
    }
    for joint, of_joint in forces.joints.items():
        parts[joint.balanced_as] = parts[joint.balanced_as] + joint.on_nodes(of_joint)
    return parts


def _middle(places: np.ndarray) -> np.ndarray:
    """Return the middle of the box around all bodies, shape (dim,)."""
    return np.asarray(0.5 * (places.min(axis=0) + places.max(axis=0)))


@tabled
@dataclass(frozen=True, eq=False)
class PairResultants:
    """Forces and moments on the slaves of all pairs.

    Attributes:
        contacts: One for each contact pair of the scene, in its order.
        friction: The part of friction in each of these.
        ties: One for each tie of the scene, in its order.
    """

    contacts: Resultants
    friction: Resultants
    ties: Resultants

    def _tables(self) -> list[Table]:
        """Return both tables, without that of an empty list."""
        return self.contacts._tables() + self.ties._tables()


def pair_resultants(
    torn: TornSystem, forces: NodalForces, about: GivenVector | np.ndarray | None
) -> PairResultants:
    """Return force and moment on the slave of every pair, about a point or the centroid of its surface."""
    scene, place = torn.scene, moments_about(about, torn.scene.dim)

    def of(
        kind: str, pairs: Sequence[ContactPair | AnyTie], points: ContactPoints, force: np.ndarray
    ) -> Resultants:
        found = []
        for number, pair in enumerate(pairs):
            mine = np.flatnonzero(points.pair == number)
            point = place(centroid, scene, pair.slave)
            places = points.own[mine] @ forces.places
            found.append(resultant(force[mine], places, point, scene.kinematics, pair.slave))
        return Resultants(kind, tuple(found), tuple(pair.place for pair in pairs))

    tied = np.concatenate([forces.joints[each] for each in torn.tie_rows])
    normal = torn.points.normal
    tangential = forces.contact - np.einsum("nd,nd->n", forces.contact, normal)[:, None] * normal
    rubs = np.array([pair.has_friction for pair in scene.contacts], dtype=bool)[torn.points.pair]
    return PairResultants(
        of("contact", scene.contacts, torn.points, forces.contact),
        of("friction", scene.contacts, torn.points, np.where(rubs[:, None], tangential, 0.0)),
        of("tie", scene.ties, torn.ties, tied),
    )
