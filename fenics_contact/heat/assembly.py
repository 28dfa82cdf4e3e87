"""Subdomains at temperatures: matrices, loads, and what is kept of them from one solution to the next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from operator import is_

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._fem.composition import composition
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.by_shape import BY_MATRIX
from fenics_contact.feti.subdomain import CachedMatrix, Subdomain
from fenics_contact.heat.exchange import Exchange
from fenics_contact.heat.forms import Part
from fenics_contact.heat.parts import HeatLoad
from fenics_contact.heat.properties import Conductor
from fenics_contact.heat.scene import HeatScene


@dataclass(frozen=True, eq=False)
class Rate:
    """How fast heat is stored at the end of a time step: a C (T − T₀) − s, with C the capacity between both.

    `factor`: a, [1 / time], zero in a steady state; `before`: T₀ at all nodes, (n_nodes,); `history`: s on
    each subdomain of this rank, [power].
    """

    factor: float
    before: np.ndarray
    history: tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class Heated:
    """A subdomain at some temperature.

    `exchanges`: with each load that acts on it, by its number; `stored`: the heat that goes into it;
    `stiffened`: factor of the diagonal by films, storage and temperature; `even`: what one degree takes.
    """

    subdomain: Subdomain
    exchanges: Mapping[int, Exchange]
    stored: Exchange
    stiffened: np.ndarray
    even: np.ndarray

    def residual(self, temperature: np.ndarray) -> np.ndarray:
        """Return the heat that is given and not taken, (n,), which a large mean does not round."""
        mean = float(temperature.mean())
        return self.subdomain.load - self.subdomain.stiffness @ (temperature - mean) - mean * self.even


def _same(matrices: list[sp.csr_matrix], others: list[sp.csr_matrix]) -> bool:
    """Return whether they are the same objects; both lists hold theirs, so that no other takes its place."""
    return len(matrices) == len(others) and all(map(is_, matrices, others))


class Assembly:
    """Assembles one subdomain, again and again."""

    def __init__(self, part: Part) -> None:
        """Prepare; nothing is assembled yet."""
        self.part = part
        self._known: dict[HeatLoad, Exchange] = {}
        self._by_rate: dict[float, sp.csr_matrix] = {}
        self._last: tuple[list[sp.csr_matrix], Subdomain, np.ndarray, np.ndarray] | None = None

    @cached_property
    def _conduction(self) -> sp.csr_matrix:
        """K of a body whose conductivity is constant."""
        return self.part.conduction(np.zeros(self.part.mesh.size))

    @cached_property
    def _typical(self) -> np.ndarray:
        """The diagonal of K at the conductivity by which bodies are compared."""
        compared = np.full(self.part.mesh.size, Conductor.compared_at)
        conduction = self._conduction if self.part.body.is_linear else self.part.conduction(compared)
        return np.asarray(self.part.mesh.following.stiffness(conduction).diagonal())

    @cached_property
    def _capacity(self) -> sp.csr_matrix:
        """C of a body whose capacity is constant."""
        nothing = np.zeros(self.part.mesh.size)
        return self.part.capacity(nothing, nothing)

    def heated(
        self, scene: HeatScene, temperature: np.ndarray, rate: Rate, number: int, friction: np.ndarray
    ) -> Heated:
        """Return the subdomain at temperatures of the nodes of its body, (n_nodes,).

        `number`: that of the subdomain on this rank; `friction`: heat that enters at the nodes of the body,
        (n_nodes,), [power].
        """
        part, linear = self.part, self.part.body.is_linear
        part.place()
        nodes = part.mesh.nodes
        acting = {k: load for k, load in enumerate(scene.loads) if load.body == part.mesh.body}
        # Loads of other times are forgotten: each may be a new one.
        self._known = {load: self._known[load] for load in acting.values() if load in self._known}
        exchanges = {k: self._exchange(load, temperature[nodes]) for k, load in acting.items()}
        stored = self._stored(rate, temperature[nodes], rate.before[nodes], number)
        bed = sum((each.matrix for each in exchanges.values()), stored.matrix)
        beds = [each.matrix for each in (*exchanges.values(), stored) if each.matrix.nnz]
        load = sum((each.load for each in exchanges.values()), stored.load + part.portion * friction[nodes])
        if not np.isfinite(load).all():
            raise InvalidInputError(f"heat on {part.name} must be finite, got {load}: check loads and laws")
        if not linear or self._last is None or not _same(self._last[0], beds):
            conduction = self._conduction if linear else part.conduction(temperature[nodes])
            self._last = beds, *self._subdomain(conduction, bed.tocsr())
        _, subdomain, stiffened, even = self._last
        force = part.mesh.following.force(load)
        return Heated(replace(subdomain, load=force), exchanges, stored, stiffened, even)

    def _exchange(self, load: HeatLoad, temperature: np.ndarray) -> Exchange:
        if not load.is_linear:
            return load.exchange(self.part, temperature)
        if load not in self._known:
            self._known[load] = load.exchange(self.part, temperature)
        return self._known[load]

    def _stored(self, rate: Rate, temperature: np.ndarray, before: np.ndarray, number: int) -> Exchange:
        size = self.part.mesh.size
        if not rate.factor:
            return Exchange(Csr((size, size)), np.zeros(size))
        constant = self.part.body.is_linear
        C = self._capacity if constant else self.part.capacity(before, temperature)
        matrix = self._scaled(C, rate.factor) if constant else (rate.factor * C).tocsr()
        return Exchange(matrix, matrix @ before + rate.history[number])

    def _scaled(self, matrix: sp.csr_matrix, factor: float) -> sp.csr_matrix:
        """Return a C, the same object for the same factor."""
        if factor not in self._by_rate:
            self._by_rate = {factor: (factor * matrix).tocsr()}
        return self._by_rate[factor]

    def _subdomain(
        self, conduction: sp.csr_matrix, bed: sp.csr_matrix
    ) -> tuple[Subdomain, np.ndarray, np.ndarray]:
        mesh, field, typical = self.part.mesh, self.part.field, self._typical
        whole = mesh.following.stiffness((conduction + bed).tocsr())
        # Neighbours in cubes do not act on each other but for rounding, which must not decide the pattern.
        whole.data[np.abs(whole.data) <= LAST_PLACES * np.abs(whole.data).max()] = 0.0
        whole.eliminate_zeros()
        ones = np.ones((mesh.size, 1))
        even = mesh.following.force(bed @ ones[:, 0])
        resistance = float(even.sum()) / mesh.size
        held = resistance > 0.0
        stiffened = np.ones(mesh.size)
        np.divide(whole.diagonal(), typical, out=stiffened, where=typical > 0.0)
        return Subdomain(
            mesh, composition(field, mesh.cells), (), (), self.part.points, np.zeros(mesh.size),
            ones[:, :0] if held else ones, float(typical.mean()), CachedMatrix(lambda: whole),
            ones / np.sqrt(mesh.size) if held else ones[:, :0],
            np.array([resistance]) if held else np.zeros(0), (), BY_MATRIX,
        ), stiffened, even  # fmt: skip
