"""Rigid surfaces and tools that turn by large angles: motions that are given, and those that forces cause.

A point x of a piece moves by u = U + (R(θ) − I)(x − p). Its rate is ∂u/∂θ_k = (J e_k) × r with r = R (x − p)
and δω = J δθ, J = I + a θ̂ + b θ̂². Forces F of bodies on its nodes, a force and a moment (F₀, M₀) at p, and
springs k are in equilibrium with its free components q if g + Σ F·∂u/∂q = 0 with g = (F₀, Jᵀ M₀) − k q: the
moment keeps its direction in space, springs have the energy ½ k q².

References:
    A. Ibrahimbegovic, F. Frey, I. Kozar, Computational aspects of vector-like parametrization of
    three-dimensional finite rotations, Int. J. Numer. Meth. Engng 38 (1995), section 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag

from fenics_contact._base.csr import Csr
from fenics_contact._base.display import displayed
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.supports import RigidSurface
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.free_motions import FreeMotions
from fenics_contact.feti.torn import TornSystem

#: U, then θ, of rigid surfaces by the names of body and surface.
Motions: TypeAlias = Mapping[tuple[str, str], np.ndarray]

#: Largest angle by which a surface turns in one part of a load step, against what rests and against others:
#: below half a turn there is no shorter way round. Half of it costs a bent strip up to 13 % more products or
#: saves 6 %, with twice of it 0.66 of a turn comes out as −0.34.
FARTHEST_TURN = 2.0 * np.pi / 3.0


@displayed
@dataclass(frozen=True, eq=False)
class TurnedSurface:
    """A surface that moves as a rigid piece, by large angles where its body deforms much.

    `motion`: U, then θ, in radians; free components are those of the last configuration; `load`: force and
    moment at the point in the plane in space; `far`: whether it turns by large angles; `whole`: whether its
    body has no other nodes, as that of a tool.
    """

    surface: RigidSurface
    motion: np.ndarray
    load: np.ndarray
    springs: np.ndarray
    nodes: np.ndarray
    points: np.ndarray
    far: bool
    whole: bool

    @classmethod
    def all_of(cls, scene: Scene, decomposition: Decomposition) -> tuple[TurnedSurface, ...]:
        """Return those of a scene that turn far, or have free components."""
        found = []
        for support in scene.rigid_surfaces:
            body = scene.bodies[support.body]
            if not (body.deforms_much or support.free.any()):
                continue
            own = body.mesh.nodes_to_hold(support.surface)
            nodes = decomposition.tearing.global_nodes(support.body, own)
            springs = np.array(body.springs or np.zeros(len(support.motion)))
            points, far, whole = body.mesh.points[own], body.deforms_much, len(own) == body.mesh.n_nodes
            found.append(cls(support, support.prescribed, support.load, springs, nodes, points, far, whole))
        return tuple(found)

    @property
    def at_rest(self) -> TurnedSurface:
        """The surface without motion and load."""
        return replace(self, motion=np.zeros_like(self.motion), load=np.zeros_like(self.load))

    def mixed(self, first: TurnedSurface, part: float) -> TurnedSurface:
        """Return it at a part of the way from another motion and load, with its own springs."""

        def mixed(name: str) -> np.ndarray:
            return np.asarray((1.0 - part) * getattr(first, name) + part * getattr(self, name))

        return replace(self, motion=mixed("motion"), load=mixed("load"))

    def between(self, before: Mapping[tuple[str, str], TurnedSurface], part: float) -> TurnedSurface:
        """Return it at a part of the way from where it was before, from rest if it was not there."""
        if self.place not in before:
            return self.mixed(self.at_rest, part)
        first = before[self.place]
        springs = np.asarray((1.0 - part) * first.springs + part * self.springs)
        return replace(self.mixed(first, part), springs=springs)

    def turn_from(self, before: Mapping[tuple[str, str], TurnedSurface]) -> np.ndarray:
        """Return the rotation that is given on the way from where it was before, or rest, (1,) or (3,)."""
        start = before.get(self.place, self.at_rest).motion
        return np.where(self.free, 0.0, self.motion - start)[self.surface.dim :]

    def at(self, motions: Motions) -> TurnedSurface:
        """Return it with the free components of other motions, zero by default."""
        known = motions.get(self.place, np.zeros_like(self.motion))
        return replace(self, motion=np.where(self.free, known, self.motion))

    @property
    def free(self) -> np.ndarray:
        """Marks of the free components of U, then of θ."""
        return self.surface.free

    @property
    def place(self) -> tuple[str, str]:
        """Names of the body and of the surface."""
        return self.surface.body, self.surface.surface

    @property
    def displacement(self) -> np.ndarray:
        """Displacement of the nodes, shape (n, dim), [length]."""
        if self.far:
            return self.surface.turned(self.points, self.motion)
        return self.surface.modes(self.points) @ self.motion

    @property
    def point(self) -> np.ndarray:
        """Where the point p lies now, shape (dim,), [length]."""
        dim = self.surface.dim
        return np.array(self.surface.at) + (self.motion[:dim] if self.far else 0.0)

    @property
    def arms(self) -> np.ndarray:
        """Arms r of the nodes now, shape (n, 3), [length]."""
        moved = self.displacement if self.far else 0.0
        return _in_space(self.points + moved - self.point)

    @cached_property
    def spins(self) -> np.ndarray:
        """J: spins for unit rates of the components of θ, one a row, shape (1, 3) in the plane, (3, 3)."""
        if self.surface.dim == 2 or not self.far:
            return np.eye(3)[-self.surface.turns :]
        return tangent_map(self.motion[3:]).T

    @property
    def rates(self) -> np.ndarray:
        """∂u/∂q of the nodes for the free components, shape (n, dim, n_free)."""
        dim, arms = self.surface.dim, self.arms
        rates = np.zeros((len(arms), dim, len(self.motion)))
        rates[:, range(dim), range(dim)] = 1.0
        for k, spin in enumerate(self.spins):
            rates[:, :, dim + k] = np.cross(spin, arms)[:, :dim]
        return rates[:, :, self.free]

    @property
    def driving(self) -> np.ndarray:
        """Loads g of the free components, shape (n_free,)."""
        dim = self.surface.dim
        turning = self.spins @ _moment(self.load[dim:])
        return np.asarray((np.append(self.load[:dim], turning) - self.springs * self.motion)[self.free])

    @property
    def sprung(self) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment that springs exert, shape (dim,) and (1,) in the plane, (3,) in space."""
        force, turning = np.split(-self.springs * self.motion, [self.surface.dim])
        return force, np.linalg.solve(self.spins[:, -self.surface.turns :], turning)

    @property
    def work(self) -> float:
        """Work of the load on the way; NaN for a moment whose axis is not that of the rotation."""
        dim = self.surface.dim
        moment, turn = _moment(self.load[dim:]), _moment(self.motion[dim:])
        if self.far and np.linalg.norm(np.cross(moment, turn)) > LAST_PLACES * np.linalg.norm(moment):
            return np.nan
        return float(self.load @ self.motion)

    def stiffness(self, dyad: np.ndarray) -> np.ndarray:
        """Return −∂(g + Σ F·∂u/∂q)/∂q at fixed forces on the nodes, without springs, (n_free, n_free).

        `dyad`: Σ r Fᵀ of the forces F of bodies on the nodes, [force·length].
        """
        dim, whole = self.surface.dim, np.zeros((len(self.motion),) * 2)
        if self.far:
            spins, turned = self.spins, np.zeros((3, 3))
            turned[:dim, :dim] = dyad
            whole[dim:, dim:] = np.trace(turned) * spins @ spins.T - spins @ turned @ spins.T
            if dim == 3:
                moment = np.einsum("iab,ab->i", _LEVI_CIVITA, turned) + self.load[3:]
                whole[3:, 3:] -= np.einsum("ilk,i->kl", tangent_map_rates(self.motion[3:]), moment)
        return whole[np.ix_(self.free, self.free)]

    def driven_by(self, further: np.ndarray) -> TurnedSurface:
        """Return it with further loads on its free components, of which g grows as given, (n_free,)."""
        dim, count = self.surface.dim, len(self.motion)
        onto = np.eye(count)
        onto[dim:, dim:] = self.spins[:, -self.surface.turns :]
        free, load = self.free, self.load.copy()
        load[free] += np.linalg.solve(onto[np.ix_(free, free)], further)
        return replace(self, load=load)

    @cached_property
    def basis(self) -> tuple[np.ndarray, np.ndarray]:
        """Orthonormal rates, shape (n · dim, n_free), and the matrix S of q̇ ↦ S q̇ in terms of them."""
        rates = self.rates.reshape(self.points.size, -1)
        found, arm = np.linalg.qr(rates), float(np.abs(self.arms).max()) or 1.0
        units = np.repeat([1.0, arm], [self.surface.dim, self.surface.turns])[self.free]
        size = np.linalg.norm(rates, axis=0) / units
        # At a full turn rates depend on each other.
        own = np.abs(np.diag(found[1])) / units
        if own.min(initial=np.inf) <= np.sqrt(LAST_PLACES) * size.max(initial=0.0):
            raise ConvergenceError(
                "rotations that are free about several axes must stay below a full turn, got "
                f"{self.motion.tolist()} on {self.surface.surface!r}: prescribe all but one, or take smaller "
                "steps"
            )
        return found[0], found[1]


#: ε_iab of (a × b)_i = ε_iab a_a b_b.
_LEVI_CIVITA = np.array([[np.linalg.det([p, q, r]) for r in np.eye(3)] for p in np.eye(3) for q in np.eye(3)])
_LEVI_CIVITA = _LEVI_CIVITA.reshape(3, 3, 3)


def _in_space(vectors: np.ndarray) -> np.ndarray:
    """Return plane vectors as those in space, shape (n, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def _moment(given: np.ndarray) -> np.ndarray:
    """Return a moment as a vector in space."""
    return np.append(np.zeros(3 - len(given)), given)


def _hat(vector: np.ndarray) -> np.ndarray:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _series(square: float, first: int, terms: int = 12) -> tuple[float, float]:
    """Return Σ (−s)ⁿ / (2n + first)! for small s, and its derivative."""
    powers = np.array([(-1.0) ** n / factorial(2 * n + first) for n in range(terms)])
    polynomial = np.polynomial.Polynomial(powers)
    return float(polynomial(square)), float(polynomial.deriv()(square))


def _factors(square: float) -> tuple[float, float, float, float]:
    """Return a = (1 − cos φ)/φ², b = (φ − sin φ)/φ³ and their derivatives by φ², given φ²."""
    if square < 1.0:
        (a, da), (b, db) = _series(square, 2), _series(square, 3)
        return a, b, da, db
    angle = np.sqrt(square)
    sine, cosine = np.sin(angle), np.cos(angle)
    a, b = (1.0 - cosine) / square, (angle - sine) / (square * angle)
    da = (0.5 * sine / angle - a) / square
    db = (0.5 * a - 1.5 * b) / square
    return float(a), float(b), float(da), float(db)


def tangent_map(rotation: np.ndarray) -> np.ndarray:
    """Return J with δω = J δθ for the rotation by the vector θ, shape (3, 3)."""
    a, b, _, _ = _factors(float(rotation @ rotation))
    turn = _hat(rotation)
    return np.asarray(np.eye(3) + a * turn + b * turn @ turn)


def tangent_map_rates(rotation: np.ndarray) -> np.ndarray:
    """Return ∂J_ik/∂θ_l at [i, l, k], shape (3, 3, 3)."""
    a, b, da, db = _factors(float(rotation @ rotation))
    turn = _hat(rotation)
    result = np.empty((3, 3, 3))
    for place, unit in enumerate(map(_hat, np.eye(3))):
        grown = 2.0 * rotation[place] * (da * turn + db * turn @ turn)
        result[:, place] = grown + a * unit + b * (unit @ turn + turn @ unit)
    return result


def tracked_motions(turned: Sequence[TurnedSurface], torn: TornSystem) -> FreeMotions:
    """Return the free motions of a system with those of rigid surfaces before its others.

    Behind their columns on nodes are those of u = e_b r_a, whose work gives the dyads Σ r Fᵀ.
    """
    size = torn.decomposition.tearing.n_nodes * torn.components
    loose = [each for each in turned if each.free.any()]
    loads = [np.linalg.solve(each.basis[1].T, each.driving) for each in loose]
    fields = [_on_rows(each, each.basis[0], size) for each in loose]
    for each in loose:
        dim = each.surface.dim
        affine = np.einsum("na,bc->ncab", each.arms[:, :dim], np.eye(dim))
        fields.append(_on_rows(each, affine.reshape(dim * len(affine), dim * dim), size))
    load, nodes = np.concatenate(loads), sp.hstack(fields, format="csr")
    rows = torn.groups.columns(nodes)
    rows, count = rows[torn.numbering.owned], len(load)
    columns = sp.hstack([rows[:, :count], torn.free.columns], format="csr")
    load = np.concatenate([load, torn.free.load])
    return FreeMotions(columns, load, tracked=count, nodes=nodes, dyads=rows[:, count:])


def tracked_stiffness(
    turned: Sequence[TurnedSurface], torn: TornSystem, multiplier: np.ndarray
) -> np.ndarray:
    """Return the stiffness of all free motions at multipliers, owned, but for springs. Collective.

    Shape (n_free, n_free), replicated.
    """
    free, dim = torn.free, torn.components
    assert free.dyads is not None
    dyads = torn.numbering.comm.allreduce(free.dyads.T @ multiplier).reshape(-1, dim, dim)
    loose = [each for each in turned if each.free.any()]
    blocks = []
    for each, dyad in zip(loose, dyads, strict=True):
        inverse = np.linalg.inv(each.basis[1])
        blocks.append(inverse.T @ each.stiffness(dyad) @ inverse)
    blocks.append(np.zeros((free.count - free.tracked,) * 2))
    return np.asarray(block_diag(*blocks))


def spring_columns(
    turned: Sequence[TurnedSurface], size: int
) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
    """Return the springs as K = V diag(D) Vᵀ of columns on nodes, and a node of each.

    V of shape (size, m), with columns of length one; D, shape (m,), [force / length]; nodes, shape (m,).
    """
    columns, values, nodes = [Csr((size, 0))], [np.zeros(0)], [np.zeros(0, dtype=np.int64)]
    for each in turned:
        sprung = np.flatnonzero(each.springs[each.free])
        if len(sprung):
            basis, scale = each.basis
            measured = np.linalg.inv(scale)[sprung]
            length = np.linalg.norm(measured, axis=1)
            columns.append(_on_rows(each, basis @ (measured / length[:, None]).T, size))
            values.append(each.springs[each.free][sprung] * length**2)
            nodes.append(np.full(len(sprung), each.nodes[0]))
    return sp.hstack(columns, format="csr"), np.concatenate(values), np.concatenate(nodes)


def moved_on(turned: Sequence[TurnedSurface], change: np.ndarray, part: float) -> Motions:
    """Return the motions of all surfaces after a part of a change of the tracked unknowns, (n_tracked,)."""
    moved, start = {}, 0
    for each in turned:
        motion = each.motion.copy()
        if each.free.any():
            count = int(each.free.sum())
            motion[each.free] += part * np.linalg.solve(each.basis[1], change[start : start + count])
            start += count
        moved[each.place] = motion
    return moved


def placed(turned: Sequence[TurnedSurface], torn: TornSystem, displacement: np.ndarray) -> np.ndarray:
    """Return a torn displacement with the nodes of loose tools where these are: their cells have no strain.

    After a Newton step nodes of tools lie on tangents to their arcs.
    """
    decomposition, result = torn.decomposition, displacement
    copy, block = decomposition.held
    node = decomposition.tearing.copy_node[copy]
    for each in turned:
        if each.whole and each.free.any():
            result = result.copy() if result is displacement else result
            own = np.isin(node, each.nodes)
            moved = each.displacement[np.searchsorted(each.nodes, node[own])]
            result.reshape(-1, torn.components)[block[own]] = moved
    return result


def driven_further(turned: Sequence[TurnedSurface], change: np.ndarray) -> tuple[TurnedSurface, ...]:
    """Return surfaces whose loads have changed as the loads of the tracked unknowns do, (n_tracked,)."""
    changed, start = [], 0
    for each in turned:
        count = int(each.free.sum())
        if count:
            each = each.driven_by(each.basis[1].T @ change[start : start + count])
            start += count
        changed.append(each)
    return tuple(changed)


def _on_rows(surface: TurnedSurface, fields: np.ndarray, size: int) -> sp.csr_matrix:
    """Return fields on the nodes of a surface, shape (n · dim, k), on all rows, (size, k)."""
    dim = surface.surface.dim
    row = (dim * surface.nodes[:, None] + np.arange(dim)).ravel()
    entries = np.ones(len(row)), (row, np.arange(len(row)))
    return Csr(entries, shape=(size, len(row))) @ Csr(fields)
