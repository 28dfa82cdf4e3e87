"""What a plan says of contact: surfaces and their errors, approach, bodies without a pair."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.display import counted, displayed
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._scene.discretisation import in_words
from fenics_contact._scene.obstacles import RigidTool
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.parts import surface_of
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._surfaces.facets import FacetedSurface, heights, quadrature_areas
from fenics_contact._surfaces.projection import project
from fenics_contact.materials.elastic import PlaneStress, isotropic_constants
from fenics_contact.materials.kernels import rigid_body_modes
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.collapsed import simplices_in
from fenics_contact.mesh.faces import corners_of, vector_areas
from fenics_contact.mesh.quality import determinants
from fenics_contact.shapes.combined import Joined, Placed
from fenics_contact.shapes.simple import SurfaceShape, evaluate_shape, tangent_bases
from fenics_contact.theory import contact_modulus, hertz_line, hertz_point

if TYPE_CHECKING:
    from fenics_contact._scene.body import Body
    from fenics_contact._scene.parts import SceneParts


#: Contact is taken as line contact if one relative curvature is below this fraction of the other.
LINE = 1e-2


def displacement_along(scene: SceneParts, normal: np.ndarray) -> float:
    """Return the largest displacement along a direction that a support prescribes as a number, [length]."""
    return max([0.0, *(support.motion_along(normal, scene) for support in scene.supports)])


def force_along(scene: SceneParts, normal: np.ndarray) -> float | None:
    """Return the largest resultant, over the bodies, of the loads along a direction, [force].

    None if a load is given as a function or in UFL, or bodies have a thickness.
    """
    total = {name: np.zeros(scene.dim) for name in scene.body_names}
    for load in scene.loads:
        resultant = load.resultant(scene.bodies[load.body])
        if resultant is None:
            return None
        total[load.body] += resultant[: scene.dim]
    for surface in scene.rigid_surfaces:
        if scene.bodies[surface.body].is_rigid:
            total[surface.body] += surface.load[: scene.dim]
    return max(abs(float(force @ normal)) for force in total.values())


def modulus_of(scene: SceneParts, pair: ContactPair) -> float | None:
    """Return the contact modulus E* of a pair, of the softest materials of its bodies; None if not isotropic.

    Rigid obstacles count as infinitely stiff.
    """
    sides = [_constants(scene.bodies[pair.slave.body]), (np.inf, 0.0)]
    for master in pair.surfaces[1:]:
        sides[1] = _constants(scene.bodies[master.body])
    if not all(sides):
        return None
    (young_1, poisson_1), (young_2, poisson_2) = sides
    return contact_modulus(young_1, poisson_1, young_2, poisson_2)


def master_share(scene: SceneParts, pair: ContactPair | AnyTie) -> float:
    """Return the master's share of the compliance 1/E* of two bodies; a half where one is not isotropic."""
    sides = [_constants(scene.bodies[surface.body]) for surface in pair.surfaces]
    if not all(sides):
        return 0.5
    moduli = [contact_modulus(young, poisson, np.inf, 0.0) for young, poisson in sides]
    return moduli[0] / sum(moduli)


def _constants(body: Body) -> tuple[float, ...]:
    """Return Young's modulus and Poisson's ratio, 0 of a free thin slice; nothing if not isotropic."""
    constants = []
    for material in body.materials:
        found = isotropic_constants(material)
        if found is None:
            return ()
        constants.append((found[0], 0.0 if isinstance(material, PlaneStress) else found[1]))
    return min(constants)


@dataclass(frozen=True)
class HertzSpot:
    """What Hertz's theory says of a contact.

    Attributes:
        half_width: Half its smallest width, [length].
        approach: How far the bodies come closer, [length]. Along a line, where that depends on the whole
            bodies, it is the depth κ a²/2 by which they would overlap undeformed.
    """

    half_width: float
    approach: float


def hertz_spot(
    force: float,
    modulus: float,
    place: np.ndarray,
    normal: np.ndarray,
    gap: np.ndarray,
    flat: float = 1e-6,
    radius: float | None = None,
) -> HertzSpot | None:
    """Return the contact of two bodies by Hertz's theory; None where it does not hold.

    The relative curvatures are those of a quadratic polynomial through the gaps around the smallest one; the
    theory holds if they are positive and the contact is smaller than the surfaces.

    `force`: force that presses the bodies together, [force], in the plane [force / length]; `modulus`: E*,
    [force / length²]; `place`: coordinates of the nodes of one surface that face the other, shape (n, dim),
    [length]; `normal`: normals of the gaps there, shape (n, dim); `gap`: gaps, shape (n,), [length]; `flat`:
    A gap counts as flat if its curvature times the size of the surface is below this; `radius`: of the
    contact on bodies of revolution, zero on the axis, [length].
    """
    curvatures, reach = _relative_curvatures(place, normal[np.argmin(gap)], gap)
    if radius == 0.0:
        curvatures, reach = np.repeat(curvatures, 2), np.repeat(reach, 2)
    elif radius is not None:
        force /= 2 * np.pi * radius
    if force <= 0.0 or len(curvatures) == 0:
        return None
    low, high, size = curvatures[0], curvatures[-1], reach.max()
    if high * size <= flat or low < -LINE * high:
        return None
    if len(curvatures) == 1 or low <= LINE * high:
        half_width = hertz_line(force / (1.0 if len(curvatures) == 1 else reach[0]), high, modulus).half_width
        spot, widest = HertzSpot(half_width, float(high * half_width**2 / 2)), half_width
    else:
        point = hertz_point(force, (low, high), modulus)
        spot, widest = HertzSpot(min(point.semi_axes), point.approach), max(point.semi_axes)
    return spot if widest < size else None


def whole_force(
    scene: SceneParts, slave: FacetedSurface, node: int, force: float
) -> tuple[float, float | None]:
    """Return the force of a contact beyond planes of symmetry, and its radius on bodies of revolution.

    `node`: of the slave, in the middle of the contact; `force`: that of the scene, [force].
    """
    planes = int(np.count_nonzero(slave.mirrored[node]))
    return scene.kinematics.whole_force(force, slave.points[node], planes)


def _relative_curvatures(
    place: np.ndarray, normal: np.ndarray, gap: np.ndarray, around: int = 30
) -> tuple[np.ndarray, np.ndarray]:
    """Fit a quadratic polynomial to the gap around its minimum.

    Returns the relative curvatures, ascending, shape (dim − 1,), [1 / length], and how far the nodes reach
    along their directions, shape (dim − 1,), [length]; nothing if there are too few nodes.

    `around`: nodes around the smallest gap to which the gap is fitted.
    """
    dim = place.shape[1]
    axes = tangent_bases(normal[None])[0]
    along = (place - place[np.argmin(gap)]) @ axes.T
    near = np.argsort((along**2).sum(axis=1))[:around]
    if len(near) < dim * (dim + 1) // 2:
        return np.zeros(0), np.zeros(0)
    size = float(np.abs(along[near]).max())
    x = along[near] / size
    one, other = np.triu_indices(dim - 1)
    terms = np.column_stack([np.ones(len(x)), x, x[:, one] * x[:, other]])
    bend = np.zeros((dim - 1, dim - 1))
    bend[one, other] = np.linalg.lstsq(terms, gap[near], rcond=1e-10)[0][dim:] / size**2
    values, directions = np.linalg.eigh(bend + bend.T)
    return values, np.ptp(along @ directions, axis=0)


#: Number of slave nodes that are examined, those nearest to the master.
MOST = 2000


@displayed
@dataclass(frozen=True)
class PairGeometry:
    """Between which surfaces the gaps of a contact pair are measured, and the error of flat facets.

    Attributes:
        slave: The slave's surface: the name of its shape (``"Torus"``), ``"reconstructed"``, ``"flat"`` where
            a surface through the nodes is that of the facets, or ``"facets"`` where these were requested.
        master: The same of the master; of a rigid obstacle the name of its class.
        height: Largest height of the true surface over the middles of its facets, [length], where the gap
            exceeds the smallest one by no more than the approach; everywhere if that is unknown. Of the
            master and, with mortar contact, also of the slave; zero on obstacles, as nodes lie on true
            surfaces, and where the pair gives all gaps.
        approach: Estimate of how far the bodies come closer, [length]: by Hertz's theory under the largest
            resultant of the loads on one body, or by the largest displacement along the normal that a support
            prescribes, if that is larger. None if neither is known.
        discretisation: Where contact is enforced, and why, see `ContactPair.reason`.
        given: What the pair gives in place of measured gaps, in words, see `ContactPair.given_gap`.
        wider: How much wider facets of the master are than those of the slave where these are nearest; 1 on
            obstacles, NaN if they do not face each other.
        by_nodes: Whether contact is by nodes.
        onto_linear: Whether quadratic facets are the slave of linear ones.
    """

    slave: str
    master: str
    height: float
    approach: float | None
    discretisation: str
    given: str = ""
    wider: float = 1.0
    by_nodes: bool = False
    onto_linear: bool = False

    @property
    def share(self) -> float | None:
        """Error of the facets relative to the approach; None if that is unknown."""
        return None if not self.approach else self.height / self.approach

    def __str__(self) -> str:
        """Describe it in one line."""
        parts = f"{self.slave} on {self.master}", self.discretisation, self.given, self.match(), self._missed
        return "; ".join(filter(None, parts))

    @property
    def _missed(self) -> str:
        if self.height == 0.0:
            return "no error by flat facets"
        share = self.share
        known = "of an unknown part" if share is None else f"{100 * share:.2g} %"
        by = "" if self.approach is None else f" (about {self.approach:.2g})"
        return f"facets miss it by up to {self.height:.2g}, {known} of the approach{by}"

    def match(self, much: float = 3.0) -> str:
        """Return in words how badly facets of both sides match, and what to do; empty if they do well enough.

        Args:
            much: Ratio of their widths that is worth a word. The pressure of a contact has no more detail
                than the wider facets of the master; nodes of the master that are much closer than those of
                the slave pass between these.
        """
        if self.onto_linear and not self.by_nodes:
            return (
                "the slave has quadratic cells and the master linear ones, which cannot follow it: on round "
                "seats the pressure is off by up to 5 %, and by half where the slave is ten times as stiff, "
                "swapped by less than 1 %: let the linear surface be the slave"
            )
        if self.wider > much:
            return (
                f"facets of the master are {self.wider:.2g} times as wide as the slave's, and the pressure "
                "is only as fine as these: refine the master, as solve_to does"
            )
        if self.by_nodes and self.wider < 1.0 / much:
            return (
                f"facets of the slave are {1.0 / self.wider:.2g} times as wide as the master's: let the "
                "finer surface be the slave"
            )
        return ""


@dataclass(frozen=True)
class _Meeting:
    """Nodes of a slave that face the master.

    Attributes:
        node: Which of the slave's, shape (n,).
        normal: Normals of the gaps, shape (n, dim).
        gap: Gaps, shape (n,), [length].
        facet: Facets of the master that they meet, shape (n,); none on an obstacle.
    """

    node: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    facet: np.ndarray


def pair_geometry(scene: SceneParts, pair: ContactPair) -> PairGeometry:
    """Return between which surfaces the gaps of a pair are measured."""
    geometry = "best" if pair.geometry == "faceted" else pair.geometry
    slave = surface_of(scene, pair.slave, "faceted" if pair.single_nodes else geometry)
    name = _name(scene, pair, pair.slave, slave)
    if not pair.between_bodies:
        met = _meeting_obstacle(slave, pair.obstacle)
        approach = _approach(scene, pair, slave, met)
        return PairGeometry(name, _shape_name(pair.obstacle), 0.0, approach, in_words(pair), pair.given_gap)
    master = surface_of(scene, pair.master_surface, geometry)
    met = _meeting(slave, master)
    approach = _approach(scene, pair, slave, met)
    near = met.gap <= met.gap.min(initial=np.inf) + (np.inf if approach is None else approach)
    height = _largest_height(master, np.unique(met.facet[near]))
    if pair.by_mortar:
        touching = np.flatnonzero(np.isin(slave.facets, met.node[near]).any(axis=1))
        height = max(height, _largest_height(slave, touching))
    if pair.gives_all_gaps:
        height = 0.0
    names = name, _name(scene, pair, pair.master_surface, master)
    wider, by_nodes = _wider(slave, master, met), not pair.by_mortar
    onto_linear = slave.order > master.order
    geometry_of = PairGeometry(*names, height, approach, in_words(pair), pair.given_gap, wider, by_nodes)
    return replace(geometry_of, onto_linear=onto_linear)


def _wider(slave: FacetedSurface, master: FacetedSurface, met: _Meeting) -> float:
    """Return `PairGeometry.wider`."""
    if len(met.node) == 0:
        return float("nan")
    nearest = np.argmin(met.gap)
    around = (slave.facets == met.node[nearest]).any(axis=1)
    own, other = slave.facets[around], master.facets[[met.facet[nearest]]]
    sizes = [
        quadrature_areas(side.points, facets).mean() * (2.0 if side.corners == 3 else 1.0)
        for side, facets in ((slave, own), (master, other))
    ]
    return float((sizes[1] / sizes[0]) ** (1.0 / (slave.dim - 1)))


def _name(scene: SceneParts, pair: ContactPair, surface: Surface, faceted: FacetedSurface) -> str:
    if pair.geometry == "faceted":
        return "facets"
    shapes = scene.bodies[surface.body].mesh.origin.shapes
    if pair.geometry == "best" and surface.name in shapes:
        return _shape_name(shapes[surface.name])
    return "flat" if faceted.relief is None else "reconstructed"


def _shape_name(shape: SurfaceShape) -> str:
    if isinstance(shape, RigidTool):
        return f"{shape.name} ({_shape_name(shape.shape)})"
    if isinstance(shape, Placed):
        return _shape_name(shape.shape)
    if isinstance(shape, Joined):
        return " and ".join(sorted({_shape_name(part) for part in shape.shapes}))
    return type(shape).__name__


def _meeting(slave: FacetedSurface, master: FacetedSurface) -> _Meeting:
    away, _ = cKDTree(master.points).query(slave.points)
    chosen = np.sort(np.argsort(away)[:MOST])
    hit = project(slave.points[chosen], slave.normals[chosen], master)
    return _Meeting(chosen[hit.point], hit.normal, hit.gap, hit.facet)


def _meeting_obstacle(slave: FacetedSurface, obstacle: SurfaceShape) -> _Meeting:
    normal = evaluate_shape(obstacle, "normals", slave.points)
    facing = np.flatnonzero(np.einsum("nd,nd->n", slave.normals, normal) < 0)
    gap = evaluate_shape(obstacle, "distance", slave.points[facing])
    return _Meeting(facing, normal[facing], gap, np.zeros(len(facing), dtype=np.int64))


def _approach(scene: SceneParts, pair: ContactPair, slave: FacetedSurface, met: _Meeting) -> float | None:
    """Return the estimate of `PairGeometry.approach`."""
    if len(met.node) == 0:
        return None
    middle = np.argmin(met.gap)
    normal, node = met.normal[middle], met.node[middle]
    sizes = [displacement_along(scene, normal)]
    force, modulus = force_along(scene, normal), modulus_of(scene, pair)
    if force is not None and modulus is not None:
        whole, radius = whole_force(scene, slave, int(node), force)
        places = slave.points[met.node]
        spot = hertz_spot(whole, modulus, places, met.normal, met.gap, radius=radius)
        sizes.append(spot.approach if spot else 0.0)
    return max(sizes) or None


def _largest_height(surface: FacetedSurface, facets: np.ndarray) -> float:
    middle = 1.0 / 3.0 if surface.corners == 3 else 0.0
    local = np.full((len(facets), surface.dim - 1), middle)
    return float(np.abs(heights(surface, facets, local).value).max(initial=0.0))


#: Part of a facet within which surfaces touch.
TOUCHING = 1e-3
#: Part of a facet by which they overlap before loads more than facets do.
OVERLAPPING = 0.05

#: The boundary of a body, in linear facets, with the cell behind each, and all its linear cells.
Outline: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Unpaired:
    """Two bodies that no pair or tie keeps apart, or whose surfaces of these are too small.

    Attributes:
        paired: Whether a pair or tie names surfaces of both.
        counts: Facets outside of these surfaces that touch the other body before loads, those that lie in it,
            and those that displacements move into it.
    """

    bodies: tuple[str, str]
    paired: bool
    counts: tuple[int, int, int]

    def is_of(self, pair: ContactPair) -> bool:
        """Return whether they are the bodies of a pair."""
        return set(pair.bodies) == set(self.bodies)

    def in_words(self, entering: str = "pass into each other") -> str:
        """Return what is wrong and what to do, or "" if nothing is."""
        touching, overlapping, entered = self.counts
        if self.paired:
            touching = 0
        count, what = next(
            (each for each in ((entered, entering), (overlapping, "overlap unloaded")) if each[0]),
            (touching, "touch"),
        )
        if not count:
            return ""
        where, remedy = (
            ("outside the surfaces of their pairs and ties", "name more of their facets in these")
            if self.paired
            else (
                "without a pair or tie between them",
                "add a ContactPair or a Tie, or take AutomaticContact()",
            )
        )
        one, other = self.bodies
        return f"bodies {one!r} and {other!r} {what} at {counted(count, 'facet')}, {where}: {remedy}"


def outline_of(mesh: BodyMesh) -> Outline:
    """Return the boundary and the inside of a body, which depend on its cells alone."""
    facets, behind = mesh.linear.boundary
    return facets, mesh.linear.cells[behind], mesh.linear.cells


def has_same_outline(one: BodyMesh, other: BodyMesh) -> bool:
    """Return whether two meshes have the same cells, as moved ones do."""
    return one.cells is other.cells and one.hanging is other.hanging


def unpaired_bodies(scene: SceneParts) -> tuple[str, ...]:
    """Return in words which bodies nothing keeps apart, unloaded or where supports move them as if rigid.

    Bodies with a pair are looked at unloaded, as it keeps them from moving as if rigid.
    """
    moved = {name: _moved_by_supports(scene, name) for name in scene.body_names}
    reach = max(float(np.linalg.norm(each, axis=1).max()) for each in moved.values())
    near = bodies_near(scene, reach)
    names = {name for both in near for name in both}
    outlines = {name: outline_of(scene.bodies[name].mesh) for name in names}
    found = (unpaired(scene, both, outlines, moved, reach) for both in near)
    entering = "pass into each other as their supports move them"
    named = (replace(each, counts=(*each.counts[:2], 0)) if each.paired else each for each in found)
    return tuple(words for each in named if (words := each.in_words(entering)))


def bodies_near(scene: SceneParts, reach: float) -> list[tuple[str, str]]:
    """Return the bodies whose bounding boxes meet, where each moves by no more than a reach, [length]."""
    boxes = {
        name: (body.mesh.points.min(axis=0) - reach, body.mesh.points.max(axis=0) + reach)
        for name, body in scene.bodies.items()
        if not body.is_rigid
    }
    slack = TOUCHING * max(float(np.max(high - low)) for low, high in boxes.values())

    def meet(one: str, other: str) -> bool:
        return bool((boxes[one][0] <= boxes[other][1] + slack).all())

    return [(a, b) for a, b in combinations(boxes, 2) if meet(a, b) and meet(b, a)]


def unpaired(
    scene: SceneParts,
    both: tuple[str, str],
    outlines: Mapping[str, Outline],
    moved: Mapping[str, np.ndarray],
    reach: float,
    share: slice = slice(None),
    least_depth: float = 1e-3,
) -> Unpaired:
    """Count the facets of two bodies that nothing keeps out of each other.

    Only facets outside of the surfaces that pairs and ties of the two name are looked for in the cells of the
    other. Those that go there behind a named surface are left out: how far that passes is the pair's matter.

    `moved`: body name -> displacement of its nodes, shape (n_nodes, dim), [length]; `reach`: the largest
    displacement of all bodies, [length]; `least_depth`: part of the largest displacement by which a facet
    counts as inside another body.
    """
    named = _named(scene, both)
    counts, deep = np.zeros(3, dtype=int), least_depth * reach
    # Nodes come last in memory, of which there are many.
    first = {name: np.asfortranarray(scene.bodies[name].mesh.points) for name in both}
    last = {name: np.asfortranarray(first[name] + moved[name]) for name in both}
    for body, into in (both, both[::-1]):
        before, wall, after, passed = first[body], first[into], last[body], last[into]
        facets, behind, _ = outlines[body]
        by_name = np.all(np.isin(facets, named[body]), axis=1)
        own, mine = (facets[by_name], behind[by_name]), np.flatnonzero(~by_name)[share]
        corners, cells = facets[mine].T, outlines[into][2]
        near, met = _near(before[corners], deep, wall, cells)
        for each in zip((near, met), _near(after[corners], deep, passed, cells), strict=True):
            np.logical_or(*each, out=each[0])
        if not near.any():
            continue
        facets, behind = facets[mine[near]], behind[mine[near]]
        inside, size = simplices_in(cells[met], scene.dim), np.ptp(before[facets], axis=1).max(axis=1)
        here, there = _Facets.of(before, facets, behind), _Facets.of(after, facets, behind)
        out = np.stack([TOUCHING * size, -OVERLAPPING * size, np.full(len(size), -deep)])
        touching, overlapping, began = here.within(out, wall, inside)
        overlapping &= ~here.follow(_Facets.of(before, *own), overlapping, wall, cells)
        entered = there.within(out[2:], passed, inside)[0] & ~began
        entered &= ~there.follow(_Facets.of(after, *own), entered, passed, cells)
        counts += [np.count_nonzero(each) for each in (touching, overlapping, entered)]
    return Unpaired(both, any(len(nodes) for nodes in named.values()), tuple(counts.tolist()))


def _near(
    facets: np.ndarray, deep: float, points: np.ndarray, cells: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return marks of the facets that may lie in cells or touch them, and of these cells; no others do.

    `facets`: their corners, shape (corners, n, dim), [length]; `deep`: how far below them their middles are
    looked for, [length]. Boxes around cells decide.
    """
    middle, size = facets.mean(axis=0), np.ptp(facets, axis=0).T.copy().max(axis=0, initial=0.0)
    slack = deep + 2.0 * OVERLAPPING * size  # more than they need, which covers rounding
    near, met = np.zeros(len(middle), dtype=bool), np.zeros(len(cells), dtype=bool)
    meet = (middle >= points.min(axis=0) - slack[:, None]) & (middle <= points.max(axis=0) + slack[:, None])
    first = np.flatnonzero(meet.all(axis=1))
    if not len(first):
        return near, met
    middle, slack = middle[first], slack[first]
    low, high = (middle - slack[:, None]).min(axis=0), (middle + slack[:, None]).max(axis=0)
    beyond = np.packbits([*(points.T < low[:, None]), *(points.T > high[:, None])], axis=0)[0]
    other = np.flatnonzero(np.bitwise_and.reduce(beyond[cells.T], axis=0) == 0)
    corners = points[cells[other]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    reach = 0.5 * np.linalg.norm(high - low, axis=1) + slack.max()
    close = cKDTree(middle).query_ball_point(0.5 * (low + high), reach)
    cell = np.repeat(np.arange(len(other)), [len(each) for each in close])
    facet = np.concatenate([*close, np.zeros(0)]).astype(np.int64)
    far = np.maximum(low[cell] - middle[facet], middle[facet] - high[cell]).max(axis=1) > slack[facet]
    near[first[facet[~far]]] = True
    met[other[cell[~far]]] = True
    return near, met


def _moved_by_supports(scene: SceneParts, name: str) -> np.ndarray:
    """Return the rigid motion of a body's nodes nearest to what its supports prescribe, (n_nodes, dim)."""
    points = scene.bodies[name].mesh.points
    modes = rigid_body_modes(points)
    prescribed, axes = scene.prescribed_along(name)
    prescribed = prescribed[:, : scene.dim]
    given = ~np.isnan(prescribed)
    along = axes.to_local(modes)
    motion = np.linalg.lstsq(along[given], prescribed[given], rcond=None)[0]
    return np.asarray(modes @ motion)


def _named(scene: SceneParts, both: tuple[str, str]) -> dict[str, np.ndarray]:
    """Return for each of two bodies its nodes of pairs, ties and constraints between them.

    Facets around nodes of constraints count as named: there one body may go into the other, as shells do by
    half their thickness where they meet.
    """
    nodes: dict[str, list[np.ndarray]] = {name: [] for name in both}
    pairs: list[ContactPair | AnyTie] = [*scene.contacts, *scene.ties]
    for pair in pairs:
        if set(pair.bodies) == set(both):
            for side in pair.surfaces:
                nodes[side.body].append(np.unique(scene.bodies[side.body].mesh.surfaces[side.name]))
    for constraint in scene.constraints:
        terms = [term for term in constraint.terms if term.body in both]
        if {term.body for term in terms} == set(both):
            for term in terms:
                mesh = scene.bodies[term.body].mesh
                own, (facets, _) = term.nodes_of(mesh), mesh.linear.boundary
                nodes[term.body] += [own, facets[np.isin(facets, own).any(axis=1)].ravel()]
    return {name: np.concatenate([*found, np.zeros(0, dtype=np.int64)]) for name, found in nodes.items()}


@dataclass(frozen=True, eq=False)
class _Facets:
    """Facets of a body.

    Attributes:
        middle: Shape (n, dim), [length].
        normal: Outwards, of unit length, shape (n, dim).
        depth: How far they are from the middles of their cells, shape (n,), [length].
    """

    middle: np.ndarray
    normal: np.ndarray
    depth: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, facets: np.ndarray, cells: np.ndarray) -> _Facets:
        """Return facets, with the cells behind them, given by their nodes."""
        area = vector_areas(points, facets)
        normal = area / np.linalg.norm(area, axis=1)[:, None]
        middle = points[corners_of(facets, points.shape[1])].mean(axis=1)
        inner = points[cells].mean(axis=1)
        return cls(middle, normal, np.einsum("nd,nd->n", middle - inner, normal))

    def within(self, out: np.ndarray, wall: np.ndarray, simplices: np.ndarray) -> np.ndarray:
        """Return which middles, moved outwards, are inside a body; inwards only as far as their cells go.

        `out`: how far, several times, shape (m, n), [length]; returns shape (m, n).
        """
        places = self.middle + np.maximum(out, -self.depth)[..., None] * self.normal
        found: np.ndarray = ((places >= wall.min(axis=0)) & (places <= wall.max(axis=0))).all(axis=2)
        if found.any():
            found[found] = _in_simplices(places[found], wall, simplices)
        return found

    def follow(self, leading: _Facets, chosen: np.ndarray, wall: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return which of the chosen facets are behind leading ones that go as deep into a body as they do.

        Their neighbours in the same surface lead themselves.
        """
        found = np.zeros(len(chosen), dtype=bool)
        at = np.flatnonzero(chosen)
        if len(at) and len(leading.middle):
            near = cKDTree(leading.middle).query(self.middle[at])[1]
            middle, normal = leading.middle[near], leading.normal[near]
            behind = np.maximum(np.einsum("nd,nd->n", middle - self.middle[at], normal), 0.0)
            found[at] = np.einsum("nd,nd->n", self.normal[at], normal) < 0.5
            simplices = simplices_in(cells, wall.shape[1])
            found[at] &= _in_simplices(middle - behind[:, None] * normal, wall, simplices)
        return found


def _in_simplices(
    places: np.ndarray, points: np.ndarray, simplices: np.ndarray, border: float = -1e-12
) -> np.ndarray:
    """Return which places are in simplices, (n,).

    `border`: barycentric coordinates down to this are inside.
    """
    low, high = places.min(axis=0), places.max(axis=0)
    for axis in np.argsort((high - low) / np.ptp(points, axis=0)):  # what leaves out most comes first
        along = points[simplices.T, axis]
        simplices = simplices[(along.min(axis=0) <= high[axis]) & (along.max(axis=0) >= low[axis])]
    inside = np.zeros(len(places), dtype=bool)
    if not len(simplices):
        return inside
    corners = points[simplices]
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    close = cKDTree(places).query_ball_point(middle, radius)
    count = np.array([len(each) for each in close])
    place = np.concatenate([*close, np.zeros(0)]).astype(np.int64)
    start, sides = corners[:, 0], np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    simplex = np.repeat(np.arange(len(corners)), count)
    slack, at = 1e-6 * radius[:, None], places[place]
    low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
    # Simplices that are flat to rounding hold nothing.
    full = np.abs(determinants(sides / radius[:, None, None])) > LAST_PLACES
    kept = full[simplex] & ((at >= low[simplex]) & (at <= high[simplex])).all(axis=1)
    place, simplex = place[kept], simplex[kept]
    rest = np.linalg.solve(sides[simplex], (places[place] - start[simplex])[..., None])[..., 0]
    inside[place[np.minimum(rest.min(axis=1), 1.0 - rest.sum(axis=1)) >= border]] = True
    return inside
