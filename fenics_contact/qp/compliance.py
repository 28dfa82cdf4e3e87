"""Compliances of contact rows: surfaces that give way under the forces on them, by a closure and by slip.

With a monotone C(λ) the law of a contact is gap + C(λ_N) ≥ 0, λ_N ≥ 0, and their product vanishes: λ
minimises ½ λᵀF λ − dᵀλ + Φ(λ) over its cone, where Φ' = C. The natural map of exact contact, P_Λ(w) with
w = λ − ρ r, becomes the resolvent (1 + ρ (C + ∂I_Λ))⁻¹ w; C = 0 is exact contact. Residuals and operators do
not change otherwise: r and F are those of exact contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact.qp.cones import FeasibleSet
from fenics_contact.qp.face import ContactLaw, Face, FaceRows
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.reductions import Vector


class ClosureCurve(Protocol):
    """How far two surfaces approach under a pressure; it never falls, and is zero without pressure."""

    def closure(self, pressure: Vector) -> Vector:
        """Return the closure, shape (n,), [length]."""

    def growth(self, pressure: Vector) -> Vector:
        """Return its derivative by the pressure, shape (n,)."""

    def work(self, pressure: Vector) -> Vector:
        """Return its integral over the pressure from zero, shape (n,)."""


@dataclass(frozen=True, eq=False)
class Closures:
    """C(λ) = s c(λ / A) of normal forces, with a scale s that is one but for scaled multipliers.

    `area`: A; `curve`: number of the curve c, −1 for exact contact; `scale`: s.
    """

    area: Vector
    curve: npt.NDArray[np.int64]
    scale: Vector
    curves: Sequence[ClosureCurve]

    @classmethod
    def exact(cls, area: Vector) -> Closures:
        """Return those of exact contact."""
        return cls(area, np.full(len(area), -1), np.ones(len(area)), ())

    @property
    def soft(self) -> npt.NDArray[np.bool_]:
        """Marks of the contacts that give way, shape (n,)."""
        return np.asarray(self.curve >= 0)

    def part(self, chosen: npt.NDArray[np.int64] | npt.NDArray[np.bool_]) -> Closures:
        """Return those of some contacts."""
        return replace(self, area=self.area[chosen], curve=self.curve[chosen], scale=self.scale[chosen])

    def scaled(self, factor: Vector) -> Closures:
        """Return s C(s μ) of multipliers μ = λ / s."""
        return replace(self, area=self.area / factor, scale=self.scale * factor)

    def closure(self, force: Vector) -> Vector:
        """Return C(λ), zero where λ ≤ 0, shape (n,)."""
        return self.scale * self._of("closure", force)

    def growth(self, force: Vector) -> Vector:
        """Return C'(λ), shape (n,)."""
        return self.scale / self.area * self._of("growth", force)

    def work(self, force: Vector) -> Vector:
        """Return Φ(λ), the integral of C from zero to λ, shape (n,)."""
        return self.scale * self.area * self._of("work", force)

    def by_area(self, force: Vector) -> Vector:
        """Return dC/dA at given forces, shape (n,)."""
        return -self.growth(force) * np.maximum(force, 0.0) / self.area

    def force(self, closure: Vector, forces: float, far: float = 1e12) -> Vector:
        """Return λ ≥ 0 with C(λ) = δ, zero where δ ≤ 0, shape (n,).

        `forces`: a typical force; those of ``far`` times that would be too small.
        """
        least = 1e-30 * closure.max(initial=0.0)
        step = far * forces / np.where(closure > least, closure, least or 1.0)
        return self.resolve(step * closure, step)

    def surplus(self, force: Vector, residual: Vector) -> Vector:
        """Return φ(δ) + Φ(λ) − λδ, the energy between a force λ and a closure δ = C(λ) − r, shape (n,).

        Not less than zero, which it is where they belong to each other, and at most r times the difference of
        λ and the force of δ; λ r⁺ for exact contact, where δ ≤ 0.
        """
        lost, soft = force * np.maximum(residual, 0.0), np.flatnonzero(self.soft)
        if len(soft) == 0:
            return lost
        mine, force, residual = self.part(soft), force[soft], residual[soft]
        closure = mine.closure(force) - residual
        other = mine.force(closure, force.max(initial=np.finfo(float).tiny))
        parts = other * closure, mine.work(other), mine.work(force), force * closure
        exact = parts[0] - parts[1] + parts[2] - parts[3]
        rounding = LAST_PLACES * np.abs(parts).sum(axis=0)
        lost[soft] = np.clip(exact + rounding, 0.0, np.abs((force - other) * residual))
        return lost

    def _of(self, member: str, force: Vector) -> Vector:
        pressure, values = np.maximum(force, 0.0) / self.area, np.zeros(len(force))
        for number, curve in enumerate(self.curves):
            mine = (self.curve == number) & (force > 0.0)
            values[mine] = getattr(curve, member)(pressure[mine])
        return values

    def resolve(self, trial: Vector, step: Vector, most: int = 200) -> Vector:
        """Return λ ≥ 0 with λ + ρ C(λ) = w, zero where w ≤ 0, shape (n,).

        By Newton's method between bounds: the left side grows at least as λ does. `trial`: w; `step`: ρ.
        """
        upper = np.maximum(trial, 0.0)
        left, right = np.flatnonzero(self.soft & (upper > 0.0)), None
        force = upper.copy()
        low, high = np.zeros(len(left)), upper[left]
        for _ in range(most):
            if len(left) == 0:
                break
            mine, x = self.part(left), force[left]
            excess = x + step[left] * mine.closure(x) - upper[left]
            low, high = np.where(excess <= 0.0, x, low), np.where(excess >= 0.0, x, high)
            right = x - excess / (1.0 + step[left] * mine.growth(x))
            inside = (right > low) & (right < high)
            following = np.where(inside, right, 0.5 * (low + high))
            force[left] = np.where(excess == 0.0, x, following)
            small = 4.0 * np.finfo(float).eps * np.maximum(high, np.finfo(float).tiny)
            open_ = (np.abs(force[left] - x) > small) & (high - low > small)
            left, low, high = left[open_], low[open_], high[open_]
        return force


@dataclass(frozen=True, eq=False)
class SoftRows(FaceRows):
    """The linearised compliances of contacts, C ≈ constant + slope λ, and those of friction discs.

    `stiffening`: 1 + ρ · slope of contacts; `step`: ρ of contacts; `slip`: slip per friction force of discs;
    `slip_step`: ρ of discs.
    """

    slope: Vector
    constant: Vector
    step: Vector
    slip: Vector
    slip_step: Vector

    @property
    def stiffening(self) -> Vector:
        """1 + ρ · slope of contacts, shape (n_contact,)."""
        return 1.0 + self.step * self.slope

    @property
    def slip_stiffening(self) -> Vector:
        """1 + ρ · slip of discs, shape (n_friction,)."""
        return 1.0 + self.slip_step * self.slip

    def curvature(self, face: Face) -> Vector:
        """Return κ in the columns of a face, shape (n_face,)."""
        return face.spread(self.slope, self.slip)

    def damping(self, face: Face) -> Vector:
        """Return (1 + ρκ)^-½ in the columns of a face, one in others, shape (n_face,)."""
        return face.spread(self.stiffening**-0.5, self.slip_stiffening**-0.5, 1.0)

    def softness(self, face: Face) -> Vector:
        """Return the inverses of large compliances κ, ρ (1 − 1/(1 + ρκ)) / (1 + ρκ), shape (n_face,)."""
        pairs = ((self.step, self.stiffening), (self.slip_step, self.slip_stiffening))
        contacts, discs = (step * (soft - 1.0) / soft**2 for step, soft in pairs)
        return face.spread(contacts, discs)

    def offset(self, face: Face) -> Vector:
        """Return the constant parts in the columns of a face, shape (n_face,)."""
        return face.spread(self.constant, np.zeros(len(self.slip)))

    def bent(self, face: Face, curved: Vector) -> Vector:
        """Return κ y with the constant parts, shape (n_face,)."""
        return curved + face.offset

    def homogeneous(self, face: Face) -> Face:
        """Return the face without constant parts."""
        return replace(face, soft=replace(self, constant=np.zeros_like(self.constant)))

    def softened(self, layout: ContactLayout, step: Vector) -> Vector:
        """Return ρ / (1 + ρκ), the steps of trial forces on rows that give way, owned."""
        softened = step.copy()
        softened[layout.normal] /= self.stiffening
        softened[layout.tangential] /= self.slip_stiffening[:, None]
        return softened

    def slipping(self, layout: ContactLayout, trial: Vector, step: Vector) -> Vector:
        """Return the forces w_T / (1 + ρκ) of the discs, shape (n_friction, t)."""
        first = layout.tangential[:, :1]
        return np.asarray(trial[layout.tangential] * self.softened(layout, step)[first] / step[first])

    def scaled(self, factor: Vector, discs: Vector) -> SoftRows:
        """Return those of multipliers λ / s, with the factors of contacts and of discs."""
        return SoftRows(
            self.slope * factor**2,
            self.constant * factor,
            self.step / factor**2,
            self.slip * discs**2,
            self.slip_step / discs**2,
        )


@dataclass(frozen=True, eq=False)
class Compliance(ContactLaw):
    """What this rank's contact rows give way: C(λ_N) along the normal, D τ along the tangents.

    `slip`: D of the friction discs, the elastic slip per friction force, owned.
    """

    layout: ContactLayout
    closures: Closures
    slip: Vector

    gives_way: ClassVar[bool] = True

    def scaled(self, factor: Vector) -> Compliance:
        """Return the compliance of multipliers λ / s, with the factors s of all rows, owned."""
        layout = self.layout
        discs = factor[layout.tangential[:, 0]]
        return replace(self, closures=self.closures.scaled(factor[layout.normal]), slip=self.slip * discs**2)

    def given_way(self, multiplier: Vector) -> Vector:
        """Return C(λ), owned: closures and elastic slips, zero in rows of equality."""
        result = self.sprung(multiplier)
        result[self.layout.normal] = self.closures.closure(multiplier[self.layout.normal])
        return result

    def sprung(self, multiplier: Vector) -> Vector:
        """Return D τ, owned: elastic slips, zero in all other rows."""
        rows, result = self.layout.tangential, np.zeros(self.layout.size)
        result[rows] = self.slip[:, None] * multiplier[rows]
        return result

    def energies(self, multiplier: Vector) -> tuple[float, float]:
        """Return λᵀC(λ) and Φ(λ) of this rank's rows, [force · length]."""
        return float(multiplier @ self.given_way(multiplier)), self.work(multiplier)

    def work(self, multiplier: Vector) -> float:
        """Return Φ(λ) of this rank's rows, [force · length]."""
        layout, tau = self.layout, multiplier[self.layout.tangential]
        normal = self.closures.work(multiplier[layout.normal]).sum()
        return float(normal + 0.5 * self.slip @ np.einsum("ia,ia->i", tau, tau))

    def softness(self, multiplier: Vector) -> Vector:
        """Return C'(λ) of contacts and D of friction discs, owned, zero in rows of equality."""
        layout, result = self.layout, np.zeros(self.layout.size)
        result[layout.normal] = self.closures.growth(multiplier[layout.normal])
        result[layout.tangential] = self.slip[:, None]
        return result

    def surplus(self, feasible: FeasibleSet, multiplier: Vector, residual: Vector) -> float:
        """Return what forces of this rank's contacts lack to those of a displacement, in energy.

        As `ContactLaw.surplus`, where a part of each approach is the closure's and of each slip the spring's.
        """
        layout, tau = self.layout, multiplier[self.layout.tangential]
        lost = self.closures.surplus(multiplier[layout.normal], residual[layout.normal]).sum()
        slid, soft = self.slip[:, None] * tau - residual[layout.tangential], self.slip > 0.0
        elastic, slip = np.zeros_like(slid), self.slip[soft, None]
        length = np.linalg.norm(slid[soft], axis=1, keepdims=True)
        elastic[soft] = slid[soft] * np.minimum(
            slip * feasible.slip_bound[soft, None] / np.where(length > 0.0, length, 1.0), 1.0
        )
        missing = elastic[soft] / slip - tau[soft]
        return float(lost + 0.5 * (slip * missing**2).sum() + feasible.rubbed(tau, slid - elastic))

    def resolve(self, feasible: FeasibleSet, trial: Vector, step: Vector) -> Vector:
        """Return the force that the law gives to w = λ − ρ r, the resolvent of C + ∂I_Λ, owned."""
        layout, softened = self.layout, np.array(trial)
        softened[layout.tangential] = trial[layout.tangential] / self._slip_stiffening(step)[:, None]
        force = feasible.project(softened)
        force[layout.normal] = self.closures.resolve(trial[layout.normal], step[layout.normal])
        return force

    def pressed(self, trial: Vector, step: Vector) -> Vector:
        """Return w with the normal forces that belong to it, which slip bounds follow, owned."""
        rows, pressed = self.layout.normal, trial.copy()
        pressed[rows] = self.closures.resolve(trial[rows], step[rows])
        return pressed

    def rows_at(self, trial: Vector, step: Vector) -> SoftRows:
        """Return the compliances linearised where the law answers to w = λ − ρ r.

        Between the force and the closure of the last iterate: a force alone may lie on the flat part of a
        curve, a closure alone on its steep one, where Newton's steps would overshoot.
        """
        step_n = step[self.layout.normal]
        force = self.closures.resolve(trial[self.layout.normal], step_n)
        # A contact that only just touches may count as closed.
        slope = self.closures.growth(np.maximum(force, np.sqrt(np.finfo(float).tiny)))
        offset = self.closures.closure(force) - slope * force
        return SoftRows(slope, offset, step_n, self.slip, step[self.layout.tangential[:, 0]])

    def _slip_stiffening(self, step: Vector) -> Vector:
        return np.asarray(1.0 + step[self.layout.tangential[:, 0]] * self.slip)

    @cached_property
    def soft(self) -> npt.NDArray[np.bool_]:
        """Marks of the rows with a compliance, shape (size,), owned."""
        marks = np.zeros(self.layout.size, dtype=bool)
        marks[self.layout.normal] = self.closures.soft
        marks[self.layout.tangential] = (self.slip > 0.0)[:, None]
        return marks
