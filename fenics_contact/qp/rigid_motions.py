"""Equilibrium of floating bodies: they move until trial forces of contact and friction balance their load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fenics_contact._base.sparse import LAST_PLACES, ROUNDING
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.cones import FeasibleSet
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector, global_max, global_sum

NO_ROWS: npt.NDArray[np.int64] = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class RigidMotionCorrection:
    """Chooses the rigid motions of floating bodies without any F-product.

    A body held only by contact moves by N β, Gᵀ N = 0 on the gluing rows. At a multiplier λ with r = F λ − d
    − Gᵀα, each contact responds to such a motion with the trial force P_Λ(λ − ρ(r − Gᵀ N β)): a spring that
    opens, sticks or slips. The correction solves

        Nᵀ G P_Λ(λ − ρ (r − Gᵀ N β)) = Nᵀ e,

    six equations per body; rows of equality that give way respond with λ − (r − Gᵀ N β) / C. The next face of
    Newton's method then holds the bodies: otherwise a weakly held body overshoots its position in every step,
    and others are not held at all.

    Newton's method with the bound that follows the trial normal force comes first. Where it does not halve
    the imbalance in every step, the bound is frozen and updated alternately; then β minimises a convex
    potential, for friction the sum of Huber functions of the slips, with global convergence. Where no motion
    balances the load under these bounds, bodies move as on linear springs.

    Springs do not know how far others give way when a contact does, so that a flat punch on which a few
    points press is lifted from all that they let in: half of these open again, and active sets cycle. What
    pressed contacts hold, a face knows better; friction and springs may hold too little.

    `motions`: N, orthonormal motions of bodies that no row of equality holds but those that give way,
    replicated; `rows`: Gᵀ N without rounding; `unresisted`: motions that contact resists less than this,
    relative to the others, are left unchanged; `held`: so are those that pressed contacts resist by more than
    this share of all.
    """

    problem: DualProblem
    motions: Vector
    rows: Vector
    unresisted: float = 1e-10
    held: float = 1e-3

    @classmethod
    def build(cls, problem: DualProblem) -> RigidMotionCorrection:
        """Find the floating bodies. Collective."""
        motions = _floating_motions(problem)
        rows = np.asarray(problem.coarse.matrix.T @ motions)
        # Rows that are rounding would let forces of rounding size move a body arbitrarily far.
        sizes = np.sqrt(problem.coarse.matrix.power(2).sum(axis=0)).reshape(-1, 1)
        rows[np.abs(rows) <= ROUNDING * np.asarray(sizes)] = 0.0
        return cls(problem, motions, rows)

    def __call__(
        self,
        multiplier: Vector,
        residual: Vector,
        step: Vector,
        pressed: npt.NDArray[np.int64] = NO_ROWS,
    ) -> Vector:
        """Return δα = N β, shape (m,), replicated. Collective.

        `pressed`: owned rows of normals whose face has found motions already: those that they hold stay.
        """
        if self.motions.shape[1] == 0:
            return np.zeros(len(self.motions))
        problem, step = self.problem, np.array(step)
        step[problem.compliant.rows] = 1.0 / problem.compliant.compliance
        held = self.rows[pressed]
        local = self.rows.T @ (step[:, None] * self.rows), held.T @ (step[pressed, None] * held)
        stiffness, resistance = problem.comm.allreduce(np.array(local))
        values, vectors = np.linalg.eigh(stiffness)
        resisted = values > self.unresisted * values.max(initial=0.0)
        units = vectors[:, resisted] / np.sqrt(values[resisted])
        shares, apart = np.linalg.eigh(units.T @ resistance @ units)
        units = units @ apart[:, shares <= self.held]
        springs = _Springs(
            problem,
            start=multiplier - step * residual,
            step=step,
            rows=self.rows @ units,
            load=units.T @ (self.motions.T @ problem.coarse.load),
            forces=problem.norm(multiplier),
        )
        motion = _equilibrium_motion(springs, problem.law.bound(multiplier))
        return np.asarray(self.motions @ (units @ motion), dtype=np.float64)


def keep_free_motions(face: CoarseSpace, earlier: Vector, alpha: Vector) -> Vector:
    """Return α with the motions that a face leaves undetermined unchanged."""
    basis, _ = np.linalg.qr(face.gram.null_space)
    return np.asarray(alpha + basis @ (basis.T @ (earlier - alpha)), dtype=np.float64)


def _floating_motions(problem: DualProblem) -> Vector:
    """Return N, orthonormal; no columns where there is no contact. Collective."""
    m, equality = problem.coarse.m, np.setdiff1d(problem.layout.equality, problem.compliant.rows)
    if global_max(problem.comm, float(problem.layout.n_contact)) == 0.0 or m == 0:
        return np.zeros((m, 0))
    columns = np.arange(len(equality))
    selection = sp.csr_matrix(
        (np.ones(len(equality)), (equality, columns)), shape=(problem.layout.size, len(equality))
    )
    whole = global_max(problem.comm, float(len(problem.compliant.rows))) == 0.0
    null = problem.coarse.restricted(selection, whole=whole).gram.null_space
    return np.asarray(np.linalg.qr(null)[0], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Balance:
    """The trial multiplier of a motion, its bound, the imbalance and the potential."""

    motion: Vector
    trial: Vector
    bound: Vector
    imbalance: Vector
    potential: float

    @property
    def size(self) -> float:
        """Norm of the imbalance."""
        return float(np.linalg.norm(self.imbalance))


@dataclass(frozen=True, eq=False)
class _Springs:
    """Trial forces as functions of a motion z, in units in which the total spring stiffness is one."""

    problem: DualProblem
    start: Vector  # w = λ − ρ r at z = 0, owned
    step: Vector  # ρ, the stiffness of the springs, owned
    rows: Vector  # Gᵀ N in the coordinates z, shape (n_owned, k)
    load: Vector  # Nᵀ e in the coordinates z, shape (k,)
    forces: float  # ‖λ‖ over all rows of the problem
    balanced: float = 1e-11  # imbalance relative to all forces at which bodies count as in equilibrium
    nearly: float = 1e-6  # the same, where the bounds of friction were updated as often as allowed
    coupled_steps: int = 30  # steps of Newton's method with the bound of the trial force
    frozen_steps: int = 60  # the same with a frozen bound
    refreshes: int = 30  # updates of frozen bounds

    @property
    def compliant(self) -> npt.NDArray[np.int64]:
        """Positions of the rows of equality that give way."""
        return self.problem.compliant.rows

    def at(self, z: Vector, bound: Vector | None = None) -> _Balance:
        """Return the balance at a motion, with a frozen bound or that of the trial force. Collective."""
        layout = self.problem.layout
        contact = layout.contact
        trial = self.start + self.step * (self.rows @ z)
        bound = self.problem.law.bound(self.pressed(trial)) if bound is None else bound
        force = self.problem.compliance.resolve(FeasibleSet(layout, bound), trial, self.step)
        w, p = trial[contact], force[contact]
        # ½‖w‖² − ½‖w − p‖² without its cancellation; its derivative is p.
        energy = float((w - 0.5 * p) @ (p / self.step[contact])) - self.problem.compliance.work(force)
        pulled = trial[self.compliant]
        energy += 0.5 * float(pulled @ (pulled / self.step[self.compliant]))
        resultant = self.rows[contact].T @ p + self.rows[self.compliant].T @ pulled
        sums = global_sum(self.problem.comm, resultant, energy)
        return _Balance(z, trial, bound, sums[:-1] - self.load, float(sums[-1] - self.load @ z))

    def target(self, balance: _Balance) -> float:
        """Return the imbalance at which bodies count as in equilibrium. Collective.

        It is small relative to the forces that act on them; where almost none act, it is the rounding of the
        others.
        """
        largest = global_max(self.problem.comm, float(np.abs(self.rows).max(initial=0.0)))
        return max(self.balanced * self._scale(balance), LAST_PLACES * largest * self.forces)

    def _scale(self, balance: _Balance) -> float:
        """Return the norm of all forces. Collective."""
        contact = self.problem.layout.contact
        feasible = FeasibleSet(self.problem.layout, balance.bound)
        force = self.problem.compliance.resolve(feasible, balance.trial, self.step)
        acting = np.concatenate([contact, self.compliant])
        sizes = global_sum(self.problem.comm, np.abs(self.rows[acting]).T @ np.abs(force[acting]))
        return float(max(np.linalg.norm(self.load), np.linalg.norm(sizes)))

    def slope(self, balance: _Balance, growth: Vector | None) -> Vector:
        """Return the derivative of the imbalance, shape (k, k). Collective."""
        normal, pairs = self.problem.layout.normal, self.problem.layout.tangential
        closed = normal[balance.trial[normal] > 0.0]
        soft = self.problem.compliance.rows_at(balance.trial, self.step)
        step = soft.softened(self.problem.layout, self.step)
        held = np.concatenate([closed, self.compliant])
        local = self.rows[held].T @ (step[held, None] * self.rows[held])
        moved = step[pairs, None] * self.rows[pairs]
        trial = soft.slipping(self.problem.layout, balance.trial, self.step)
        slipped = self._slipped(balance, trial, growth, step, moved)
        local += np.einsum("iak,ial->kl", self.rows[pairs], slipped)
        return np.asarray(self.problem.comm.allreduce(local), dtype=np.float64)

    def pressed(self, trial: Vector) -> Vector:
        """Return w with the normal forces that belong to it, which slip bounds follow, owned."""
        return self.problem.compliance.pressed(trial, self.step)

    def let_go(self, direction: Vector, bound: Vector) -> bool:
        """Whether the load drives a motion for ever against a frozen bound: none balances it. Collective.

        Along it the potential falls without end: no contact is pressed, and friction takes less than the load
        does.
        """
        direction = direction / (np.linalg.norm(direction) or 1.0)
        along = self.rows @ direction
        layout = self.problem.layout
        pressed = self.step[layout.normal] @ np.maximum(along[layout.normal], 0.0) ** 2
        pressed += self.step[self.compliant] @ along[self.compliant] ** 2
        rubbed = bound @ np.linalg.norm(along[layout.tangential], axis=1)
        pressed, rubbed = global_sum(self.problem.comm, pressed, rubbed)
        return bool(pressed <= ROUNDING and rubbed < self.load @ direction)

    def _slipped(
        self, balance: _Balance, trial: Vector, growth: Vector | None, step: Vector, moved: Vector
    ) -> Vector:
        """Return the change of the friction forces when the trial ones change by ``moved``, (n, t, k)."""
        layout = self.problem.layout
        length = np.linalg.norm(trial, axis=1)
        slip = length > balance.bound
        direction = np.where(slip[:, None], trial / np.where(slip, length, 1.0)[:, None], 0.0)
        shrink = np.where(slip, balance.bound / np.where(slip, length, 1.0), 1.0)[:, None, None]
        along = np.einsum("ia,iak->ik", direction, moved)
        change = shrink * (moved - direction[:, :, None] * along[:, None, :])
        if growth is not None:
            rows = layout.tangential_frictional
            rate = np.where(balance.trial[rows] > 0.0, growth * step[rows], 0.0)
            change += direction[:, :, None] * (rate[:, None] * self.rows[rows])[:, None, :]
        return np.asarray(change, dtype=np.float64)


def _equilibrium_motion(springs: _Springs, bound: Vector) -> Vector:
    """Return the motion that balances the load, or that of linear springs where none does. Collective."""
    begin = springs.at(np.zeros(len(springs.load)))
    target = springs.target(begin)
    balance = _coupled(springs, begin, target)
    if balance.size <= target:
        return balance.motion
    balance, bound = begin, np.maximum(begin.bound, bound)
    for _ in range(springs.refreshes):
        frozen = _minimise(springs, springs.at(balance.motion, bound), 0.1 * target)
        balance = springs.at(frozen.motion)
        bound = balance.bound
        if frozen.size > target or balance.size <= target:
            break
    if balance.size <= springs.nearly / springs.balanced * target:
        return balance.motion
    slope = springs.slope(begin, None) + np.eye(len(springs.load))
    return -np.asarray(np.linalg.solve(slope, begin.imbalance), dtype=np.float64)


def _coupled(springs: _Springs, balance: _Balance, target: float) -> _Balance:
    """Take Newton steps as long as each halves the imbalance. Collective."""
    for _ in range(springs.coupled_steps):
        if balance.size <= target:
            break
        slope = springs.slope(balance, springs.problem.law.growth(springs.pressed(balance.trial)))
        step = np.linalg.lstsq(slope, balance.imbalance, rcond=None)[0]
        following = springs.at(balance.motion - step)
        if not following.size < 0.5 * balance.size:
            break
        balance = following
    return balance


def _minimise(springs: _Springs, balance: _Balance, target: float) -> _Balance:
    """Minimise the convex potential of a frozen bound by Levenberg–Marquardt steps. Collective."""
    bound, damping = balance.bound, 1e-10
    for _ in range(springs.frozen_steps):
        if balance.size <= target or damping > 1e4:
            break
        slope = springs.slope(balance, None) + damping * np.eye(len(springs.load))
        step = -np.asarray(np.linalg.solve(slope, balance.imbalance), dtype=np.float64)
        following = _descend(springs, balance, step, bound)
        if following is None:
            damping = max(100.0 * damping, 1e-8)
        elif not following.size < 0.5 * balance.size and springs.let_go(step, bound):
            return following
        else:
            balance, damping = following, max(0.1 * damping, 1e-12)
    return balance


def _descend(springs: _Springs, balance: _Balance, step: Vector, bound: Vector) -> _Balance | None:
    """Return the first of ever shorter steps that lowers the potential or halves its slope. Collective."""
    fraction = 1.0
    while fraction > 1e-4:
        following = springs.at(balance.motion + fraction * step, bound)
        promised = 1e-4 * fraction * float(balance.imbalance @ step)
        if following.potential <= balance.potential + promised or following.size < 0.5 * balance.size:
            return following
        fraction *= 0.5
    return None
