"""Points at which heat passes between surfaces: their resistances, and how curved the gap is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._base.shared import once_a_machine
from fenics_contact._pairing.points import ContactPoints, NodeNumbers
from fenics_contact._scene.fields import evaluate, not_negative
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes
from fenics_contact._scene.pairs import PairPart
from fenics_contact._scene.parts import slave_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.torn import contact_and_tied_points
from fenics_contact.heat.conductance import Touch
from fenics_contact.heat.curvature import shells, stretch
from fenics_contact.heat.rows import ConductingRows
from fenics_contact.heat.scene import HeatScene, ThermalContact


@dataclass(frozen=True, eq=False)
class _Unheld:
    """What the search for points asks of a decomposition: no temperature hides a point."""

    tearing: object
    fixed: np.ndarray
    comm: MPI.Comm
    axes: LocalAxes = NO_AXES


@dataclass(frozen=True, eq=False)
class Joints:
    """The points of all contacts and ties of a scene, replicated.

    `points`: of contacts; `tied`: of ties; `area`: that of each point, with the thickness of plane bodies,
    (n,); `opposite`: temperatures of obstacles, zero on bodies, (n,); `on_obstacle`: which are, (n,);
    `pressure`: that which contacts were given, (n,); `spread` and `ratio`: see `Touch`.
    """

    scene: HeatScene
    points: ContactPoints
    tied: ContactPoints
    area: np.ndarray
    opposite: np.ndarray
    on_obstacle: np.ndarray
    pressure: np.ndarray
    spread: np.ndarray
    ratio: np.ndarray

    @classmethod
    def of(cls, scene: HeatScene, decomposition: Decomposition, known: Sequence[Joints] = ()) -> Joints:
        """Find the points of a scene, unless those of known ones are the same. Collective."""
        comm = decomposition.comm
        same = [(each.points, each.tied) for each in known if each._serve(scene)]
        points, tied = same[0] if same else _found(scene, decomposition)
        described = once_a_machine(comm, lambda: _described(scene, points))
        return cls(scene, points, tied, *described)

    def _serve(self, scene: HeatScene) -> bool:
        """Return whether the points are those of a scene: same meshes, and pairs that face alike."""
        mine, other = self.scene.geometry, scene.geometry
        pairs = [[*each.contacts, *each.ties] for each in (mine, other)]
        alike = len(pairs[0]) == len(pairs[1]) and all(map(_face_alike, *pairs))
        return alike and mine.has_meshes_of(other)

    def touch(self, temperature: np.ndarray, pressure: np.ndarray, gap: np.ndarray) -> Touch:
        """Return what conductances depend on at temperatures of all nodes, (n_nodes,)."""
        slave, master = self.sides(temperature)
        return Touch(pressure, np.maximum(gap, 0.0), slave, master, self.spread, self.ratio)

    def sides(self, temperature: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the temperatures of slave and master at the points, (n,) each."""
        slave = np.asarray(self.points.own @ temperature)
        return slave, np.where(self.on_obstacle, self.opposite, self.points.master @ temperature)

    def conductance(self, touch: Touch) -> np.ndarray:
        """Return h at the points, (n,), [power / (length² · degree)]."""
        h = np.zeros(self.points.count)
        for number, contact in enumerate(self.scene.contacts):
            mine = np.flatnonzero(self.points.pair == number)
            values = np.asarray(contact.law.at(touch.part(mine)), dtype=np.float64)
            if values.shape != mine.shape or not ((values >= 0.0) & (values < np.inf)).all():
                raise InvalidInputError(
                    f"the conductance of {contact.place} must be finite and not negative at each of "
                    f"{len(mine)} points, got {values}: correct {type(contact.law).__name__}"
                )
            h[mine] = values
        return h

    def friction(self, touch: Touch, work: np.ndarray) -> np.ndarray:
        """Return the heat of friction that enters the slave and the master at the points, (2, n), [power].

        `work`: that of friction in mechanics, (n,), [power / length²].
        """
        heat = np.zeros((2, self.points.count))
        for number, contact in enumerate(self.scene.contacts):
            mine, law = np.flatnonzero(self.points.pair == number), contact.friction
            flux = law.at(self.places[mine], touch.part(mine), work[mine])
            heat[:, mine] = law.split(self.area[mine] * flux)
        return heat

    def at_nodes(self, heat: np.ndarray) -> np.ndarray:
        """Return heat that enters slave and master at the points, (2, n), at all nodes, (n_nodes,)."""
        return np.asarray(self.points.own.T @ heat[0] + self.points.master.T @ heat[1])

    @property
    def places(self) -> np.ndarray:
        """Where the slave nodes of the points are, (n, dim)."""
        return self.scene.geometry.points[self.points.slave]

    def rows(self, conductance: np.ndarray) -> tuple[ConductingRows, ConductingRows]:
        """Return the rows of ties, and of the points that conduct at all."""
        perfect = np.zeros(self.tied.count)
        conducts = np.flatnonzero(conductance * self.area > 0.0)
        resistance = 1.0 / (conductance * self.area)[conducts]
        passing = ConductingRows.at(self.points.part(conducts), resistance, self.opposite[conducts])
        return ConductingRows.at(self.tied, perfect, perfect), passing


def _found(scene: HeatScene, decomposition: Decomposition) -> tuple[ContactPoints, ContactPoints]:
    """Search for the points of contacts and ties. Collective."""
    fixed = np.zeros((decomposition.tearing.n_nodes, scene.geometry.dim), dtype=bool)
    search = _Unheld(decomposition.tearing, fixed, decomposition.comm)
    return contact_and_tied_points(scene.geometry, search, overlap=True)  # type: ignore[arg-type]


def _face_alike(one: PairPart, other: PairPart) -> bool:
    """Return whether points of two pairs are the same; obstacles are if they are one object."""
    return (one.between_bodies or one.master is other.master) and one == other


def _described(scene: HeatScene, points: ContactPoints) -> tuple[np.ndarray, ...]:
    """Return what a scene says of points, in the order of `Joints`."""
    count = points.count
    opposite, pressure, spread, ratio = np.zeros(count), np.zeros(count), np.ones(count), np.ones(count)
    on_obstacle, area = np.zeros(count, dtype=bool), points.area.copy()
    places, numbers = scene.geometry.points[points.slave], NodeNumbers.of(scene.geometry)
    for number, contact in enumerate(scene.contacts):
        mine = np.flatnonzero(points.pair == number)
        pair = scene.geometry.contacts[number]
        pressure[mine] = not_negative(f"the pressure of {contact.place}", contact.pressure, places[mine])
        surface = slave_of(scene.geometry, pair, pair.slave_geometry)
        place = np.searchsorted(surface.nodes, points.slave[mine] - numbers.first_of(pair.slave.body))
        area[mine] *= scene.bodies[pair.slave.body].thickness * stretch(surface)[place]
        spread[mine], ratio[mine] = shells(surface, place, points.gap[mine])
        if not pair.between_bodies:
            on_obstacle[mine], opposite[mine] = True, opposite_at(contact, places[mine])
    return area, opposite, on_obstacle, pressure, spread, ratio


def opposite_at(contact: ThermalContact, points: np.ndarray) -> np.ndarray:
    """Return the temperature of an obstacle at points of the slave, (n, dim), shape (n,)."""
    given, name = contact.temperature, f"the temperature of the obstacle of {contact.place}"
    return evaluate(name, given, points, ()) if callable(given) else np.full(len(points), given)
