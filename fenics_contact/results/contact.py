"""The result on the contact surfaces of a solved scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.display import DerivedUnits, counted, displayed
from fenics_contact._pairing.points import ContactPoints
from fenics_contact.qp.solution import Residuals

if TYPE_CHECKING:
    from fenics_contact._scene.pairs import ContactPair
    from fenics_contact._scene.scene import Scene


class Status(IntEnum):
    """Status of a contact point."""

    #: Open: no contact and no force.
    OPEN = 0
    #: Closed, and held by friction: ‖τ‖ ≤ Ψ without slip.
    STICK = 1
    #: Closed and slipping: ‖τ‖ = Ψ against the slip, or there is no friction.
    SLIP = 2


@dataclass(frozen=True, eq=False)
class RowValues:
    """What the law of each row of B depends on at a state, owned by rows.

    `multiplier`: λ; `residual`: c − B u: gaps, minus the slip, and openings of glued rows; `slip_bound`: Ψ;
    `step`: ρ of the natural map, zero on equality rows, shape (n_owned,), [force / length]; `opening`: by how
    much the loads alone, or the next increment, open the rows; `between_supports`: marks of the rows that
    supports alone determine.
    """

    multiplier: np.ndarray
    residual: np.ndarray
    slip_bound: np.ndarray
    step: np.ndarray
    opening: np.ndarray
    between_supports: np.ndarray
    residuals: Residuals


@dataclass(frozen=True)
class NormalForces:
    """The normal forces of a contact pair, added up in both ways.

    `sum`: Σ λ_N, the pressure over the area, ≥ 0; `resultant`: ‖Σ n λ_N‖, of which nothing is left where they
    balance each other, as around a shaft; of bodies of revolution along the axis.
    """

    sum: float
    resultant: float

    @classmethod
    def of(cls, force: np.ndarray, normal: np.ndarray, rounding: float = 1e-10) -> NormalForces:
        """Return those of normal forces, (n,), along normals, (n, dim); `rounding`: of sums that cancel."""
        total, resultant = float(force.sum()), float(np.linalg.norm(force @ normal))
        return cls(total, resultant if resultant > rounding * total else 0.0)

    def differ(self, by: float = 1e-4) -> bool:
        """Return whether the resultant is not the sum, relative to this: the surface is curved."""
        return self.sum - self.resultant > by * self.sum

    def in_words(self, unit: str = "", written: Callable[[float], str] = "{:.6g}".format) -> str:
        """Return them with their unit: one number on flat surfaces, where both are the same."""
        total, resultant = (f"{written(size)} {unit}".rstrip() for size in (self.sum, self.resultant))
        if not self.differ():
            return f"normal force {total}"
        return f"sum of normal forces {total}, their resultant {resultant}"


@displayed
@dataclass(frozen=True)
class ContactResult:
    """Forces, distances and status of every contact point, replicated on all ranks.

    Attributes:
        points: Positions and frames of the contact points.
        normal_force: λ_N ≥ 0, zero at open points, shape (n,), [force]. What a solver that ends at its
            tolerance leaves besides is in balance, reactions and resultants alone.
        friction_force: τ in the points' tangents, zero without friction, shape (n, dim - 1), [force]. It
            acts on the master; the opposite acts on the slave.
        slip_bound: Largest friction force, shape (n,), [force].
        gap: Gap after deformation, shape (n,), [length].
        slip: Relative tangential displacement in the points' tangents since the last load step, also of
            frictionless and open points, shape (n, dim - 1), [length]; without its elastic part where there
            is a stick stiffness.
        slip_before: The same of all load steps before, shape (n, dim - 1), [length].
        status: `Status` of each point, shape (n,). A closed point without friction slips.
        area: Area that belongs to each point, of mortar contact the part of it that faces the master (no less
            than a half of it with large deformations): where the slave's material is made for these that of
            the deformed slave, else ``nominal_area``, shape (n,), [length²] or in the plane [length].
        nominal_area: The same of the undeformed slave, shape (n,).
        unbalanced: Ones, and zero for components of forces that balance each other around an axis of
            revolution, shape (dim,).
        wet: Whether fluid has reached a point, shape (n,); None where no fluid is. Its pressure is no part of
            the contact pressure.
        worn: Depth that the last load step has taken away, of both surfaces together, shape (n,), [length];
            zero where no pair wears.
        worn_before: The same of all load steps before.
    """

    points: ContactPoints
    normal_force: np.ndarray
    friction_force: np.ndarray
    slip_bound: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    slip_before: np.ndarray
    status: np.ndarray
    area: np.ndarray
    nominal_area: np.ndarray
    unbalanced: np.ndarray
    wet: np.ndarray | None = None
    worn: np.ndarray | float = 0.0
    worn_before: np.ndarray | float = 0.0

    def _facts(self) -> dict[str, Any]:
        normal = self.normal_force
        return {
            "points": f"{self.points.count}: {self.counts_in_words}",
            "normal force": f"up to {normal.max(initial=0.0):.6g}, sum {normal.sum():.6g}",
            "friction force": f"up to {_longest(self.friction_force):.6g}",
            "pressure": f"up to {self.pressure.max(initial=0.0):.6g}",
            "gap": self.gap,
            "slip": f"up to {_longest(self.slip):.3g}",
        }

    @property
    def counts_in_words(self) -> str:
        """Numbers of points by status: "4 open, 12 stick, 3 slip"."""
        return ", ".join(f"{self.count(status)} {status.name.lower()}" for status in Status)

    @property
    def pressure(self) -> np.ndarray:
        """True pressure, normal force over `area`, shape (n,), [force / length²].

        It is the normal part of the Cauchy stress there. Where bodies deform little it is the nominal one.
        """
        return self.normal_force / self.area

    @property
    def nominal_pressure(self) -> np.ndarray:
        """Normal force over `nominal_area`, of the undeformed slave, shape (n,), [force / length²]."""
        return self.normal_force / self.nominal_area

    @property
    def traction(self) -> np.ndarray:
        """True friction force over `area`, in the points' tangents, shape (n, dim - 1), [force / length²]."""
        return np.asarray(self.friction_force / self.area[:, None])

    @property
    def nominal_traction(self) -> np.ndarray:
        """Friction force over `nominal_area`, as `traction`, shape (n, dim - 1), [force / length²]."""
        return np.asarray(self.friction_force / self.nominal_area[:, None])

    @property
    def force(self) -> np.ndarray:
        """Force on the slave at each point in space, n λ_N − t τ, shape (n, dim), [force]."""
        normal = self.points.normal
        return self.normal_force[:, None] * normal - self._in_space(self.friction_force)

    def normal_forces(self, pair: int = 0) -> NormalForces:
        """Return sum and resultant of the normal forces of a pair, by its number in the scene."""
        mine = self.on_pair(pair)
        return NormalForces.of(self.normal_force[mine], self.points.normal[mine] * self.unbalanced)

    @property
    def slip_in_space(self) -> np.ndarray:
        """Slip of the last load step as vectors in space, shape (n, dim), [length]."""
        return self._in_space(self.slip)

    def _in_space(self, tangential: np.ndarray) -> np.ndarray:
        """Return tangential components as vectors in space."""
        return np.asarray(np.einsum("na,nad->nd", tangential, self.points.tangents))

    @property
    def total_slip(self) -> np.ndarray:
        """Relative tangential displacement since the undeformed state, shape (n, dim - 1), [length]."""
        return self.slip_before + self.slip

    @property
    def worn_depth(self) -> np.ndarray:
        """Depth that has been worn off both surfaces together, shape (n,), [length]."""
        return np.zeros(self.points.count) + self.worn_before + self.worn

    def worn_volume(self, pair: int = 0) -> float:
        """Return the volume that has been worn off both surfaces of a pair, by its number, [length³]."""
        mine = self.on_pair(pair)
        return float(self.nominal_area[mine] @ self.worn_depth[mine])

    def travel(self, direction: np.ndarray, pair: int = 0) -> float:
        """Return how far the unloaded slave may move until the pair touches, [length].

        Args:
            direction: Unit vector along which it moves as a rigid body, shape (dim,).
            pair: Number of the contact pair in the scene.

        Returns:
            The smallest distance over all points that the motion brings closer, negative where bodies
            overlap; infinite if it brings none closer.
        """
        mine = self.on_pair(pair)
        along = np.asarray(direction, dtype=np.float64)
        closing = -self.points.normal[mine][:, : len(along)] @ along  # with torsion normals have one more
        ahead = closing > 0.0
        return float(np.min(self.points.gap[mine][ahead] / closing[ahead], initial=np.inf))

    def count(self, status: Status) -> int:
        """Return how many points have a status."""
        return int(np.count_nonzero(self.status == status))

    def on_pair(self, pair: int) -> np.ndarray:
        """Return the numbers of the points of one contact pair."""
        return np.flatnonzero(self.points.pair == pair)


def _longest(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max(initial=0.0))


def no_contact(points: ContactPoints) -> ContactResult:
    """Return the result of a scene without contact points."""
    nothing, vectors = np.zeros(0), np.zeros((0, points.normal.shape[1] - 1))
    return ContactResult(
        points, nothing, vectors, nothing, nothing, vectors, vectors, np.zeros(0, dtype=np.int64), nothing,
        nothing, np.ones(points.normal.shape[1]),
    )  # fmt: skip


def pairs_in_words(
    scene: Scene, contact: ContactResult, force: str = "", stress: str = "", length: str = ""
) -> list[str]:
    """Return a summary of each contact pair: points by status, resultants, largest pressure, and wear."""
    rows, volume = [], DerivedUnits.of("", length, scene.dimension_record).volume if length else ""
    units = {"worn volume": volume, "worn depth": length}
    for number, pair in enumerate(scene.contacts):
        mine = contact.on_pair(number)
        pressing = contact.normal_force[mine, None] * contact.points.normal[mine]
        resultant = contact.normal_forces(number).in_words(force)
        if pair.has_friction:
            resultant += f", friction {_size(contact.force[mine] - pressing, force)}"
        pressure = f"{contact.pressure[mine].max(initial=0.0):.5g} {stress}".rstrip()
        if scene.deforms_much:
            nominal = contact.nominal_pressure[mine].max(initial=0.0)
            pressure += f", nominal {nominal:.5g} {stress}".rstrip()
        for name, value in worn_from(scene, contact, number).items():
            pressure += f", {name} {value:.5g} {units[name]}".rstrip()
        rows.append(
            f"{pair.place}: {counted(len(mine), 'point')}, {_kinds(pair, contact.status[mine])}; "
            f"{resultant}, pressure up to {pressure}"
        )
    return rows


def worn_from(scene: Scene, contact: ContactResult, number: int) -> dict[str, float]:
    """Return volume and largest depth that a pair has lost by their names, none if it does not wear."""
    if not scene.contacts[number].wears:
        return {}
    deepest = float(contact.worn_depth[contact.on_pair(number)].max(initial=0.0))
    return {"worn volume": contact.worn_volume(number), "worn depth": deepest}


def _size(forces: np.ndarray, unit: str) -> str:
    """Return the magnitude of the sum of forces, shape (n, dim), with its unit."""
    return f"{np.linalg.norm(forces.sum(axis=0)):.6g} {unit}".rstrip()


def _kinds(pair: ContactPair, status: np.ndarray) -> str:
    """Return the numbers of points by status; without friction open or closed."""
    counts = {kind.name.lower(): int(np.count_nonzero(status == kind)) for kind in Status}
    if not pair.has_friction:
        counts = {"open": counts["open"], "closed": len(status) - counts["open"]}
    return ", ".join(f"{count} {name}" for name, count in counts.items())
