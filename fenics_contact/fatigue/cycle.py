"""A closed cycle of load steps at the nodes of bodies and at contact points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import Table, displayed, tabled
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.pairs import pair_number
from fenics_contact.errors import InvalidInputError, collectively
from fenics_contact.fatigue.criteria import Criterion
from fenics_contact.fatigue.planes import CriticalPlanes, find_critical_planes
from fenics_contact.materials.elastic import is_isotropic, isotropic_constants
from fenics_contact.results.fields import most_stressed
from fenics_contact.results.state import State


@tabled
@dataclass(frozen=True, eq=False)
class CycleFatigue:
    """What a cycle does at the nodes of bodies; printed, the worst node of each.

    Attributes:
        criterion: Whose parameter it is.
        planes: Body -> the critical planes of its nodes, NaN at nodes that were left out.
        points: Body -> its nodes, shape (n_nodes, dim), [length].
    """

    criterion: Criterion
    planes: dict[str, CriticalPlanes]
    points: dict[str, np.ndarray]

    @property
    def largest(self) -> float:
        """The largest parameter of all bodies."""
        return max(float(np.nanmax(each.parameter)) for each in self.planes.values())

    def _tables(self) -> list[Table]:
        rows = [("", "largest", "node", "at", "normal of the plane", "amplitude", "normal stress")]
        for name, each in self.planes.items():
            node = int(np.nanargmax(each.parameter))
            numbers = each.parameter[node], each.amplitude[node], each.normal_stress[node]
            parameter, amplitude, stress = (f"{number:.5g}" for number in numbers)
            at, normal = (
                ", ".join(f"{x + 0.0:.5g}" for x in vector.round(6))
                for vector in (self.points[name][node], each.normal[node])
            )
            rows.append((name, parameter, str(node), at, normal, amplitude, stress))
        return [Table(rows, 1, (f"parameters of {self.criterion!r}",))]


@collectively("assess_cycle", lambda states, *_, **__: states[0].comm)
@naming_arguments
def assess_cycle(
    states: Sequence[State],
    criterion: Criterion,
    bodies: Sequence[str] = (),
    *,
    where: Callable[[np.ndarray], np.ndarray] = lambda points: np.ones(len(points), dtype=bool),
    opening: float = 0.02,
    spacing: float = 5.0,
) -> CycleFatigue:
    """Return the critical planes at the nodes of bodies, on and below surfaces. Collective.

    Stresses are those of `State.gather_nodal_stress`. Strains are those of linear, isotropic materials, by
    Hooke's law, without what heat adds. Where materials meet, that with the larger parameter counts. Bodies
    must not turn far: planes are taken as those of the undeformed body.

    Args:
        states: One closed cycle, the last state like the first. With friction the first cycle rarely closes.
        criterion: See `find_critical_planes`.
        bodies: Names of bodies; all unless given.
        where: Takes nodes, shape (n, dim), returns which are assessed; all unless given.
        opening: Largest difference of stress between the last state and the first, relative to the largest in
            the cycle.
        spacing: See `find_critical_planes`.

    Raises:
        InvalidInputError: If there are fewer than three states, of different meshes, the cycle is open, there
            is no such body or node, or strains are needed of other materials.
    """
    scene, planes = states[0].scene, {}
    names = list(bodies or scene.deforming)
    if not set(names) <= set(scene.deforming):
        raise InvalidInputError(f"bodies must be some of {list(scene.deforming)}, got {names}: list them")
    for name in names:
        mesh, stress = scene.bodies[name].mesh, closed_cycle(states, name, opening, State.gather_nodal_stress)
        chosen, found = np.asarray(where(mesh.points)), np.full((mesh.n_nodes, 6), np.nan)
        if chosen.shape != found[:, 0].shape or not chosen.any():
            raise InvalidInputError(
                f"where must return a mark for each of {mesh.n_nodes} nodes of {name!r}, true for some, got "
                f"shape {chosen.shape}, {np.count_nonzero(chosen)} true: compare coordinates"
            )
        for material, own in zip(scene.bodies[name].materials, stress.swapaxes(0, 1), strict=True):
            nodes = np.flatnonzero(chosen & np.isfinite(own[0, :, 0, 0]))
            values, mine = np.zeros((len(nodes), 6)), slice(states[0].comm.rank, None, states[0].comm.size)
            part = own[:, nodes[mine]]
            strain = hookean_strain(part, material, name) if criterion.of_strain else None
            at = find_critical_planes(criterion, part, strain, spacing=spacing)
            values[mine] = np.column_stack([at.parameter, at.normal, at.amplitude, at.normal_stress])
            values = states[0].comm.allreduce(values)
            larger = ~(found[nodes, 0] >= values[:, 0])
            found[nodes[larger]] = values[larger]
        planes[name] = CriticalPlanes(found[:, 0], found[:, 1:4], found[:, 4], found[:, 5])
    return CycleFatigue(criterion, planes, {name: scene.bodies[name].mesh.points for name in names})


def closed_cycle(
    states: Sequence[State], body: str, opening: float, of: Callable[[State, str], np.ndarray]
) -> np.ndarray:
    """Return the stresses of a body in all states of a cycle, which must end where it begins. Collective.

    `of`: takes state and body, returns stresses, shape (..., 3, 3).
    """
    if len(states) < 3:
        raise InvalidInputError(
            f"a cycle needs at least three states, got {len(states)}: it ends where it begins, such as push, "
            "pull, push"
        )
    first, *others = ({name: each.mesh for name, each in state.scene.bodies.items()} for state in states)
    for number, bodies in enumerate(others, start=1):
        alike = (np.array_equal(bodies[name].points, first[name].points) for name in first)
        if list(bodies) != list(first) or not all(alike):
            raise InvalidInputError(
                f"states of a cycle need one mesh, got another in state {number} than in the first: solve "
                "load steps of one scene by solve_steps"
            )
    stress = np.stack([of(state, body) for state in states])
    away = np.nan_to_num(np.abs(stress - stress[0])).reshape(len(stress), -1).max(axis=1)
    if away[-1] > opening * away.max():
        raise InvalidInputError(
            f"a cycle must end where it begins, got stresses of {body!r} that end "
            f"{away[-1] / away.max():.1%} of their largest change away, allowed are {opening:.1%}: add the "
            "step back to the first, leave out the first cycle, in which friction settles, or allow more"
        )
    return stress


def hookean_strain(stress: np.ndarray, material: object, body: str) -> np.ndarray:
    """Return the strains of a linear isotropic material without those of heat."""
    constants = isotropic_constants(material)
    if constants is None or not is_isotropic(material):
        raise InvalidInputError(
            f"strains of {body!r} are known of linear, isotropic materials, got {type(material).__name__}: "
            "give find_critical_planes those of State.gather_at_points, or take Findley"
        )
    young, poisson = constants
    trace = np.trace(stress, axis1=-2, axis2=-1)[..., None, None]
    return np.asarray(((1.0 + poisson) * stress - poisson * trace * np.eye(3)) / young)


@displayed
@dataclass(frozen=True, eq=False)
class RuizParameters:
    """What a cycle does at the contact points of a pair, by Ruiz.

    Attributes:
        points: Nodes of the slave, shape (n, dim), [length].
        traction: τ, the largest tangential traction of the cycle, shape (n,), [force / length²].
        slip: δ, the largest distance between two positions of a point on the master, shape (n,), [length].
        tension: σ_T, the largest stress of the slave along that way, at least 0, (n,), [force / length²].
    """

    points: np.ndarray
    traction: np.ndarray
    slip: np.ndarray
    tension: np.ndarray

    @property
    def f1(self) -> np.ndarray:
        """F1 = τ δ, the damage by fretting, shape (n,), [force / length]."""
        return self.traction * self.slip

    @property
    def f2(self) -> np.ndarray:
        """F2 = σ_T τ δ, which opens cracks, too, shape (n,), [force² / length³]."""
        return self.tension * self.f1


@collectively("ruiz_parameters", lambda states, *_, **__: states[0].comm)
@naming_arguments
def ruiz_parameters(states: Sequence[State], pair: int | str = 0, *, opening: float = 0.02) -> RuizParameters:
    """Return Ruiz' parameters at the contact points of a pair. Collective; raises as `assess_cycle` does.

    Args:
        states: One closed cycle, see `assess_cycle`.
        pair: Number or name of the pair; stresses are those of its slave.
        opening: See `assess_cycle`.
    """
    scene = states[0].scene
    number = pair_number(scene.contacts, pair)
    slave, contacts = scene.contacts[number].slave.body, [state.contact for state in states]
    stress = closed_cycle(states, slave, opening, State.gather_nodal_stress)
    mine, points = contacts[0].on_pair(number), contacts[0].points
    moved = [np.einsum("na,nad->nd", each.total_slip, points.tangents)[mine] for each in contacts]
    slip, along = np.zeros(len(mine)), points.tangents[mine, 0]
    for way in (end - start for k, start in enumerate(moved) for end in moved[k + 1 :]):
        size = np.linalg.norm(way, axis=1)
        along = np.where((size > slip)[:, None], way / np.where(size > 0.0, size, 1.0)[:, None], along)
        slip = np.maximum(size, slip)
    nodes, dim = points.slave[mine] - NodeNumbers.of(scene).first_of(slave), along.shape[1]
    at = np.stack([most_stressed(each)[nodes, :dim, :dim] for each in stress])
    tension = np.einsum("snij,ni,nj->sn", at, along, along).max(axis=0)
    traction = np.max([np.linalg.norm(each.traction[mine], axis=1) for each in contacts], axis=0)
    return RuizParameters(states[0].contact_places[mine], traction, slip, np.maximum(tension, 0.0))
