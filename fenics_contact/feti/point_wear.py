"""Wear at contact points: what they have lost, and how the next step's loss follows pressure and slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.points import ContactPoints
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.wear import Wear, WearCurve
from fenics_contact.errors import together
from fenics_contact.feti.ties import matched, same_points
from fenics_contact.feti.torn import TornSystem, Unworn
from fenics_contact.qp.compliance import Closures


@dataclass(frozen=True, eq=False)
class AtNodes:
    """Values by pair and slave node, shape (n, k)."""

    pair: np.ndarray
    slave: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, points: ContactPoints, values: np.ndarray) -> AtNodes:
        """Return the values at contact points."""
        return cls(points.pair, points.slave, values)

    @classmethod
    def keyed(cls, key: np.ndarray, values: np.ndarray) -> AtNodes:
        """Return the values at pairs and slave nodes, (2, n), see `key`."""
        return cls(key[0], key[1], values)

    @classmethod
    def none(cls) -> AtNodes:
        """Return no values."""
        nowhere = np.zeros(0, dtype=np.int64)
        return cls(nowhere, nowhere, np.zeros((0, 1)))

    @property
    def key(self) -> np.ndarray:
        """Pairs and slave nodes, shape (2, n)."""
        return np.stack([self.pair, self.slave])

    def on(self, points: ContactPoints) -> np.ndarray:
        """Return the values at other points, zero where there is none, shape (n_points, k)."""
        return matched(self.values, same_points(self, points))

    def updated(self, points: ContactPoints, values: np.ndarray) -> AtNodes:
        """Return these with other values at some points, (n_points, k)."""
        old = same_points(points, self) < 0
        return AtNodes(
            np.concatenate([self.pair[old], points.pair]),
            np.concatenate([self.slave[old], points.slave]),
            np.concatenate([self.values[old], values]),
        )


@dataclass(frozen=True, eq=False)
class PointWear(Unworn):
    """Wear of the points of pairs, replicated.

    `laws`: with the places of their pairs in words and the numbers of their points; `factor`: by which
    distance and curve are multiplied, (n_contact,); `places`: of slave nodes, (n_contact, dim); `lost`:
    what all nodes had lost that there ever were points at, where bodies move far.
    """

    laws: Sequence[tuple[str, Wear, np.ndarray]]
    factor: np.ndarray
    places: np.ndarray
    before: np.ndarray
    lost: AtNodes = field(default_factory=lambda: AtNodes.none())

    @classmethod
    def of(cls, scene: Scene, points: ContactPoints, before: np.ndarray, comm: MPI.Comm) -> PointWear:
        """Return that of the contact points of a scene. Collective."""
        laws = [
            (pair.place, wear, np.flatnonzero(points.pair == number))
            for number, pair in enumerate(scene.contacts)
            for wear in pair.wears
        ]
        factor, places = np.zeros(points.count), scene.points[points.slave]
        with together(comm):
            for place, wear, mine in laws:
                factor[mine] = wear.factor_at(place, places[mine])
        if comm.size > 1 and any(wear.functions for _, wear, _ in laws):
            require_alike(comm, described(factor, "wear given as functions of position"))
        return cls(laws, factor, places, before)

    @property
    def by_slip(self) -> bool:
        """Whether some points slide as load steps say."""
        return any(wear.by_slip for _, wear, _ in self.laws)

    def distance(self, slip: np.ndarray) -> np.ndarray:
        """Return how far points slide, times the factor, (n_contact,); `slip`: (n_contact, dim − 1)."""
        way, result = np.linalg.norm(slip, axis=1), np.zeros(len(self.factor))
        for place, wear, mine in self.laws:
            result[mine] = self.factor[mine] * wear.distance_at(place, self.places[mine], way[mine])
        return result

    def depth(self, pressure: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Return the depth that the load step takes, see `Unworn.depth`."""
        return self.depth_over(self.distance(slip), pressure)

    def depth_over(self, distance: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Return the depth that distances take that include the factor, shape (n_contact,), [length]."""
        return distance * self.of_curves("rate", pressure)

    def of_curves(self, member: str, pressure: np.ndarray) -> np.ndarray:
        """Return rates or growths of the curves, zero without pressure, (n_contact,)."""
        result = np.zeros(len(self.factor))
        for _, wear, mine in self.laws:
            pressed = mine[pressure[mine] > 0.0]
            result[pressed] = getattr(wear.curve, member)(pressure[pressed])
        return result

    def by_way(self, way: np.ndarray) -> np.ndarray:
        """Return the derivative of `distance` by the lengths of slips, (n_contact,)."""
        result = np.zeros(len(self.factor))
        for _, wear, mine in self.laws:
            result[mine] = self.factor[mine] * (wear.by_slip & wear.grows_at(way[mine]))
        return result

    def by_place(self, way: np.ndarray) -> np.ndarray:
        """Return the derivative of `distance` by the places of slave nodes, (n_contact, dim)."""
        result = np.zeros(self.places.shape)
        for place, wear, mine in self.laws:
            result[mine] = wear.by_place(place, self.places[mine], way[mine])
        return result

    def on(self, torn: TornSystem, distance: np.ndarray) -> TornSystem:
        """Return a system that has lost what it had before, and loses more over distances."""
        return torn.worn(self, self.closures(torn, distance))

    def closures(self, torn: TornSystem, distance: np.ndarray) -> Closures:
        """Return how far contacts give way: by their closures, and by what wears off over distances."""
        area = torn.points.area
        number = np.full(len(area), -1)
        for law, (_, _, mine) in enumerate(self.laws):
            number[mine] = law
        given = torn.groups.normal.closures or Closures.exact(area)
        return WornClosures(
            area, given.curve, given.scale, given.curves, distance, number,
            [wear.curve for _, wear, _ in self.laws],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class WornClosures(Closures):
    """Closures of contacts that also lose material: C(λ) = s (c(λ / A) + D r(λ / A)).

    `distance`: D; `law`: number of the rate r, −1 where nothing wears.
    """

    distance: np.ndarray
    law: np.ndarray
    rates: Sequence[WearCurve]

    def part(self, chosen: np.ndarray) -> WornClosures:
        """Return those of some contacts."""
        values = {name: getattr(self, name)[chosen] for name in ("area", "curve", "scale", "distance", "law")}
        return replace(self, **values)

    @property
    def soft(self) -> np.ndarray:
        """Marks of the contacts that give way, shape (n,)."""
        return np.asarray((self.curve >= 0) | (self.distance > 0.0))

    def _of(self, member: str, force: np.ndarray) -> np.ndarray:
        values, pressure = super()._of(member, force), np.maximum(force, 0.0) / self.area
        name = "rate" if member == "closure" else member
        for number, curve in enumerate(self.rates):
            mine = (self.law == number) & (force > 0.0) & (self.distance > 0.0)
            values[mine] += self.distance[mine] * getattr(curve, name)(pressure[mine])
        return values
