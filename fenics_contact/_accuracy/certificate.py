"""An upper bound of the algebraic error by duality, from an admissible multiplier and displacement."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact._base.sparse import LAST_PLACES, ROUNDING
from fenics_contact.feti.direct import DirectSolution, DirectSystem
from fenics_contact.feti.dual import DualSystem
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.cones import FeasibleSet
from fenics_contact.qp.face import Marks, face_basis
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector, global_max, global_sum
from fenics_contact.qp.solution import DualSolution, contact_step

#: Largest weight of multipliers at their bounds, relative to free ones.
HELD = 1e-3


@dataclass(frozen=True, eq=False)
class _Point:
    """α with λ₀ − Gᵀα, its multiplier, the remaining G λ − e, and the value of the convex function."""

    alpha: Vector
    trial: Vector
    multiplier: Vector
    lacking: Vector
    value: float


def nearest(
    problem: DualProblem, feasible: FeasibleSet, start: Vector, enough: float, max_steps: int = 100
) -> Vector:
    """Return the multiplier of a cone in equilibrium that is nearest to a given one. Collective; no product.

    With P the projection on the cone it is λ(α) = P(λ₀ − Gᵀα), where α minimises the convex function

        −½‖λ(α) − λ₀‖² − α·(G λ(α) − e),

    whose gradient is e − G λ(α): a semismooth Newton method with as many unknowns as there are rigid motions.
    Where the cone has only one multiplier in equilibrium, α grows without bound while G λ − e tends to zero.
    Norms are those of the scaled multipliers. Returns within the cone, owned; in equilibrium unless there is
    no such multiplier.
    """
    search = _Search(problem, feasible, start)
    point = search.at(np.zeros(problem.coarse.m))
    for _ in range(max_steps):
        left = search.length(point)
        if left <= enough:
            break
        following = search.step(point, left)
        if following is None:
            break
        point = following
    return point.multiplier


class _Search:
    """The convex function and Newton's steps on it."""

    halvings = 30  # of a step
    armijo = 1e-4  # fraction of the predicted decrease that a step must achieve,
    reduced = 0.5  # or of the imbalance that it may leave

    def __init__(self, problem: DualProblem, feasible: FeasibleSet, start: Vector) -> None:
        self._problem, self._feasible, self._start = problem, feasible, start
        self._coarse = problem.scaled_problem.coarse
        self._factor = scaling_factors(problem)
        self._size = problem.norm(start) or 1.0

    def at(self, alpha: Vector) -> _Point:
        trial = self._start - self._factor * self._coarse.transpose(alpha)
        multiplier = self._feasible.project(trial)
        way = (multiplier - self._start) / self._factor
        lacking = self._problem.coarse.residual(multiplier)
        value = -0.5 * float(global_sum(self._problem.comm, way @ way)[0]) - float(alpha @ lacking)
        return _Point(alpha, trial, multiplier, lacking, value)

    def length(self, point: _Point) -> float:
        return self._problem.coarse.norm(point.lacking)

    def step(self, point: _Point, left: float) -> _Point | None:
        """Return a better point along the Newton step, None if there is none. Collective."""
        weight = HELD * min(1.0, left / self._size)
        direction = self._coarse.restricted(self._slope(point, weight)).solve(point.lacking)
        promised = float(point.lacking @ direction)
        share = 1.0
        for _ in range(self.halvings):
            trial = self.at(point.alpha + share * direction)
            decreases = trial.value <= point.value - self.armijo * share * promised
            if decreases or self.length(trial) <= self.reduced * left:
                return trial
            share *= 0.5
        return None

    def _slope(self, point: _Point, weight: float) -> sp.csr_matrix:
        """Return a root of P' + weight (1 − P') at a point, shape (size, size), owned."""
        layout, size, trial = self._feasible.layout, len(self._start), point.trial
        root = np.ones(size)
        root[layout.normal] = np.where(trial[layout.normal] > 0.0, 1.0, np.sqrt(weight))
        tau, rows = trial[layout.tangential], layout.tangential
        length = np.linalg.norm(tau, axis=1)
        outside = length > self._feasible.slip_bound
        far = np.where(outside, length, 1.0)
        across = np.where(outside, np.sqrt(self._feasible.slip_bound / far + weight), 1.0)
        along = np.where(outside, np.sqrt(weight), 1.0)
        ray = tau / far[:, None]
        blocks = across[:, None, None] * np.eye(rows.shape[1]) + (along - across)[:, None, None] * (
            ray[:, :, None] * ray[:, None, :]
        )
        root[rows] = 0.0
        i, j = np.broadcast_arrays(rows[:, :, None], rows[:, None, :])
        discs = sp.csr_matrix((blocks.ravel(), (i.ravel(), j.ravel())), shape=(size, size))
        return (sp.diags(root) + discs).tocsr()


def scaling_factors(problem: DualProblem) -> Vector:
    """Return the factors of the scaled multipliers, one where stiffness is uniform, owned."""
    return problem.scaling.factor * np.ones(problem.layout.size)


#: Imbalance above this fraction of all forces, at which duality gives no bound.
UNBALANCED = 1e-9
#: A slip bound larger than any force.
ENDLESS = 1e300


@dataclass(frozen=True, eq=False)
class Statuses:
    """Statuses of contact at a multiplier, and the rows that are free for them.

    `slip`: discs on the circle, owned; the others are pinned (Ψ = 0); `directions`: multiplier whose friction
    forces give the directions, owned; `multiplier`: the one as found, owned; `softness`: how much more rows
    give way than the bodies there, owned.
    """

    system: DualSystem
    closed: Marks
    stick: Marks
    slip: Marks
    directions: Vector
    multiplier: Vector
    softness: Vector

    @property
    def problem(self) -> DualProblem:
        """The dual problem."""
        return self.system.problem

    @cached_property
    def soft(self) -> Marks:
        """Marks of rows that give way more than the bodies there, owned."""
        return self.softness > 1.0

    @cached_property
    def gives_way(self) -> bool:
        """Whether some row is soft or foundations hold some body. Collective on first use."""
        soft = global_max(self.problem.comm, float(self.soft.any()))
        return self.system.soft_motions.count > 0 or soft > 0.0

    @cached_property
    def free(self) -> sp.csr_matrix:
        """Basis of the rows whose multipliers are free and in which r should vanish, shape (size, n_face)."""
        return self._weighted(basis(self.problem.layout, self.closed, self.stick, self.slip, self.directions))

    @cached_property
    def coarse(self) -> CoarseSpace:
        """Equilibrium on the free rows only, in scaled multipliers. Collective on first use."""
        return self.system.soft_motions.coarse(self.free)

    def _weighted(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """Return rows with weights: forces on soft ones cost more, and their lengths less."""
        return (sp.diags(np.maximum(self.softness, 1.0) ** -0.5) @ rows).tocsr()

    def spaces(self) -> Iterator[tuple[sp.csr_matrix, CoarseSpace]]:
        """Bases of rows with their equilibrium: of the free rows, of all closed contacts, of all."""
        yield self.free, self.coarse
        layout, coarse = self.problem.layout, self.system.soft_motions.coarse
        nowhere = np.zeros_like(self.slip)
        pressing = basis(layout, self.closed, self.stick | self.slip, nowhere, self.directions)
        for rows in (pressing, sp.identity(layout.size, format="csr")):
            weighted = self._weighted(rows)
            yield weighted, coarse(weighted)

    def lacking(self, point: Vector, rows: sp.csr_matrix, coarse: CoarseSpace) -> Vector:
        """Return what a multiplier has too much in some rows for equilibrium, owned. Collective."""
        resultants = self.system.soft_motions.resultants(
            self.problem.coarse.residual(point), point - self.multiplier
        )
        return np.asarray(scaling_factors(self.problem) * (rows @ coarse.transpose(coarse.solve(resultants))))

    def settled(self, residual: Vector) -> tuple[Vector, Vector]:
        """Return r after the motions that fit it best on the free rows, and soft ones of the interface.

        Where all rows counted alike, bodies that soft rows or foundations hold would be bent instead of
        moved. Collective.
        """
        after, moved = self.system.soft_motions.fitted(self.coarse, self.free, residual)
        return after, moved[self.system.inverse.interface]


@dataclass(frozen=True, eq=False)
class Admissible:
    """An admissible multiplier of a Tresca problem.

    `slip_bound`: Ψ of the Tresca problem, owned. It is the given one unless that follows the normal forces of
    a solution and no multiplier within it balances the load: at a load that friction only just resists this
    depends on the solver's tolerance. It is then raised to the computed forces; `unbalanced`: the remaining G
    λ − e, measured in multipliers, relative to ‖λ‖.
    """

    multiplier: Vector
    statuses: Statuses
    slip_bound: Vector
    unbalanced: float


def admissible(
    system: DualSystem, slip_bound: Vector, follows: Marks, multiplier: Vector, residual: Vector
) -> Admissible:
    """Compute an admissible multiplier near a given one. Collective; no product.

    Where the map w = λ − ρ r of the solver indicates open contact, the normal force is set to zero, where it
    indicates slip, friction is set on its circle: a deficit there costs energy of first order, as gap and
    slip are not small. Elsewhere λ is projected on the cone. `follows`: discs whose slip bound follows the
    normal force, owned. That of the others is given and not raised.
    """
    problem, layout = system.problem, system.problem.layout
    step = contact_step(layout, problem.diagonal)
    trial = multiplier - step * residual
    wanted = trial[layout.tangential]
    length = np.linalg.norm(wanted, axis=1)
    softened = problem.compliance.rows_at(trial, step).slip_stiffening
    slip = (slip_bound > 0.0) & (length >= softened * slip_bound)
    start = np.array(multiplier)
    start[layout.normal[trial[layout.normal] <= 0.0]] = 0.0
    start[layout.tangential[slip]] = (slip_bound[slip] / length[slip])[:, None] * wanted[slip]
    stick = (slip_bound > 0.0) & ~slip
    softness = relative_softness(system, multiplier)
    statuses = Statuses(system, trial[layout.normal] > 0.0, stick, slip, start, multiplier, softness)
    feasible = FeasibleSet(layout, slip_bound)
    balanced, left = _balanced(statuses, feasible, start)
    if left > ROUNDING:
        balanced, left = _balanced_by_nearest(problem, feasible, start)
    if left > UNBALANCED and global_max(problem.comm, float(follows.any())):
        endless = FeasibleSet(layout, np.where(follows, ENDLESS, slip_bound))
        balanced, left = _balanced(statuses, endless, start)
        raised = np.maximum(slip_bound, np.linalg.norm(balanced[layout.tangential], axis=1))
        slip_bound = np.where(follows, raised, slip_bound)
    return Admissible(balanced, statuses, slip_bound, left)


def _balanced_by_nearest(problem: DualProblem, feasible: FeasibleSet, start: Vector) -> tuple[Vector, float]:
    """Return the nearest multiplier of the cone in equilibrium, and the remaining G λ − e. Collective.

    Slower than `_balanced` and without its preferences, but it finds a multiplier whenever there is one:
    alternating projections stagnate before they reach a narrow set.
    """
    closest = nearest(problem, feasible, start, ROUNDING * _forces(problem, start))
    return closest, _unbalanced(problem, closest)


def _balanced(
    statuses: Statuses, feasible: FeasibleSet, start: Vector, rounds: int = 100, progress: float = 0.9
) -> tuple[Vector, float]:
    """Return a multiplier of the cone in equilibrium, and the remaining G λ − e. Collective.

    The shortest change of the free multipliers restores equilibrium or, where these do not suffice, of all
    closed ones, or of all; the result is projected on the cone again. Neighbouring contact forces take part:
    gluing forces alone would carry the difference through the bodies, which bends thin ones. Forces across
    open gaps come last, as each costs its gap in energy. `progress`: a round that leaves more than this
    fraction of the imbalance makes no progress.
    """
    problem, point = statuses.problem, feasible.project(start)
    if statuses.system.soft_motions.count:
        point = _restored(statuses, feasible, point, rounds, progress)
    left = _unbalanced(problem, point)
    for rows, coarse in statuses.spaces():
        for _ in range(rounds):
            if left <= ROUNDING:
                return point, left
            point = feasible.project(point - statuses.lacking(point, rows, coarse))
            before, left = left, _unbalanced(problem, point)
            if left > progress * before:
                break
    return point, left


def _restored(
    statuses: Statuses, feasible: FeasibleSet, point: Vector, rounds: int, progress: float
) -> Vector:
    """Return a multiplier of the cone whose resultants on soft motions are nearly those found. Collective.

    Nothing requires that, but soft motions would have to be taken back at the price of their energy.
    """
    problem, left = statuses.problem, np.inf
    for _ in range(rounds):
        lacking = statuses.lacking(point, statuses.free, statuses.coarse)
        point = feasible.project(point - lacking)
        before, left = left, problem.norm(lacking)
        if left <= ROUNDING * _forces(problem, point) or left > progress * before:
            break
    return point


def basis(
    layout: ContactLayout, closed: Marks, stick: Marks, turning: Marks, multiplier: Vector
) -> sp.csr_matrix:
    """Return Z of a face, see `fenics_contact.qp.face.face_basis`, by the directions of friction forces.

    `turning`: discs of which the direction across the friction force is in it.
    """
    tau = multiplier[layout.tangential]
    length = np.linalg.norm(tau, axis=1, keepdims=True)
    direction = np.divide(tau, length, out=np.zeros_like(tau), where=length > 0.0)
    return face_basis(layout, closed, stick, turning, direction)


def _unbalanced(problem: DualProblem, multiplier: Vector) -> float:
    size = _forces(problem, multiplier)
    left = problem.coarse.norm(problem.coarse.residual(multiplier))
    return left / size if size > 0.0 else 0.0


def _forces(problem: DualProblem, multiplier: Vector) -> float:
    """Return the norm of all forces, [force]. Collective."""
    return max(problem.norm(multiplier), problem.coarse.norm(problem.coarse.load))


#: Largest remaining violation relative to the initial one.
UNLIFTED = 1e-9


@dataclass(frozen=True, eq=False)
class Lifted:
    """A correction w of the interface after which all equality rows hold and no contact penetrates.

    `residual`: r after it, owned; zero in the rows that were closed; `multiplier`: estimate −M r of the
    multiplier's error, owned; `left`: remaining violation relative to the initial one; more than rounding
    only if rows are contradictory.
    """

    displacement: Vector
    energy: float
    residual: Vector
    multiplier: Vector
    left: float


def lift(system: DualSystem, known: Admissible, residual: Vector, cancelled: float, start: Vector) -> Lifted:
    """Close the rows that should be closed, and those that would penetrate after the correction. Collective.

    The correction is that of the Dirichlet preconditioner, w = D⁻¹Bᵀ(B D⁻¹Bᵀ)⁻¹ r, with its energy wᵀ S w:
    the preconditioned residual rᵀ M r. The effect of regularising the contact block is corrected at the cost
    of that small block alone; S is applied once, for half an F-product. `cancelled`: norm of the
    displacements that cancel in r; `start`: displacement of the interface that r contains already. Soft rows
    are left as they are.
    """
    comm, tangential = system.problem.comm, system.problem.layout.tangential
    slid = np.linalg.norm(residual[tangential], axis=1)
    step = contact_step(system.problem.layout, system.problem.diagonal)[tangential[:, 0]]
    # Where a slip is short, removing its part across the friction force costs less energy than keeping it.
    statuses = known.statuses
    across = statuses.slip & (step * slid < known.slip_bound)
    sprung = statuses.soft[tangential[:, 0]]
    closed = statuses.closed & ~statuses.soft[system.problem.layout.normal]
    rows = _Rows(system, known, closed, statuses.stick & ~sprung, across & ~sprung)
    closing = _close(rows, residual, cancelled)
    if closing.left > UNLIFTED:  # a node of two pairs may be set to stick where it should close
        nothing = np.zeros_like(across)
        closing = _close(replace(rows, stick=nothing, across=nothing), residual, cancelled)
    displacement = start + closing.displacement
    energy, force = system.inverse.energy(displacement)
    energy = float(global_sum(comm, energy)[0])
    after = closing.residual - closing.rows.spread(closing.rows.wanted(closing.residual))
    estimate = -system.preconditioner.lifting(closing.rows.restriction).multiplier(force)
    return Lifted(displacement, energy, after, estimate, closing.left)


@dataclass(frozen=True, eq=False)
class _Closing:
    """Displacement w that closes rows, r after it, and the remaining violation relative to the start."""

    rows: _Rows
    displacement: Vector
    residual: Vector
    left: float


def _close(rows: _Rows, residual: Vector, cancelled: float, refinements: int = 12) -> _Closing:
    """Close rows, and those that penetrate afterwards. Collective; no application of S."""
    system = rows.system
    comm, w = system.problem.comm, np.zeros(len(system.inverse.interface))
    start = global_max(comm, np.abs(rows.wanted(residual)).max(initial=0.0))
    small = max(UNLIFTED * start, LAST_PLACES * cancelled)
    lifting, current, violation = system.preconditioner.lifting(rows.restriction), residual, start
    for _ in range(refinements):
        w += lifting.jump(rows.spread(rows.wanted(current)))
        current = residual - system.interface_jump(w)
        more = rows.penetrating(current, small)
        violation = global_max(comm, np.abs(rows.wanted(current)).max(initial=0.0))
        if global_sum(comm, np.count_nonzero(more))[0] > 0.0:
            rows = replace(rows, closed=rows.closed | more)
            lifting = system.preconditioner.lifting(rows.restriction)
        elif violation <= small:
            return _Closing(rows, w, current, 0.0)
    return _Closing(rows, w, current, violation / start)


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows that a correction closes: all equality rows and some of contacts.

    `across`: discs whose slip across the friction force is removed, owned. Soft rows are left as they are.
    """

    system: DualSystem
    known: Admissible
    closed: Marks
    stick: Marks
    across: Marks

    @property
    def soft(self) -> Marks:
        """Marks of the rows that are left."""
        return self.known.statuses.soft

    @cached_property
    def restriction(self) -> sp.csr_matrix:
        """Z with orthonormal columns, shape (size, n_face), owned."""
        layout = self.system.problem.layout
        rows = basis(layout, self.closed, self.stick, self.across, self.known.multiplier)
        # The first columns are those of the rows of equality, in their order.
        left = np.flatnonzero(self.soft[layout.equality])
        return rows[:, np.setdiff1d(np.arange(rows.shape[1]), left)] if len(left) else rows

    def wanted(self, residual: Vector) -> Vector:
        """Return Zᵀ r, shape (n_face,)."""
        return np.asarray(self.restriction.T @ residual)

    def spread(self, y: Vector) -> Vector:
        """Return Z y, owned."""
        return np.asarray(self.restriction @ y)

    def penetrating(self, residual: Vector, tolerance: float) -> Marks:
        """Mark contacts that are not closed and penetrate by more than a tolerance."""
        normal = self.system.problem.layout.normal
        return np.asarray(~self.closed & ~self.soft[normal] & (residual[normal] < -tolerance))


@displayed
@dataclass(frozen=True, eq=False)
class Certificate:
    """Bounds of the algebraic error of a state in energy norm, [√(force · length)].

    `bound`: upper bound of ‖u − u⋆‖, also for the continuous displacement of the fields; infinite if no
    admissible pair was found; `moved`: its part due to making the multiplier admissible; `gap`: J(v) − θ(λ)
    of the admissible pair, [force · length]; `error`: estimated error of the state's multiplier, owned.
    """

    bound: float
    moved: float
    gap: float
    known: Admissible
    error: Vector


def certify(system: DualSystem, solution: DualSolution) -> Certificate:
    """Bound the algebraic error of a solution. Collective; at most one product and two applications of S.

    With an admissible multiplier λ (λ_N ≥ 0, ‖τ‖ ≤ Ψ, G λ = e), u = K⁺(f − Bᵀλ) + R α, and an admissible
    displacement v = u + w, at given slip bounds

        J(v) − θ(λ) = ½ wᵀK w + Σ λ_N (c − B v)_N + Σ (Ψ‖s‖ − τ·s),   s the slip of v,

    a sum of non-negative terms, and J(v) − θ(λ) ≥ ½‖v − u⋆‖² + ½‖u − u⋆‖² in energy norm, u⋆ being the
    solution. So u⋆ is in the ball around the midpoint u + ½w of radius ½√(4 gap − ‖w‖²), and no displacement
    x is farther from it than ‖x − u − ½w‖ + ½√(4 gap − ‖w‖²). The bound is for the farther of two
    displacements: u, and that of the fields, in which copies of nodes agree (`DualSystem.conforming`). The
    change δ that made the multiplier admissible counts with its own energy δᵀF δ.

    The correction w is that of the preconditioner, whose quality determines the sharpness: mostly a factor of
    two, for nearly incompressible bodies, thin plates and stiff bodies on soft ones ten to thirty.

    Where surfaces give way by C(λ), the terms of the sum are φ(δ) + Φ(λ) − λδ with Φ' = C, its conjugate φ
    and the closure or elastic slip δ of v, see `qp.face.ContactLaw.surplus`. Rows that give way more than
    bodies are not closed: they keep their lengths in v, rows of equality at the energy ½ (B v − c − C λ)² /
    C. Bodies that such rows or foundations hold are moved before they are bent, v = u + R β + w, and forces
    on them are changed less than others.

    The bound is for Tresca's problem with the slip bounds of the solution. Where these are given, that is the
    actual problem; and it is infinite where no multiplier within them balances the load. Where they follow
    the normal forces it does not bound the distance to the solution of Coulomb's law, see `friction_error`
    for the rest; and where they are too small for the load, Tresca's problem has no solution and they are
    raised, see `Admissible`.

    It holds to rounding: energies and products are in double precision, rows that are closed to 1e-9 of their
    initial violation count as closed, and a load that is balanced to 1e-9 as balanced.

    References:
        W. Prager, J. L. Synge, Approximations in elasticity based on the concept of function space, Quart.
        Appl. Math. 5 (1947). S. Repin, A posteriori estimates for partial differential equations, de Gruyter
        2008, chapter 3.
    """
    problem, residual, moved = system.problem, solution.residual, 0.0
    follows = system.torn.law.growth(solution.multiplier) > 0.0
    known = admissible(system, solution.slip_bound, follows, solution.multiplier, residual)
    gives_way = known.statuses.gives_way
    if gives_way:  # how bodies have slid is known after they have moved
        given_way = problem.compliance.given_way(known.multiplier)
        trial, _ = known.statuses.settled(residual + given_way)
        known = admissible(system, solution.slip_bound, follows, solution.multiplier, trial - given_way)
    statuses, start = known.statuses, np.zeros(len(system.inverse.interface))
    change = known.multiplier - solution.multiplier
    moves = problem.norm(change) > LAST_PLACES * problem.norm(solution.multiplier)
    if moves:
        product = system.apply(change)
        moved = float(np.sqrt(max(problem.dot(change, product), 0.0)))
        residual = residual + product
    residual = residual + problem.compliance.given_way(known.multiplier)
    if moves or gives_way:
        residual, start = statuses.settled(residual)
    lifted = lift(system, known, residual, _cancelled(problem, solution), start)
    feasible = FeasibleSet(problem.layout, known.slip_bound)
    rest = problem.compliance.surplus(feasible, known.multiplier, lifted.residual)
    rest = float(global_sum(problem.comm, rest + _stretched(problem, statuses.soft, lifted.residual))[0])
    gap = 0.5 * lifted.energy + rest
    radius = 0.5 * float(np.sqrt(lifted.energy + 4.0 * rest))
    bound = max(_distances(system, solution, lifted)) + radius + moved
    if lifted.left > UNLIFTED or known.unbalanced > UNBALANCED:
        bound = np.inf
    return Certificate(bound, moved, gap, known, change + lifted.multiplier)


def _distances(system: DualSystem, solution: DualSolution, lifted: Lifted) -> tuple[float, float]:
    """Return the distances from u + ½w of the computed displacement and of that of the fields. Collective."""
    energy, _ = system.inverse.energy(system.sewn(solution.residual) - 0.5 * lifted.displacement)
    shown = float(np.sqrt(global_sum(system.problem.comm, energy)[0]))
    return 0.5 * float(np.sqrt(lifted.energy)), shown


def direct_error(system: DirectSystem, solution: DirectSolution) -> float:
    """Return the energy norm of the error of a factorisation, √(rᵀK⁻¹r), [√(force · length)]."""
    return float(np.sqrt(max(system.energy_of_residual(solution.displacement), 0.0)))


def _cancelled(problem: DualProblem, solution: DualSolution) -> float:
    """Return the norm of the displacements that cancel in r. Collective."""
    moved = np.abs(solution.product - problem.rhs).max(initial=0.0)
    return global_max(problem.comm, max(moved, np.abs(problem.rhs).max(initial=0.0)))


def relative_softness(system: DualSystem, multiplier: Vector) -> Vector:
    """Return how much more each row gives way than the bodies there, owned. Collective.

    Where it is more than one, closing rows would deform bodies rather than springs.
    """
    problem, given = system.problem, system.problem.compliant
    own = problem.compliance.softness(multiplier)
    own[given.rows] = given.compliance
    most = global_max(problem.comm, system.flexibility.max(initial=0.0))  # rows of tools move no body
    return np.asarray(own / np.where(system.flexibility > 0.0, system.flexibility, most))


def _stretched(problem: DualProblem, soft: Marks, residual: Vector) -> float:
    """Return Σ ½ r² / C of this rank's soft rows of equality, the energy between length and force."""
    given = problem.compliant
    mine = soft[given.rows]
    return float(0.5 * (residual[given.rows[mine]] @ (residual[given.rows[mine]] / given.compliance[mine])))
