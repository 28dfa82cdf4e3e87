"""Is an answer right? Every law recomputed on whole bodies, from displacements and contact forces alone."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from fenics_contact import (
    ClosureTable,
    Coulomb,
    ExponentialClosure,
    FrictionTable,
    LinearClosure,
    Scene,
    Tresca,
)
from fenics_contact._pairing.points import ContactPoints
from fenics_contact.results.deformed_state import AnyState
from tools.random_scenes.generator import Sample
from tools.random_scenes.kinematics import misplaced
from tools.random_scenes.whole import Whole, rigid_motions

#: Below this part of what cancels a figure is rounding.
ROUNDING = 1e-13
#: Beyond this an answer is wrong, however loosely it was asked for.
MOST = 0.05


@dataclass(frozen=True)
class Violations:
    """By how much an answer breaks the laws.

    Attributes:
        balance: Forces and moments on bodies along motions that nothing resists, relative to their parts.
        equilibrium: Error in energy norm that would make up for the unbalanced forces of single nodes.
        supports: Distance from prescribed displacements, relative to the largest displacement.
        ties: Jump between tied surfaces, relative to the largest displacement.
        penetration: Relative to the largest displacement and gap.
        tension: Relative to the largest contact force.
        complementarity: Σ λ_N gap, relative to the same forces and lengths.
        cone: Friction beyond its bound, relative to the largest contact force.
        friction: What friction does not oppose of the slip, Σ (Ψ ‖s‖ − τ·s), as complementarity.
        energy: Between the strain energy that the state tells and that of its displacement.
    """

    balance: float = 0.0
    equilibrium: float = 0.0
    supports: float = 0.0
    ties: float = 0.0
    penetration: float = 0.0
    tension: float = 0.0
    complementarity: float = 0.0
    cone: float = 0.0
    friction: float = 0.0
    energy: float = 0.0


def complaints(state: AnyState, made: Sample) -> list[str]:
    """Say everything that is wrong with an answer; nothing if it is right."""
    if made.plain is not None:
        state = TurnedBack(state, made.plain, made.turn)  # type: ignore[assignment]
    whole = Whole(state.scene)
    points = state.contact.points
    if whole.components > whole.dim:  # what slips around the axis is no matter of places
        points = replace(points, normal=points.normal[:, :2], tangents=points.tangents[:, :1, :2])
    found = list(misplaced(whole, points, list(state.scene.contacts)))
    if found:
        return found
    figures, limit = violations(state, whole, made.tolerance), allowed(state, made.tolerance)
    broken = {field.name: getattr(figures, field.name) for field in fields(figures)}
    return [f"{name} {value:.1e}" for name, value in broken.items() if not value <= limit]


class TurnedBack:
    """A state as it would be in the scene before this was turned."""

    def __init__(self, state: AnyState, plain: Scene, turn: np.ndarray) -> None:
        self._state, self._turn, self.scene = state, turn, plain
        self.contact = replace(state.contact, points=self._unturned(state.contact.points))
        self.torn = SimpleNamespace(ties=self._unturned(state.torn.ties))

    def _unturned(self, points: ContactPoints) -> ContactPoints:
        return replace(points, normal=points.normal @ self._turn, tangents=points.tangents @ self._turn)

    def gather_displacement(self, name: str) -> np.ndarray:
        """Return displacements of the nodes of a body, (n_nodes, dim)."""
        return np.asarray(self._state.gather_displacement(name) @ self._turn)

    def __getattr__(self, name: str) -> Any:
        """Return what turning does not change."""
        return getattr(self._state, name)


def allowed(state: AnyState, tolerance: float | None) -> float:
    """Return what figures may be: what tolerance and errors that the state tells explain, 5 % at most.

    The tolerance holds for torn bodies. That whole ones are less exact where they are thin, nearly
    incompressible or held by little is told by the bound of the solver's error.
    """
    if tolerance is None:
        return MOST
    told = state.estimate_errors().algebraic + state.estimate_errors().friction
    return min(MOST, 1e3 * max(tolerance, told if np.isfinite(told) else 0.0))


def violations(state: AnyState, whole: Whole, tolerance: float | None) -> Violations:
    """Recompute everything."""
    contact, points = state.contact, state.contact.points
    u = np.concatenate([state.gather_displacement(name) for name in state.scene.bodies])
    gap_after = points.gap + np.einsum("nd,nd->n", points.jump @ u, points.normal)
    gap_after += _given_way(state)
    slip = np.einsum("nad,nd->na", points.tangents, points.jump @ u) - _sprung(state)
    slip = _undetermined(points, whole, slip)
    bound = _bounds(state)
    on_nodes = points.jump.T @ contact.force
    balance, error, strain = _equilibrium(state, whole, u, on_nodes, tolerance)
    moved = np.abs(u).ravel()
    settled = 10.0 * (1e-6 if tolerance is None else tolerance)
    cancelling = float(moved @ (abs(whole.K) @ moved))
    scale = strain + float(np.sum(np.abs(whole.load) * _yielding(whole))) + settled**2 * cancelling
    normal, tau = contact.normal_force, contact.friction_force
    speed, size = np.linalg.norm(slip, axis=1), np.linalg.norm(tau, axis=1)
    far = ROUNDING * np.abs(whole.points).max()
    length = max(np.abs(u).max(), np.abs(points.gap).max(initial=0.0), _yielding(whole).max(), far)
    force = _force(whole, u, contact.force)
    prescribed = ~whole.free
    open_ = moving(points, whole)
    pen = np.where(open_, -gap_after, 0.0).max(initial=0.0) - far
    # A bound far above all forces says only that a point sticks: its slip is measured, not the bound's work.
    unopposed = np.minimum(bound, np.maximum(size, force)) * speed - (tau * slip).sum(axis=1)
    jump = _tie_jumps(state, u, whole)
    return Violations(
        balance=balance,
        equilibrium=float(np.sqrt(_ratio(error, scale))),
        supports=_ratio(np.abs((u - whole.prescribed)[prescribed]).max(initial=0.0) - far, length),
        ties=_ratio(jump - far, length),
        penetration=_ratio(pen, length),
        tension=_ratio(-normal.min(initial=0.0), force),
        complementarity=_ratio(
            np.abs(normal * np.where(open_, gap_after, 0.0)).sum() - far * force, force * length
        ),
        cone=_ratio((size - bound).max(initial=0.0), force),
        friction=_ratio(unopposed.sum() - far * force, force * length),
        energy=_ratio(abs(state.energies.strain - strain) - ROUNDING * cancelling, scale),
    )


def _ratio(value: float, scale: float) -> float:
    if not value > 0.0:
        return 0.0 if value <= 0.0 else float(np.inf)
    return float(value / scale) if scale > 0.0 else float(np.inf)


def _bounds(state: AnyState) -> np.ndarray:
    """Return Ψ point by point from the scene's laws."""
    points, bound = state.contact.points, np.zeros(state.contact.points.count)
    for index, pair in enumerate(state.scene.contacts):
        own = points.pair == index
        if isinstance(pair.friction, Coulomb):
            bound[own] = _coulomb(pair.friction, state.contact.normal_force[own], points.area[own])
        elif isinstance(pair.friction, Tresca):
            bound[own] = pair.friction.traction * points.area[own]
    return bound


def _coulomb(law: Coulomb, force: np.ndarray, area: np.ndarray) -> np.ndarray:
    pressure, mu, limit = np.maximum(force, 0.0) / area, law.friction_coefficient, law.shear_limit
    if isinstance(mu, FrictionTable):
        mu = np.interp(pressure, mu.pressure, mu.coefficient)
    return np.asarray(area * np.minimum(mu * pressure, np.inf if limit is None else limit))


def _given_way(state: AnyState) -> np.ndarray:
    """Return how far surfaces give way under their pressures, less the distance at which pressure begins."""
    points, closure = state.contact.points, np.zeros(state.contact.points.count)
    for index, pair in enumerate(state.scene.contacts):
        own = points.pair == index
        pressure = np.maximum(state.contact.normal_force[own], 0.0) / points.area[own]
        match pair.closure:
            case LinearClosure(stiffness=stiffness):
                closure[own] = pressure / stiffness
            case ExponentialClosure() as law:
                begun = np.maximum(pressure, 0.01 * law.pressure)
                closure[own] = law.clearance * np.log10(begun / law.pressure) / 2.0
            case ClosureTable() as law:
                (c, d), (p, q) = law.closures[-2:], law.pressures[-2:]
                beyond = d + (d - c) / (q - p) * (pressure - q)
                closure[own] = np.where(
                    pressure > q, beyond, np.interp(pressure, law.pressures, law.closures)
                )
    return closure


def _sprung(state: AnyState) -> np.ndarray:
    """Return the elastic part of the slips."""
    points, slip = state.contact.points, np.zeros(state.contact.friction_force.shape)
    for index, pair in enumerate(state.scene.contacts):
        if pair.friction is not None and pair.friction.stick_stiffness is not None:
            own = points.pair == index
            stiffness = pair.friction.stick_stiffness * points.area[own, None]
            slip[own] = state.contact.friction_force[own] / stiffness
    return slip


def _undetermined(points: ContactPoints, whole: Whole, slip: np.ndarray) -> np.ndarray:
    """Return the part of the slip that closing the gap does not bring about, where supports hold components.

    A node that a roller keeps in a plane that is tilted to the normal slips as it comes near: that much no
    friction can change.
    """
    free = (abs(points.jump) @ whole.free.astype(float)) > 0.0
    found = slip.copy()
    for point in np.flatnonzero(~free.all(axis=1)):
        ways = np.eye(whole.components)[free[point]]
        _, _, basis = np.linalg.svd((ways @ points.normal[point])[None])
        seen = points.tangents[point] @ (basis[1:] @ ways).T
        q, size, _ = np.linalg.svd(seen, full_matrices=False)
        q = q[:, size > 1e-6]
        found[point] = q @ (q.T @ slip[point])
    return found


def moving(points: ContactPoints, whole: Whole) -> np.ndarray:
    """Return at which points supports leave the gap open to change."""
    weight = abs(points.jump) @ whole.free.astype(float)
    return np.asarray((weight * np.abs(points.normal)).sum(axis=1) > 1e-6)


def _force(whole: Whole, u: np.ndarray, on_slave: np.ndarray) -> float:
    """Return the scale of contact forces; where supports take up all load it is a part of that."""
    everything = np.abs(whole.load).max() + (abs(whole.K) @ np.abs(u).ravel()).max(initial=0.0)
    return float(max(np.linalg.norm(on_slave, axis=1).max(initial=0.0), 1e-6 * everything))


def _yielding(whole: Whole) -> np.ndarray:
    """Return how far each node would go under its load if its neighbours were held, (n_nodes, dim).

    That is less than bodies deform, unless supports take up all load: errors are small beside it then.
    """
    return np.abs(whole.load) / whole.K.diagonal().reshape(whole.load.shape)


def _tie_jumps(state: AnyState, u: np.ndarray, whole: Whole) -> float:
    """Return the largest jump between tied surfaces where supports leave it open."""
    ties = state.torn.ties
    if ties.count == 0:
        return 0.0
    sliding = np.array([tie.sliding for tie in state.scene.ties])[ties.pair]
    jump = ties.jump @ u
    jump[sliding] = np.einsum("nd,nd->n", jump, ties.normal)[sliding, None] * ties.normal[sliding]
    return float(np.abs(np.where(whole.free[ties.slave], jump, 0.0)).max())


def _equilibrium(
    state: AnyState, whole: Whole, u: np.ndarray, on_nodes: np.ndarray, tolerance: float | None
) -> tuple[float, float, float]:
    """Return the wrench that is left, the energy of the error that single nodes tell, and that of all."""
    dim = whole.components
    inner = (whole.K @ u.ravel()).reshape(u.shape)
    residual = inner - whole.load - on_nodes
    parts = (abs(whole.K) @ np.abs(u).ravel()).reshape(u.shape) + np.abs(whole.load) + np.abs(on_nodes)
    tied = _tie_forces(state, whole, -residual)
    residual = residual + tied
    energy = float(u.ravel() @ inner.ravel())
    balance, error = 0.0, 0.0
    for name in state.scene.bodies:
        nodes = whole.nodes(name)
        free = whole.free[nodes].ravel()
        dofs = np.arange(dim * nodes.start, dim * nodes.stop)[free]
        if len(dofs) == 0:
            continue
        r = residual.ravel()[dofs]
        floor = ROUNDING * parts.ravel()[dofs]
        r = np.where(np.abs(r) <= floor, 0.0, r)
        Q = loose(rigid_motions(state.scene, name), free)
        # Forces inside of it and on others count a little: where nothing acts on it they are all there is.
        acting = (np.abs(whole.load) + np.abs(on_nodes) + np.abs(tied) + 1e-6 * parts).ravel()[dofs]
        acting = acting + (1e-5 if tolerance is None else tolerance) * parts.max()
        left = np.abs(Q.T @ r)
        beyond = (left - 10 * np.abs(Q).T @ floor).max(initial=0.0)
        balance = max(balance, _ratio(float(beyond), float((np.abs(Q).T @ acting).max(initial=0.0))))
        r = r - Q @ (Q.T @ r)
        K = whole.K[dofs][:, dofs].toarray()
        scale = np.abs(np.diag(K)).max()
        v = np.linalg.solve(K + scale * Q @ Q.T, r)
        error += max(float(r @ v), 0.0)
    return balance, 0.5 * error, 0.5 * energy


def _tie_forces(state: AnyState, whole: Whole, wanted: np.ndarray) -> np.ndarray:
    """Return the forces between tied surfaces that come nearest to what single nodes lack."""
    ties = state.torn.ties
    if ties.count == 0:
        return np.zeros_like(wanted)
    sliding = np.array([tie.sliding for tie in state.scene.ties])[ties.pair]
    jump = ties.jump.toarray()
    bonded = np.einsum("rn,cd->rcnd", jump[~sliding], np.eye(whole.components)).reshape(-1, *wanted.shape)
    gliding = np.einsum("rn,rd->rnd", jump[sliding], ties.normal[sliding])
    rows = np.concatenate([bonded, gliding]) * whole.free
    rows = rows.reshape(len(rows), -1)
    force, *_ = np.linalg.lstsq(rows.T, (wanted * whole.free).ravel(), rcond=1e-12)
    return np.asarray((rows.T @ force).reshape(wanted.shape))


def loose(modes: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the rigid motions that supports leave to a body, on its free dofs."""
    held = modes[~free]
    if len(held):
        _, size, basis = np.linalg.svd(held, full_matrices=True)
        rank = int((size > 1e-8 * np.sqrt(len(held))).sum())
        modes = modes @ basis[rank:].T
    q, _ = np.linalg.qr(modes[free])
    return np.asarray(q)
