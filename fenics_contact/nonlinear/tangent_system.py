"""The dual of a linearised torn system, in which rigid motions may have a stiffness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import MPI
from fenics_contact.feti import (
    CachedMatrix,
    Condensations,
    DirichletPreconditioner,
    DualSystem,
    LocalKind,
    LocalOperator,
    Subdomain,
    TornInverse,
    TornSystem,
    kernel_matrix,
)
from fenics_contact.nonlinear.tangent_operator import TangentOperator
from fenics_contact.qp import CoarseSpace
from fenics_contact.scene import rigid_body_modes
from fenics_contact.timing import PhaseTimer


class TangentInverse(TornInverse):
    """K_ρ⁻¹ of this rank's subdomains, with the modes and their stiffness."""

    def __init__(
        self, torn: TornSystem, condensations: Condensations, earlier: Mapping[int, TangentOperator]
    ) -> None:
        """Factor the tangents; ``earlier`` has operators of an earlier shape by number of subdomain."""
        self._earlier = earlier
        super().__init__(torn.subdomains, torn.B, condensations, kind=LocalKind.IMPLICIT)

    def _factor(
        self, subdomain: Subdomain, interface: np.ndarray, condensations: Condensations
    ) -> LocalOperator:
        return TangentOperator(subdomain, interface, self._earlier.get(subdomain.mesh.number))

    @property
    def tangents(self) -> Sequence[TangentOperator]:
        """The factored subdomains."""
        return [operator for operator in self.operators if isinstance(operator, TangentOperator)]


class TangentSystem(DualSystem):
    """The dual of a torn system linearised at a displacement and multipliers.

    Its torn system has the tangents of the subdomains as stiffness, the forces out of balance as load, the
    rigid motions of the present shape as kernel, and c − B u as right side; displacements and multipliers
    are increments.

    Attributes:
        stiffness: S of all modes, shape (n_modes, n_modes), replicated.
        softened: Number of motions of all subdomains that stress has softened or made unstable, which have
            columns of their own.
    """

    inverse: TangentInverse
    stiffness: sp.csr_matrix
    softened: int

    def __init__(
        self,
        torn: TornSystem,
        timer: PhaseTimer | None = None,
        *,
        diagonal: np.ndarray | None = None,
        earlier: Mapping[int, TangentOperator] | None = None,
    ) -> None:
        """Factor the tangents and assemble d, G, S, e. Collective.

        Args:
            torn: The linearised system.
            timer: Collects the wall time.
            diagonal: That of F on contact rows, owned, if it is known well enough.
            earlier: Operators of an earlier shape by number of subdomain.
        """
        self._known_diagonal, self._earlier = diagonal, earlier or {}
        super().__init__(torn, timer, kind=LocalKind.IMPLICIT)

    def _inverse(
        self, torn: TornSystem, condensations: Condensations, kind: LocalKind, known: TornInverse | None
    ) -> TornInverse:
        inverse = TangentInverse(torn, condensations, self._earlier)
        self._earlier = {}  # a history must not keep all its linearisations
        parts = zip(torn.subdomains, inverse.tangents, strict=True)
        subdomains = tuple(replace(subdomain, kernel=operator.modes) for subdomain, operator in parts)
        self.torn = replace(torn, subdomains=subdomains)
        return inverse

    @property
    def operators(self) -> dict[int, TangentOperator]:
        """This rank's factored subdomains by number."""
        each = zip(self.torn.subdomains, self.inverse.tangents, strict=True)
        return {subdomain.mesh.number: operator for subdomain, operator in each}

    def _kernel(self, comm: MPI.Comm) -> sp.csr_matrix:
        shared = comm.allgather({n: (each.stiffness, each.softened) for n, each in self.operators.items()})
        blocks = {number: block for part in shared for number, block in part.items()}
        stiffnesses = [blocks[number][0] for number in sorted(blocks)]
        self.stiffness = sp.csr_matrix(sp.block_diag(stiffnesses))
        self.softened = sum(count for _, count in blocks.values())
        offset = np.concatenate([[0], np.cumsum([len(block) for block in stiffnesses])])
        mine = offset[[part.mesh.number for part in self.torn.subdomains]]
        self.points = sp.csr_matrix((0, int(offset[-1])))
        return kernel_matrix(self.torn.subdomains, int(offset[-1]), mine)

    def _without_unheld(self, coarse: CoarseSpace) -> CoarseSpace:
        """Leave the motions as they are: under stress they may have a stiffness."""
        self.unheld = sp.csr_matrix((self.kernel.shape[0], 0))
        self._unheld_points = self.points[:, :0]
        return coarse

    def conforming_on(self, torn: TornSystem, displacement: np.ndarray) -> np.ndarray:
        """Return a displacement on the rows of a neighbouring configuration made continuous. Collective."""
        rows, numbering = torn.B[:, self.inverse.interface].tocsr(), torn.numbering
        sewing = DirichletPreconditioner(self.inverse, rows, self._compliance(), numbering, torn.n_gluing)
        nothing = sp.csr_matrix((len(torn.right), 0))
        sewn = sewing.lifting(nothing).jump(torn.right - torn.jump(displacement))
        return displacement + self.inverse.extend(sewn)

    def _diagonal(self) -> tuple[np.ndarray, np.ndarray]:
        if self._known_diagonal is not None:
            return self._known_diagonal, np.zeros(len(self._known_diagonal), dtype=bool)
        return super()._diagonal()


def linearised(
    torn: TornSystem,
    displacement: np.ndarray,
    tangents: Sequence[sp.csr_matrix],
    unbalanced: np.ndarray,
    lacking: np.ndarray,
) -> TornSystem:
    """Return the torn system of increments at a displacement.

    Args:
        torn: The system with its load and right side.
        displacement: u of this rank, torn, shape (torn_size,), [length].
        tangents: K of each of this rank's subdomains at u.
        unbalanced: The forces out of balance, this rank's, torn, shape (torn_size,), [force].
        lacking: c − B u, owned, shape (n_owned,), [length].
    """
    subdomains, start = [], 0
    for subdomain, tangent in zip(torn.subdomains, tangents, strict=True):
        part = slice(start, start + subdomain.mesh.size)
        points = subdomain.points + displacement[part].reshape(subdomain.points.shape)
        kernel = rigid_body_modes(points).reshape(subdomain.mesh.size, -1)
        matrix = CachedMatrix(partial(_itself, tangent))
        subdomains.append(
            replace(subdomain, points=points, kernel=kernel, load=unbalanced[part], matrix=matrix)
        )
        start = part.stop
    return replace(torn, subdomains=tuple(subdomains), right=lacking)


def _itself(matrix: sp.csr_matrix) -> sp.csr_matrix:
    return matrix
