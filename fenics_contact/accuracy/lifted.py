"""An admissible displacement near a computed one, and the energy of the correction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.accuracy.admissible import Admissible, basis
from fenics_contact.feti import DualSystem
from fenics_contact.linalg import LAST_PLACES
from fenics_contact.qp import Marks, Vector, contact_step, global_max, global_sum

#: Number of corrections for the regularisation of the contact block.
REFINEMENTS = 12
#: Largest remaining violation relative to the initial one.
UNLIFTED = 1e-9


@dataclass(frozen=True, eq=False)
class Lifted:
    """A correction w of the interface after which all equality rows hold and no contact penetrates.

    Attributes:
        displacement: w, shape (n_interface,), [length].
        energy: wᵀ S w, [force · length].
        residual: r after it, owned, [length]; zero in the rows that were closed.
        multiplier: Estimate −M r of the multiplier's error, owned, [force].
        left: Remaining violation relative to the initial one; more than rounding only if rows are
            contradictory.
    """

    displacement: Vector
    energy: float
    residual: Vector
    multiplier: Vector
    left: float


def lift(system: DualSystem, known: Admissible, residual: Vector, cancelled: float) -> Lifted:
    """Close the rows that should be closed, and those that would penetrate after the correction. Collective.

    The correction is that of the Dirichlet preconditioner, w = D⁻¹Bᵀ(B D⁻¹Bᵀ)⁻¹ r, with its energy wᵀ S w:
    the preconditioned residual rᵀ M r. The effect of regularising the contact block is corrected at the cost
    of that small block alone; S is applied once, for half an F-product.

    Args:
        system: The dual system.
        known: An admissible multiplier with its statuses.
        residual: Its r = F λ − d − Gᵀα, owned, [length].
        cancelled: Norm of the displacements that cancel in r, [length].
    """
    comm, tangential = system.problem.comm, system.problem.layout.tangential
    slid = np.linalg.norm(residual[tangential], axis=1)
    step = contact_step(system.problem.layout, system.problem.diagonal)[tangential[:, 0]]
    # Where a slip is short, removing its part across the friction force costs less energy than keeping it.
    statuses = known.statuses
    across = statuses.slip & (step * slid < known.slip_bound)
    rows = _Rows(system, known, statuses.closed, statuses.stick, across)
    closing = _close(rows, residual, cancelled)
    if closing.left > UNLIFTED:  # a node of two pairs may be set to stick where it should close
        nothing = np.zeros_like(across)
        closing = _close(replace(rows, stick=nothing, across=nothing), residual, cancelled)
    energy, force = system.inverse.energy(closing.displacement)
    energy = float(global_sum(comm, energy)[0])
    after = closing.residual - closing.rows.spread(closing.rows.wanted(closing.residual))
    estimate = -system.preconditioner.lifting(closing.rows.restriction).multiplier(force)
    return Lifted(closing.displacement, energy, after, estimate, closing.left)


@dataclass(frozen=True, eq=False)
class _Closing:
    """Displacement w that closes rows, r after it, and the remaining violation relative to the start."""

    rows: _Rows
    displacement: Vector
    residual: Vector
    left: float


def _close(rows: _Rows, residual: Vector, cancelled: float) -> _Closing:
    """Close rows, and those that penetrate afterwards. Collective; no application of S."""
    system = rows.system
    comm, w = system.problem.comm, np.zeros(len(system.inverse.interface))
    start = global_max(comm, np.abs(rows.wanted(residual)).max(initial=0.0))
    small = max(UNLIFTED * start, LAST_PLACES * cancelled)
    lifting, current, violation = system.preconditioner.lifting(rows.restriction), residual, start
    for _ in range(REFINEMENTS):
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

    Attributes:
        system: The dual system.
        known: An admissible multiplier.
        closed: Contacts to close, shape (n_contact,), owned.
        stick: Discs whose slip is removed, shape (n_friction,), owned.
        across: Discs whose slip across the friction force is removed, shape (n_friction,), owned.
    """

    system: DualSystem
    known: Admissible
    closed: Marks
    stick: Marks
    across: Marks

    @cached_property
    def restriction(self) -> sp.csr_matrix:
        """Z with orthonormal columns, shape (size, n_face), owned."""
        layout = self.system.problem.layout
        return basis(layout, self.closed, self.stick, self.across, self.known.multiplier)

    def wanted(self, residual: Vector) -> Vector:
        """Return Zᵀ r, shape (n_face,)."""
        return np.asarray(self.restriction.T @ residual)

    def spread(self, y: Vector) -> Vector:
        """Return Z y, owned."""
        return np.asarray(self.restriction @ y)

    def penetrating(self, residual: Vector, tolerance: float) -> Marks:
        """Mark contacts that are not closed and penetrate by more than a tolerance."""
        return np.asarray(~self.closed & (residual[self.system.problem.layout.normal] < -tolerance))
