"""A face of the feasible set: which contacts are closed and which discs stick, slip or are pinned."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.reductions import Vector, global_sum

if TYPE_CHECKING:
    from fenics_contact.qp.cones import FeasibleSet

#: A boolean for each multiplier.
Marks = npt.NDArray[np.bool_]

#: Overshoot beyond which a slipping disc keeps its direction: the stiffness κ against rotation would swamp
#: the other entries, and a step that ignores the rotation errs by the inverse of this.
STEEP = 1e6


@dataclass(frozen=True)
class FaceRows:
    """Contact rows of a face, linearised: they do not give way; `SoftRows` do."""

    @property
    def slip_stiffening(self) -> Vector | float:
        """1 + ρ · slip per friction force of discs."""
        return 1.0

    def curvature(self, face: Face) -> Vector:
        """Return zeros, shape (n_face,)."""
        return np.zeros(face.n_face)

    offset = curvature

    def damping(self, face: Face) -> Vector:
        """Return ones, shape (n_face,)."""
        return np.ones(face.n_face)

    def softness(self, face: Face) -> Vector | float:
        """Return zero."""
        return 0.0

    def bent(self, face: Face, curved: Vector) -> Vector:
        """Return κ y as it is."""
        return curved

    def homogeneous(self, face: Face) -> Face:
        """Return the face as it is."""
        return face

    def scaled(self, factor: Vector, discs: Vector) -> FaceRows:
        """Return itself."""
        return self

    def softened(self, layout: ContactLayout, step: Vector) -> Vector:
        """Return ρ as it is."""
        return step

    def slipping(self, layout: ContactLayout, trial: Vector, step: Vector) -> Vector:
        """Return the trial forces of the discs as they are, shape (n_friction, t)."""
        return trial[layout.tangential]


@dataclass(frozen=True)
class ContactLaw:
    """By how much contact rows give way to forces: not at all, C = 0; `Compliance` is of rows that do."""

    gives_way: ClassVar[bool] = False

    def scaled(self, factor: Vector) -> ContactLaw:
        """Return itself."""
        return self

    def given_way(self, multiplier: Vector) -> Vector | float:
        """Return C(λ), zero."""
        return 0.0

    def sprung(self, multiplier: Vector) -> Vector | float:
        """Return D τ, zero."""
        return 0.0

    def energies(self, multiplier: Vector) -> tuple[float, float]:
        """Return zeros."""
        return 0.0, 0.0

    def work(self, multiplier: Vector) -> float:
        """Return zero."""
        return 0.0

    def softness(self, multiplier: Vector) -> Vector:
        """Return C'(λ), owned: zeros."""
        return np.zeros_like(multiplier)

    def surplus(self, feasible: FeasibleSet, multiplier: Vector, residual: Vector) -> float:
        """Return what forces of this rank's contacts lack to those of a displacement, in energy.

        The conjugate energies of both less their work, not negative: Σ λ_N r⁺ + Σ Ψ‖s‖ − τ·s with slips s =
        −r and no penetration. `multiplier`: λ of the set; `residual`: r of the displacement, with C(λ).
        """
        lost = feasible.pressed(multiplier, residual)
        rows = feasible.layout.tangential
        return lost + feasible.rubbed(multiplier[rows], -residual[rows])

    def resolve(self, feasible: FeasibleSet, trial: Vector, step: Vector) -> Vector:
        """Return P_Λ(w) of w = λ − ρ r, owned."""
        return feasible.project(trial)

    def pressed(self, trial: Vector, step: Vector) -> Vector:
        """Return w as it is."""
        return trial

    def rows_at(self, trial: Vector, step: Vector) -> FaceRows:
        """Return rows that do not give way."""
        return FaceRows()


EXACT = ContactLaw()


@dataclass(frozen=True, eq=False)
class Face:
    """An affine piece of the multiplier space, λ = fixed + Z y, on which contact is linear.

    Free on the face are the equality multipliers, the normal ones of closed contacts, both components of
    sticking discs, and for a slipping disc τ = Ψ ŵ + s t̂ the offset s along the circle (none in two
    dimensions, nor where the overshoot is beyond `STEEP`). The columns of Z are orthonormal. Everything else
    is fixed: λ_N = 0 where open, τ = 0 where the disc is pinned (Ψ = 0).

    Attributes:
        layout: Positions of normal and tangential multipliers.
        closed: Marks of closed contacts, shape (n_contact,), owned.
        stick: Marks of sticking discs, shape (n_friction,), owned.
        slip: Marks of slipping discs, shape (n_friction,), owned; a disc with neither mark is pinned.
        slip_bound: Ψ, shape (n_friction,), owned.
        direction: ŵ, direction of the friction force of a slipping disc, shape (n_friction, t), owned.
        overshoot: ‖w_T‖/Ψ ≥ 1 of a slipping disc and 1 elsewhere, shape (n_friction,), owned.
        flexibility: 1/ρ_T of the discs, shape (n_friction,), owned.
        soft: Compliances of contacts and discs.
    """

    layout: ContactLayout
    closed: Marks
    stick: Marks
    slip: Marks
    slip_bound: Vector
    direction: Vector
    overshoot: Vector
    flexibility: Vector
    soft: FaceRows = FaceRows()

    @cached_property
    def restriction(self) -> sp.csr_matrix:
        """Z with orthonormal columns, shape (size, n_face), owned rows and columns."""
        return face_basis(self.layout, self.closed, self.stick, self._turning, self.direction)

    @cached_property
    def _transposed(self) -> sp.csc_matrix:
        """Zᵀ, which shares the memory of Z."""
        return self.restriction.T

    @property
    def n_face(self) -> int:
        """Number of degrees of freedom of the face on this rank."""
        return self.restriction.shape[1]

    @cached_property
    def fixed(self) -> Vector:
        """The part of the multiplier that the face prescribes, Ψ ŵ on slipping discs, owned."""
        prescribed = np.zeros(self.layout.size)
        rows = self.layout.tangential[self.slip]
        prescribed[rows] = self.slip_bound[self.slip, None] * self.direction[self.slip]
        return prescribed

    @cached_property
    def curvature(self) -> Vector:
        """κ = (‖w_T‖ − Ψ)/(ρ_T Ψ) on the offsets of slipping discs, compliances, else 0, shape (n_face,)."""
        kappa, sliding = self.soft.curvature(self), self._sliding
        kappa[self.n_face - len(sliding) :] = (self.overshoot[sliding] - 1.0) * self.flexibility[sliding]
        return kappa

    @cached_property
    def damping(self) -> Vector:
        """(1 + ρ_T κ)^-½, by which a preconditioner for F becomes one for F + κ, shape (n_face,)."""
        factor, sliding = self.soft.damping(self), self._sliding
        factor[self.n_face - len(sliding) :] = 1.0 / np.sqrt(self.overshoot[sliding])
        return factor

    @cached_property
    def offset(self) -> Vector:
        """The constant part of linearised closures, shape (n_face,)."""
        return self.soft.offset(self)

    def bent(self, y: Vector) -> Vector:
        """Return κ y and the constant part of closures, shape (n_face,)."""
        return self.soft.bent(self, self.curvature * y)

    @property
    def homogeneous(self) -> Face:
        """The face without the constant parts of closures, for what is linear in them."""
        return self.soft.homogeneous(self)

    @cached_property
    def offset_stiffness(self) -> Vector:
        """ρ/(1 + ρκ) on the offsets of slipping discs, else 0, shape (n_face,)."""
        result, sliding = np.zeros(self.n_face), self._sliding
        result[self.n_face - len(sliding) :] = 1.0 / (self.overshoot * self.flexibility)[sliding]
        return result

    @cached_property
    def softness(self) -> Vector | float:
        """What a preconditioner adds where a compliance exceeds F, shape (n_face,); zero without any."""
        return self.soft.softness(self)

    def spread(self, contacts: Vector, discs: Vector, other: float = 0.0) -> Vector:
        """Return values of closed contacts and of sticking discs in their columns, another in all others."""
        width, result = self.layout.tangential.shape[1], np.full(self.n_face, other)
        values = np.concatenate([contacts[self.closed], np.repeat(discs[self.stick], width)])
        first = len(self.layout.equality)
        result[first : first + len(values)] = values
        return result

    def scaled(self, factor: Vector) -> Face:
        """Return the face of multipliers λ / s, with the factors s of all rows, owned."""
        layout = self.layout
        discs = factor[layout.tangential[:, 0]]
        soft = self.soft.scaled(factor[layout.normal], discs)
        return replace(self, flexibility=self.flexibility * discs**2, soft=soft)

    def restrict(self, x: Vector) -> Vector:
        """Return Zᵀ x for an owned vector x."""
        return self._transposed @ x

    def prolong(self, y: Vector) -> Vector:
        """Return Z y, owned, for y of shape (n_face,)."""
        return self.restriction @ y

    def nearest(self, x: Vector) -> Vector:
        """Return the orthogonal projection of an owned vector on the face, fixed + Z Zᵀ x."""
        return self.fixed + self.prolong(self.restrict(x))

    def growth(self, rate: Vector) -> sp.csr_matrix:
        """Return the growth of slipping forces with their normal forces, shape (size, n_face).

        Entries ``rate`` · ŵ in the tangential rows of a slipping disc, in the column of its normal
        multiplier.
        """
        layout = self.layout
        column_of_contact = np.full(layout.n_contact, -1)
        column_of_contact[self.closed] = len(layout.equality) + np.arange(np.count_nonzero(self.closed))
        column = column_of_contact[layout.friction_of]
        growing = np.flatnonzero(self.slip & (column >= 0) & (rate > 0.0))
        rows = layout.tangential[growing]
        values = rate[growing, None] * self.direction[growing]
        columns = np.broadcast_to(column[growing, None], rows.shape)
        return Csr((values.ravel(), (rows.ravel(), columns.ravel())), shape=self.restriction.shape)

    def counts(self, comm: MPI.Comm) -> tuple[int, int, int]:
        """Count closed contacts, sticking and slipping discs of all ranks. Collective."""
        marks = self.closed, self.stick, self.slip
        closed, stick, slip = global_sum(comm, *(np.count_nonzero(each) for each in marks))
        return round(float(closed)), round(float(stick)), round(float(slip))

    def changes(self, other: Face) -> int:
        """Count this rank's contacts and discs whose status differs between two faces."""
        return int(
            np.count_nonzero(self.closed != other.closed)
            + np.count_nonzero((self.stick != other.stick) | (self.slip != other.slip))
        )

    @property
    def _sliding(self) -> npt.NDArray[np.int64]:
        """Slipping discs with a tangent along which they can move; none in two dimensions."""
        return turning_discs(self.layout, self._turning)

    @property
    def _turning(self) -> Marks:
        """Marks of slipping discs whose direction is free."""
        return self.slip & (self.overshoot <= STEEP)


def turning_discs(layout: ContactLayout, turning: Marks) -> npt.NDArray[np.int64]:
    """Return which discs can turn: none in two dimensions."""
    return np.flatnonzero(turning) if layout.tangential.shape[1] == 2 else np.zeros(0, np.int64)


def face_basis(
    layout: ContactLayout, closed: Marks, stick: Marks, sliding: Marks, direction: Vector
) -> sp.csr_matrix:
    """Return Z of a face: its columns are orthonormal, shape (size, n_face), owned rows and columns."""
    single = np.concatenate([layout.equality, layout.normal[closed], layout.tangential[stick].ravel()])
    across = turning_discs(layout, sliding)
    tangents = np.stack([-direction[across, -1], direction[across, 0]], axis=1)
    pairs = layout.tangential[across]
    rows = np.concatenate([single, pairs.ravel()])
    columns = np.concatenate([np.arange(len(single)), np.repeat(len(single) + np.arange(len(across)), 2)])
    values = np.concatenate([np.ones(len(single)), tangents.ravel()])
    return Csr((values, (rows, columns)), shape=(layout.size, len(single) + len(across)))


def classify(
    layout: ContactLayout,
    slip_bound: Vector,
    multiplier: Vector,
    residual: Vector,
    step: Vector,
    compliance: ContactLaw = EXACT,
) -> Face:
    """Return the face on which the semismooth Newton method linearises w = λ − ρ r.

    Contacts with w_N > 0 are closed. Discs with ‖w_T‖ < Ψ, or (1 + ρ_T D) Ψ with a compliance D, stick, the
    others slip along ŵ = w_T/‖w_T‖, and those with Ψ = 0 are pinned.
    """
    trial = multiplier - step * residual
    tangential = trial[layout.tangential]
    length = np.linalg.norm(tangential, axis=1)
    soft = compliance.rows_at(trial, step)
    free = slip_bound > 0.0
    slip = free & (length >= slip_bound * soft.slip_stiffening)
    divisor = np.where(slip, length, 1.0)
    return Face(
        layout=layout,
        closed=trial[layout.normal] > 0.0,
        stick=free & ~slip,
        slip=slip,
        slip_bound=slip_bound,
        direction=np.where(slip[:, None], tangential / divisor[:, None], 0.0),
        overshoot=np.divide(length, slip_bound, out=np.ones_like(length), where=slip),
        flexibility=np.asarray(1.0 / step[layout.tangential[:, 0]], dtype=np.float64),
        soft=soft,
    )
