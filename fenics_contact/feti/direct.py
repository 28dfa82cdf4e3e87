"""A single body held by supports: its stiffness is factored directly, without multipliers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._base.progress import PhaseTimer
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.factor import Factor
from fenics_contact.feti.torn import TornSystem

#: Largest error of a solution in energy norm, relative to it.
WRONG = 1e-4


@displayed
@dataclass(frozen=True, eq=False)
class DirectSolution:
    """Displacement and reactions of one body.

    Attributes:
        displacement: u, shape (torn_size,), [length].
        multiplier: Reactions of the supports, one per prescribed component, shape (n_rows,), [force].
        gluing_residual: ‖f − K u‖ over the free components, relative to the forces that cancel there.
    """

    displacement: np.ndarray
    multiplier: np.ndarray
    gluing_residual: float
    natural_residual: float = 0.0
    coarse_residual: float = 0.0
    iterations: int = 1
    products: int = 0
    history: tuple[()] = ()
    reason: str = "solved by a sparse factorisation"


class DirectSystem:
    """K of one body with the prescribed components eliminated.

    Attributes:
        torn: The system; it has one subdomain and only rows of supports.
    """

    products = 0
    _factor: Factor | None  # None where supports prescribe everything

    def __init__(
        self, torn: TornSystem, timer: PhaseTimer | None = None, *, previous: DirectSystem | None = None
    ) -> None:
        """Factor the stiffness."""
        self.torn = torn
        (body,) = torn.subdomains
        self._fixed = torn.B.indices
        self._free = np.setdiff1d(np.arange(body.mesh.size), self._fixed)
        if previous is not None and previous.torn.subdomains[0].matrix is body.matrix:
            self._factor = previous._factor
            return
        with (timer or PhaseTimer()).phase("factor"):
            free = body.stiffness[self._free][:, self._free].tocsr()
            self._factor = Factor(free) if len(self._free) else None

    def solve(self) -> DirectSolution:
        """Return the displacement under the present load, refined once."""
        (body,) = self.torn.subdomains
        stiffness, load, free = body.stiffness, self.torn.load, self._free
        displacement = np.zeros(body.mesh.size)
        displacement[self._fixed] = self.torn.right
        moved = stiffness @ displacement
        for _ in range(2):  # the second pass removes the rounding of the first
            displacement[free] += self._moved_by((load - stiffness @ displacement)[free])
        missing = load - stiffness @ displacement
        scale = max(np.linalg.norm(load), np.linalg.norm(moved), np.finfo(float).tiny)
        error, norm = self.energy_of_residual(displacement), float(displacement @ (stiffness @ displacement))
        if not error <= WRONG**2 * norm:  # a body that is only moved has no energy but this sum's rounding
            summed = float(abs(displacement) @ (abs(stiffness) @ abs(displacement)))
            norm = max(norm, float(np.finfo(float).eps) * summed)
        if not error <= WRONG**2 * norm:
            raise ConvergenceError(
                f"a factored stiffness needs an error below {WRONG:g} in energy norm, the residual shows "
                f"{np.sqrt(abs(error) / (norm or 1.0)):.1e} after refinement: the body is too slender, its "
                "cells are too flat, or its materials too different for double precision"
            )
        return DirectSolution(
            displacement, missing[self._fixed], float(np.linalg.norm(missing[free]) / scale)
        )

    def energy_of_residual(self, displacement: np.ndarray) -> float:
        """Return rᵀK⁻¹r of the free components, r = f − K u: the energy norm of the error, squared."""
        (body,) = self.torn.subdomains
        missing = (self.torn.load - body.stiffness @ displacement)[self._free]
        return float(missing @ self._moved_by(missing))

    def _moved_by(self, force: np.ndarray) -> np.ndarray:
        """Return K⁻¹ times forces on the free components."""
        displacement = np.empty(len(self._free))
        if self._factor is not None:
            self._factor.solve(force, displacement)
        return displacement

    def conforming(self, displacement: np.ndarray) -> np.ndarray:
        """Return the displacement itself: no node has copies."""
        return displacement

    def force(self, multiplier: np.ndarray) -> np.ndarray:
        """Return Bᵀλ, the reactions on all components, shape (torn_size,), [force]."""
        return np.asarray(self.torn.B.T @ multiplier)
