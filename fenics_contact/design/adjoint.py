"""The adjoint of the contact problem on a branch of the contact law, and the errors that it weighs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import Task
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._scene.plan import MOTION_ROUNDING
from fenics_contact._surfaces.facets import edge_distance
from fenics_contact.design.objective import Partials
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.feti.averages import nodal_mean_transposed
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.cones import FeasibleSet
from fenics_contact.qp.face import STEEP, Face, classify
from fenics_contact.qp.face_system import CoupledSystem, FaceSystems
from fenics_contact.qp.krylov import Stop, projected_gmres
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.problem import CountedOperator, DualProblem
from fenics_contact.qp.reductions import global_sum
from fenics_contact.qp.solution import apply_unless_zero
from fenics_contact.results.contact import RowValues
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State


class WeakChoice(Enum):
    """The branch that all weakly active points are given.

    Each branch of each point is an element of the limiting coderivative of its contact law, and the adjoint
    of a choice is an element of the inclusion for coderivatives of a composition. With a single weak point
    either branch gives a Clarke subgradient. With several it need not: nearby designs may close some points
    only while others open, so that no design has all of them open, or all closed.
    """

    RELEASED = "weak contacts count as open, weak discs as slipping"
    HELD = "weak contacts count as closed, weak discs as sticking"


@dataclass(frozen=True)
class WeakPoints:
    """Numbers of points on a switch of the contact law, to the accuracy of the state, over all ranks.

    `discs`: friction discs at their bound without slip; `edges`: closed points that project on an edge
    between facets; they count as inside the facet they project on; `choice`: the branch that contacts and
    discs were given. Those of an inaccurate state that are probably on one side are assigned to that side.
    """

    contacts: int
    discs: int
    edges: int
    choice: WeakChoice

    @classmethod
    def joined(cls, several: Sequence[WeakPoints]) -> WeakPoints:
        """Return the weak points of several states together."""
        counts = ((each.contacts, each.discs, each.edges) for each in several)
        contacts, discs, edges = (sum(column) for column in zip(*counts, strict=True))
        return cls(contacts, discs, edges, several[0].choice)

    @property
    def count(self) -> int:
        """Number of all weak points."""
        return self.contacts + self.discs + self.edges

    @property
    def may_be_invalid(self) -> bool:
        """Whether the derivative may not be a subgradient: no nearby design may have all these branches.

        Where one weak contact closes, its friction may slip: only that single point must not be held.
        """
        return self.count > 1 or (self.contacts > 0 and self.choice is WeakChoice.HELD)


@displayed
@dataclass(frozen=True, eq=False)
class LinearisedFace:
    """Face of a state with the two bases of its linearised contact law.

    `tested`: Z_s, test directions of the rows; `moving`: Z_u, directions along which the multiplier varies: a
    slipping friction force grows with its normal force by μ d; `slip_direction`: d at the slipping discs,
    zero elsewhere, owned; `growing`: discs whose force grows with its normal force, owned.
    """

    face: Face
    tested: sp.csr_matrix
    moving: sp.csr_matrix
    slip_direction: np.ndarray
    growing: np.ndarray
    weak: WeakPoints


def linearise_face(state: State, choice: WeakChoice) -> LinearisedFace:
    """Classify the contact points of a state and build both bases. Collective."""
    torn, rows = state.torn, state.rows
    layout, bound, step = torn.layout, rows.slip_bound, rows.step
    trial = rows.multiplier - step * rows.residual
    coefficient = torn.law.growth(rows.multiplier)
    length = np.linalg.norm(trial[layout.tangential], axis=1)
    # Two slacks: every point that may be weak is counted, but only one that leans to no side is reassigned.
    uncertainty, closest = _uncertainty(torn.decomposition.comm, rows)
    reached = bound
    if torn.groups.slips.is_elastic:
        elastic = torn.groups.slips.elastic_slip[torn.owned_discs]
        reached = bound * (1.0 + step[layout.tangential[:, 0]] * elastic)
    counted = _on_switch(layout, trial, reached, coefficient, uncertainty)
    weak = _on_switch(layout, trial, reached, coefficient, closest)

    known = classify(layout, bound, rows.multiplier, rows.residual, step, torn.compliance.contact)
    direction = _directions(known.direction, trial[layout.tangential], length, weak.disc | weak.vanishing)
    held, at_rest = choice is WeakChoice.HELD, length <= closest[layout.tangential[:, 0]]
    face = replace(
        known,
        closed=np.where(weak.contact, held, known.closed),
        stick=np.where(weak.vanishing, held & at_rest, np.where(weak.disc, held, known.stick)),
        slip=~weak.vanishing & np.where(weak.disc, not held, known.slip),
        direction=direction,
        overshoot=np.where(weak.disc, 1.0, known.overshoot),
    )
    starting = weak.vanishing & held & ~at_rest
    tested, growing = face.restriction, face.slip | starting
    moving = tested + growth_of(face, growing, coefficient)
    slip_direction = np.where(face.slip[:, None], direction, 0.0)
    contacts, discs = torn.decomposition.comm.allreduce(counted.counts)
    points = WeakPoints(int(contacts), int(discs), _points_on_edges(state), choice)
    return LinearisedFace(face, tested, moving.tocsr(), slip_direction, growing, points)


@dataclass(frozen=True)
class _OnSwitch:
    """Marks of this rank's points that lie on a switch.

    `contact`: neither force nor gap; `vanishing`: discs whose radius vanishes with the normal force of such a
    contact; `disc`: other discs at their bound without slip.
    """

    contact: np.ndarray
    vanishing: np.ndarray
    disc: np.ndarray

    @property
    def counts(self) -> np.ndarray:
        """Number of contacts and of discs."""
        return np.array([np.count_nonzero(self.contact), np.count_nonzero(self.disc)])


def _on_switch(
    layout: ContactLayout, trial: np.ndarray, bound: np.ndarray, coefficient: np.ndarray, slack: np.ndarray
) -> _OnSwitch:
    """Return which points are within their slack, [force], of a switch."""
    contact = np.abs(trial[layout.normal]) <= slack[layout.normal]
    vanishing = contact[layout.friction_of] & (coefficient > 0)
    beyond = np.linalg.norm(trial[layout.tangential], axis=1) - bound
    disc = (bound > 0) & ~vanishing & (np.abs(beyond) <= slack[layout.tangential[:, 0]])
    return _OnSwitch(contact, vanishing, disc)


def _uncertainty(
    comm: MPI.Comm, rows: RowValues, leaning: float = 1e-5, residual_share: float = 3.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance from a switch beyond which a point's side is certain, owned, [force]. Collective.

    It is the uncertainty of λ − ρ r due to the residuals of the state, with ρ the step: those of the contact
    law are forces already, jumps between subdomains become forces as slips and gaps do. Returns the distance,
    and that below which a point of an inaccurate state is assigned to no side, shapes (size,). `leaning`:
    weak points further from the switch than this fraction of the forces are assigned to the closer side;
    `residual_share`: a contact point is weakly active if it is closer to a switch of the contact law than
    this many residuals.
    """
    residuals = rows.residuals
    forces, jumps = residuals.natural * residuals.force_scale, residuals.gluing * residuals.gluing_scale
    moved = np.where(rows.between_supports, 0.0, rows.step * rows.opening)  # none changes the others
    squares = [float(global_sum(comm, x @ x)[0]) for x in (rows.multiplier, moved)]
    rounding = ROUNDING * float(np.sqrt(max(squares)))
    uncertainty = np.asarray(residual_share * (forces + rows.step * jumps) + rounding)
    return uncertainty, np.minimum(uncertainty, leaning * residuals.force_scale + rounding)


def _points_on_edges(state: State, edge_tolerance: float = 1e-6) -> int:
    """Count the closed points over an edge of their master facet, where the normal field has a kink.

    Points of mortar contact represent a mean over facets and lie on none. `edge_tolerance`: a projection
    within this distance of a facet's edge, in local coordinates, counts as on the edge.
    """
    points = state.torn.points
    total = 0
    for index, pair in enumerate(state.scene.contacts):
        for master in pair.surfaces[1:]:
            closed = (points.pair == index) & (points.facet >= 0) & (state.contact.normal_force > 0)
            corners = state.scene.facets(master).shape[1]
            distance = np.abs(edge_distance(points.local[closed], corners))
            total += int(np.count_nonzero(distance < edge_tolerance))
    return total


def growth_of(face: Face, growing: np.ndarray, coefficient: np.ndarray) -> sp.csr_matrix:
    """Return the growth of slipping forces with their normal forces, and that of incipient ones.

    A Coulomb disc has zero radius where its contact is weak. When the contact closes, its force grows along
    the slip: it has a direction but no offset, hence no column of its own; such columns come last.
    """
    return replace(face, slip=growing).growth(coefficient)[:, : face.n_face]


def _directions(known: np.ndarray, trial: np.ndarray, length: np.ndarray, weak: np.ndarray) -> np.ndarray:
    directions = trial / np.where(length > 0, length, 1.0)[:, None]
    return np.where(weak[:, None], directions, known)


class NoAdjointError(ConvergenceError):
    """The face of a state does not determine an adjoint: some body can slide on it."""

    @classmethod
    def of_loose_body(cls) -> NoAdjointError:
        """Return the error where a face does not hold every body."""
        return cls(
            "the adjoint needs a contact face that holds every body, but from this state some body can slide "
            "without resistance: refine the contact until more points hold it, add a support, choose "
            "WeakChoice.HELD where points are weakly active, or take a design away from this one"
        )


@displayed
@dataclass(frozen=True, eq=False)
class Adjoint:
    """Solution of the adjoint system.

    Attributes:
        displacement: w on this rank's torn dofs.
        multiplier: ζ = Z_s z, owned.
        motions: β, coefficients of the rigid motions in w, shape (m,), replicated.
        iterations: Krylov iterations, each one F-product.
    """

    displacement: np.ndarray
    multiplier: np.ndarray
    motions: np.ndarray
    iterations: int


def solve_adjoint(
    state: LinearState,
    partials: Partials,
    linearised: LinearisedFace,
    *,
    tolerance: float = 1e-9,
    max_iterations: int = 500,
    start: np.ndarray | None = None,
) -> Adjoint:
    """Solve the transpose of the linearised state equations. Collective.

    With the bases Z_s (test) and Z_u (trial) of the state's face and the curvature κ of slipping discs,

        K w + Bᵀ Z_s z = ∂J/∂u,      Z_uᵀ B w − κ z = Z_uᵀ ∂J/∂λ.

    Eliminating w leaves (Z_uᵀ F Z_s + κ) z − (G Z_u)ᵀ β = Z_uᵀ (B K⁺ ∂J/∂u − ∂J/∂λ) under G Z_s z = Rᵀ ∂J/∂u,
    the system of a Newton step with its two bases swapped.

    Everything is linear in the objective, also the start and the scale of the residual: rescaling the
    objective rescales the adjoint, to rounding. It starts from a multiple of the multiplier of the state, and
    one of `start`, owned, in any scaling: what else the adjoint of the same objective had at a state nearby.
    """
    system = state.dual
    followed = state.torn.decomposition.on_followed(partials.by_displacement)
    partials = replace(partials, by_displacement=followed)
    _require_held(system, partials.by_displacement)
    problem, face, factor = _scaled(system.problem, linearised.face)
    task = Task("adjoint", unit="products")
    operator = CountedOperator(problem.operator, lambda products, _: task.step(products))
    face_system = FaceSystems(problem, operator).build(face)
    transposed = CoupledSystem.build(
        face_system,
        problem.coarse,
        linearised.moving,
        linearised.tested,
        curvature=face_system.face.curvature,
        damped=True,
    )
    if transposed is None:
        raise NoAdjointError.of_loose_body()
    flexed = system.inverse(partials.by_displacement)
    # Rows that supports alone determine have no force, whatever an objective makes of it.
    entries = system.torn.numbering.to_owned(np.asarray(abs(system.torn.B).sum(axis=1)).ravel())
    by_multiplier = np.where(entries > 0.0, partials.by_multiplier, 0.0)
    right = linearised.moving.T @ (factor * (system.jump(flexed) - by_multiplier))
    load = np.asarray(problem.comm.allreduce(system.kernel.resultants(partials.by_displacement)))
    points = system.points
    load += points.T @ np.broadcast_to(partials.by_motion, points.shape[0])
    # At a minimum of the energy without slip the adjoint multiplier is minus the multiplier itself.
    guesses = [state.solution.multiplier, *([] if start is None else [start])]
    guesses = [linearised.tested.T @ (guess / factor) for guess in guesses]
    begin = _begin(problem, transposed, right, load, guesses)
    weights = np.ones(len(right))
    small = max(tolerance * begin.size, begin.rounding)
    point, gradient, iterations, exact = begin.point, begin.gradient, 0, problem.exact
    with task:
        while True:
            solved = projected_gmres(transposed, gradient, weights, small, max_iterations - iterations)
            point, iterations = point + solved.step, iterations + solved.iterations
            gradient = gradient + transposed.operate(solved.step, solved.product)
            if exact is None or solved.stop is not Stop.CONVERGED or iterations >= max_iterations:
                break
            # Products in single precision: what their rounding leaves is solved for again.
            gradient = transposed.operate(point, apply_unless_zero(problem, exact, transposed.moving @ point))
            gradient = gradient - right
            if problem.norm(transposed.oblique(gradient)) <= 10.0 * small:
                break
    if solved.stop is not Stop.CONVERGED:
        # Of a load outside the range of a singular operator rounding decides which of both is found.
        singular = solved.stop in (Stop.NO_CURVATURE, Stop.STAGNATION)
        raise (NoAdjointError if singular else ConvergenceError)(
            f"the adjoint needs a relative residual below {small / (begin.size or 1.0):.1e}, reached "
            f"{solved.measure / (begin.size or 1.0):.1e} after {iterations} iterations "
            f"({solved.stop.value}): raise max_iterations or loosen the tolerance"
        )
    multiplier = factor * (linearised.tested @ point)
    beta = transposed.oblique.coefficients(gradient)
    displacement = system.inverse(partials.by_displacement - system.force(multiplier)) + system.kernel @ beta
    return Adjoint(displacement, multiplier, beta, iterations)


@dataclass(frozen=True, eq=False)
class _Begin:
    """The start of the iteration.

    `point`: z; `gradient`: residual of the equations there; `size`: norm of the projected residual due to the
    objective alone, independent of the guess; `rounding`: norm of what rounding leaves of a residual that the
    projection removes.
    """

    point: np.ndarray
    gradient: np.ndarray
    size: float
    rounding: float


def _begin(
    problem: DualProblem,
    transposed: CoupledSystem,
    right: np.ndarray,
    load: np.ndarray,
    guesses: Sequence[np.ndarray],
) -> _Begin:
    """Return the shortest z that balances the load plus those multiples of guesses that fit best together.

    Guesses have their own units (forces, or those of another objective), so their factors are computed.
    Collective; one product each for load and guesses.
    """

    def image(z: np.ndarray) -> np.ndarray:
        return transposed.operate(z, apply_unless_zero(problem, problem.operator, transposed.moving @ z))

    bearing = transposed.balanced(np.zeros_like(right), load)
    point, borne = bearing, image(bearing)
    gradient = borne - right
    rest = transposed.oblique(gradient)
    size = max(problem.norm(transposed.oblique(right)), problem.norm(rest))
    largest, used = max(problem.norm(right), problem.norm(borne)), list[tuple[np.ndarray, ...]]()
    for guess in guesses:
        direction = transposed.balanced(guess, np.zeros_like(load))
        turned = image(direction)
        along = transposed.oblique(turned)
        for earlier in used:  # the residuals that guesses leave are orthogonal to what earlier ones change
            share = problem.dot(earlier[-1], along) / problem.dot(earlier[-1], earlier[-1])
            new = zip((direction, turned, along), earlier, strict=True)
            direction, turned, along = (one - share * other for one, other in new)
        square = problem.dot(along, along)
        if square > 0.0:
            share = -problem.dot(along, rest) / square
            point, gradient, rest = point + share * direction, gradient + share * turned, rest + share * along
            largest = max(largest, problem.norm(share * turned))
            used.append((direction, turned, along))
    return _Begin(point, gradient, size, ROUNDING * largest)


def _require_held(system: DualSystem, by_displacement: np.ndarray) -> None:
    """Reject objectives that change along motions that nothing resists. Collective.

    Such motions are fixed by convention, not by the state, and how the convention changes with the shape is
    not part of the adjoint.
    """
    work = system.unheld.T @ by_displacement
    size = abs(system.unheld).T @ np.abs(by_displacement)
    work, size = system.problem.comm.allreduce(np.stack([work, size]))
    if np.any(np.abs(work) > MOTION_ROUNDING * size):
        raise ConvergenceError(
            "objectives must not change along free motions (`State.unheld`), this one does: add a support"
        )


def _scaled(problem: DualProblem, face: Face) -> tuple[DualProblem, Face, np.ndarray | float]:
    """Return problem and face in multipliers scaled by stiffness, and the factors, see `Scaling`.

    The factors are uniform within a contact point, so that both bases of a face are unchanged.
    """
    scaling = problem.scaling
    return problem.scaled_problem, scaling.of_face(face), scaling.factor


def require_from_rest(state: State) -> None:
    """Check that friction of a state does not depend on other states."""
    if state.contact.slip_before[state.torn.frictional].any():
        raise InvalidInputError(
            "a state differentiated alone must be one step from rest, got slip of earlier steps: use LoadPath"
        )


def on_owned(torn: TornSystem, rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values in some rows of B, replicated, as an owned vector that is zero in all other rows."""
    result, position = np.zeros(len(torn.numbering.owned)), torn.numbering.owned_index(rows)
    result[position[position >= 0]] = values[position >= 0]
    return result


def with_slips(state: State, own: Partials, by_slip: np.ndarray) -> Partials:
    """Return the derivatives of an objective that depends on the slips of points, too. Collective.

    `by_slip`: derivative by the slips of all points in their tangents, replicated, shape (n_points, dim − 1).
    They are without the elastic slip of the step.
    """
    torn, alone = state.torn, state.torn.groups.slips.frictionless
    rows = on_owned(torn, torn.tangential_rows.ravel(), by_slip[torn.frictional].ravel())
    own = with_jumps(state, own, rows)
    by_displacement = own.by_displacement
    if np.any(by_slip[alone]):  # these have no rows
        jump = torn.points.jump[alone]
        forces = np.einsum("na,nad->nd", by_slip[alone], torn.points.tangents[alone])
        nodes = np.unique(jump.indices)
        turned = nodal_mean_transposed(torn.decomposition, nodes, jump[:, nodes].T @ forces)
        by_displacement = by_displacement + turned
    return replace(
        own,
        by_displacement=by_displacement,
        by_multiplier=own.by_multiplier - torn.compliance.contact.sprung(rows),
        by_area=own.by_area - slips_by_area(torn, state.solution.multiplier, rows),
        by_sliding=own.by_sliding + by_slip[alone],
    )


def with_jumps(state: State, own: Partials, rows: np.ndarray) -> Partials:
    """Return the derivatives of an objective that depends on B u − c, too, by `rows`, owned. Collective."""
    torn = state.torn
    moved = -np.asarray(torn.decomposition.comm.allreduce(torn.free.columns.T @ rows))
    return replace(
        own,
        by_displacement=own.by_displacement + torn.force(rows),
        by_jump=own.by_jump + rows,
        by_motion=own.by_motion + moved,
    )


def slips_by_area(torn: TornSystem, multiplier: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return weight · ∂(D τ)/∂A of elastic slips by the areas of points, replicated, (n,). Collective."""
    result, slips = np.zeros(torn.points.count), torn.groups.slips
    if slips.is_elastic:
        width = torn.components - 1
        tau, by_slip = (torn.gathered(x, slips).reshape(-1, width) for x in (multiplier, weight))
        area = torn.points.area[slips.frictional]
        result[slips.frictional] = -slips.elastic_slip / area * np.einsum("na,na->n", tau, by_slip)
    return result


class Coupling(ABC):
    """A part of the contact law that the solver of a state holds, and that follows what it finds.

    The adjoint at held parts gives derivatives of the objective by them. The parts depend on slips, and so
    does the objective in turn, by the derivatives times slopes y: `read` returns y, `following` adds what it
    means.
    """

    def begun(self, partials: Partials) -> Partials:
        """Return the derivatives with those through what the part makes of forces and areas. Collective."""
        return partials

    @abstractmethod
    def read(self, partials: Partials, adjoint: Adjoint) -> np.ndarray:
        """Return y of the points whose part changes with the slip, replicated. Collective."""

    @abstractmethod
    def following(self, partials: Partials, y: np.ndarray) -> Partials:
        """Return the derivatives with what y adds, along the slips. Collective."""

    def ended(self, partials: Partials, adjoint: Adjoint) -> Partials:
        """Return the derivatives with those by the places of nodes. Collective."""
        return partials


@dataclass(frozen=True, eq=False)
class LaterSteps:
    """How the objectives of all later steps depend on what a step leaves behind: not at all by default.

    `by_position`: derivative by the relative tangential displacements after the step, replicated, (n_points,
    dim − 1); `by_worn`: by the depth that has been worn off, replicated, (n_points,).
    """

    by_position: np.ndarray
    by_worn: np.ndarray

    @classmethod
    def none(cls, state: State) -> LaterSteps:
        """Return those of the last step."""
        return cls(
            np.zeros((state.torn.points.count, state.torn.components - 1)), np.zeros(state.torn.points.count)
        )

    def added(self, state: State, own: Partials) -> Partials:
        """Return the derivatives of a step's objective with what all later steps add. Collective."""
        return with_slips(state, replace(own, by_worn=own.by_worn + self.by_worn), self.by_position)

    def before(self, state: State, whole: Partials, adjoint_multiplier: np.ndarray) -> LaterSteps:
        """Return what a step, of which these are the later ones, adds to the step before. Collective.

        `whole`: derivatives of this step with those of later ones. The slip B u − c enters the contact law
        with the adjoint's multiplier ζ, and objectives, but later ones depend on B u alone: the derivative by
        c is ζ − ∂J/∂(B u − c), and so is the one by gaps. Depth that was lost is part of all later depths.
        """
        torn, by_origin = state.torn, self.by_position.copy()
        by_right = adjoint_multiplier - whole.by_jump
        rows = torn.gathered(by_right, torn.groups.slips)
        by_origin[torn.frictional] += rows.reshape(-1, torn.components - 1)
        by_origin[torn.groups.slips.frictionless] -= whole.by_sliding
        return LaterSteps(by_origin, torn.gathered(by_right, torn.groups.normal) + whole.by_worn)


@dataclass(frozen=True)
class StateError:
    """First-order error of an objective at an inexact state, units of the objective.

    `correction`: difference of the value at the exact state, to first order; `spread`: √Σ (share of a row or
    disc)², which does not vanish where shares of both signs cancel.
    """

    correction: float
    spread: float

    @property
    def size(self) -> float:
        """Estimated error of the corrected value, safe as it is of first order and the true one of second.

        Not a bound: a state so inaccurate that it lies on another face can be further off.
        """
        return abs(self.correction) + self.spread


def state_error(
    state: State,
    partials: Partials,
    linearised: LinearisedFace,
    adjoint: Adjoint,
    unbalanced: np.ndarray,
) -> StateError:
    """Return the effect of a state's residuals on the objective. Collective; no product.

    The state is u = K⁺(f − Bᵀλ) + R α. Its residuals are r = −(B u − c) along the test directions of the
    face, to which a slipping disc adds κ s, with the part s of its force across the slip: there the law
    requires r + κ s = 0 (`Face.curvature`); the balance G λ − e of the bodies; and n = λ − P_Λ(λ − ρ r) off
    the face, where the law prescribes the multiplier, λ at points that the face has open. One step of
    Newton's method on the face would remove all of it; along it the objective changes by

        δJ = ζᵀ r + zᵀ κ s − βᵀ(G λ − e) − (∂J/∂λ − B w)ᵀ n_off,

    with the adjoint w, ζ = Z_s z and β. The error of J + δJ is of second order, as long as the face is the
    right one.

    References:
        R. Becker, R. Rannacher, An optimal control approach to a posteriori error estimation in finite
        element methods, Acta Numer. 10 (2001) 1-102. M. B. Giles, E. Süli, ibid. 11 (2002) 145-236.
    """
    torn, rows, layout = state.torn, state.rows, state.torn.layout
    trial = rows.multiplier - rows.step * rows.residual
    feasible = FeasibleSet(layout, rows.slip_bound)
    miss = rows.multiplier - torn.compliance.contact.resolve(feasible, trial, rows.step)
    miss[layout.normal] = rows.multiplier[layout.normal]
    slope = partials.by_multiplier - torn.jump(adjoint.displacement)
    tested = rows.residual + _bent(linearised, rows.multiplier)
    shares = adjoint.multiplier * tested - slope * _off_face(miss, linearised, layout)
    discs = shares[layout.tangential].sum(axis=1)
    single = np.concatenate([shares[layout.equality], shares[layout.normal], discs])
    total, squares = torn.decomposition.comm.allreduce(np.array([single.sum(), single @ single]))
    return StateError(float(total - unbalanced.sum()), float(np.sqrt(squares + unbalanced @ unbalanced)))


def _bent(linearised: LinearisedFace, multiplier: np.ndarray) -> np.ndarray:
    """Return κ s across the slip of slipping discs and what rows give way, zero in all others, owned."""
    face = linearised.face
    return np.asarray(face.prolong(face.bent(face.restrict(multiplier))))


def _off_face(miss: np.ndarray, linearised: LinearisedFace, layout: ContactLayout) -> np.ndarray:
    """Return n where contacts are open, discs are pinned, and along the force of slipping discs, owned.

    Where discs slip too far to turn within a step, the face prescribes the force across the slip, too.
    """
    face, direction = linearised.face, linearised.slip_direction
    off = np.zeros_like(miss)
    off[layout.normal] = np.where(face.closed, 0.0, miss[layout.normal])
    tangential = miss[layout.tangential]
    along = np.einsum("ia,ia->i", tangential, direction)[:, None] * direction
    slipping = np.where((face.slip & (face.overshoot <= STEEP))[:, None], along, tangential)
    off[layout.tangential] = np.where(face.stick[:, None], 0.0, slipping)
    return off
