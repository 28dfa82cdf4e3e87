"""A single body held by supports: its stiffness is factored directly, without multipliers."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._scene.local_axes import LocalAxes
from fenics_contact.errors import ConvergenceError
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.factor import Factor, NoFactor
from fenics_contact.feti.torn import TornSystem

_LOG = logging.getLogger(__name__)

#: Largest error of a solution in energy norm, relative to it.
WRONG = 1e-4


@displayed
@dataclass(frozen=True, eq=False)
class DirectSolution:
    """Displacement and reactions of one body.

    `multiplier`: reactions of the supports, one per prescribed component; `gluing_residual`: ‖f − K u‖ over
    the free components, relative to the forces that cancel there.
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

    `torn`: the system; it has one subdomain and only rows of supports.
    """

    products = 0
    _factor: Factor | NoFactor

    def __init__(
        self, torn: TornSystem, timer: PhaseTimer | None = None, *, previous: DirectSystem | None = None
    ) -> None:
        """Factor the stiffness."""
        self.torn = torn
        (body,) = torn.subdomains
        self._axes = _axes_of(torn)
        # Each row of a support holds one component, along the axes of its node.
        self._fixed = self._axes.rows(torn.B).indices
        self._free = np.setdiff1d(np.arange(body.mesh.size), self._fixed)
        if previous is not None and previous._holds(torn):
            self._factor = previous._factor
            return
        with (timer or PhaseTimer()).phase("factor"):
            free = self._stiffness[self._free][:, self._free].tocsr()
            self._factor = Factor(free) if len(self._free) else NoFactor()
            # Loads that do no work on motions without energy have an answer, as one row of C3D20R has.
            if words := self._factor.doubt(free):
                safe_log(_LOG.warning, "displacements may contain motions without energy: %s", words)

    def _holds(self, torn: TornSystem) -> bool:
        """Return whether another system has the same matrix and supports."""
        same = self.torn.decomposition is torn.decomposition
        return same and self.torn.subdomains[0].matrix is torn.subdomains[0].matrix

    @property
    def _stiffness(self) -> sp.csr_matrix:
        """K along the axes of nodes."""
        (body,) = self.torn.subdomains
        return self._axes.matrix(body.stiffness)

    def solve(self) -> DirectSolution:
        """Return the displacement under the present load, refined once."""
        stiffness, load, free = self._stiffness, self._axes.turned(self.torn.load), self._free
        displacement = np.zeros(len(load))
        displacement[self._fixed] = self.torn.right
        moved = stiffness @ displacement
        for _ in range(2):  # the second pass removes the rounding of the first
            displacement[free] += self._moved_by((load - stiffness @ displacement)[free])
        missing = load - stiffness @ displacement
        scale = max(np.linalg.norm(load), np.linalg.norm(moved), np.finfo(float).tiny)
        error, norm = self._energy(missing), float(displacement @ (stiffness @ displacement))
        if not error <= WRONG**2 * norm:  # a body that is only moved has no energy but this sum's rounding
            summed = float(abs(displacement) @ (abs(stiffness) @ abs(displacement)))
            norm = max(norm, float(np.finfo(float).eps) * summed)
        if not error <= WRONG**2 * norm:
            raise ConvergenceError(
                f"a factored stiffness must have an error below {WRONG:g} in energy norm, got "
                f"{np.sqrt(abs(error) / (norm or 1.0)):.1e}: use less slender bodies and cells"
            )
        reaction, residual = missing[self._fixed], float(np.linalg.norm(missing[free]) / scale)
        return DirectSolution(self._axes.back(displacement), reaction, residual)

    def energy_of_residual(self, displacement: np.ndarray) -> float:
        """Return rᵀK⁻¹r of the free components, r = f − K u: the energy norm of the error, squared."""
        (body,) = self.torn.subdomains
        missing = self.torn.load - body.stiffness @ displacement
        return self._energy(self._axes.turned(missing))

    def _energy(self, missing: np.ndarray) -> float:
        return float(missing[self._free] @ self._moved_by(missing[self._free]))

    def _moved_by(self, force: np.ndarray) -> np.ndarray:
        """Return K⁻¹ times forces on the free components."""
        displacement = np.empty(len(self._free))
        self._factor.solve(force, displacement)
        return displacement

    def conforming(self, displacement: np.ndarray) -> np.ndarray:
        """Return the displacement itself: no node has copies."""
        return displacement

    def force(self, multiplier: np.ndarray) -> np.ndarray:
        """Return Bᵀλ, the reactions on all components, shape (torn_size,), [force]."""
        return np.asarray(self.torn.B.T @ multiplier)


class _Axes:
    """The axes of nodes along which components are held: those of the coordinates."""

    def turned(self, vector: np.ndarray) -> np.ndarray:
        """Return components along the axes."""
        return vector

    def back(self, turned: np.ndarray) -> np.ndarray:
        """Return components along the coordinates."""
        return turned

    def matrix(self, stiffness: sp.csr_matrix) -> sp.csr_matrix:
        """Return a matrix of components along the axes."""
        return stiffness

    def rows(self, B: sp.csr_matrix) -> sp.csr_matrix:
        """Return rows on components along the axes."""
        return B


@dataclass(frozen=True, eq=False)
class _TurnedAxes(_Axes):
    """Axes that are turned.

    `turn`: what turns vectors into them.
    """

    turn: sp.csr_matrix

    def turned(self, vector: np.ndarray) -> np.ndarray:
        return np.asarray(self.turn @ vector)

    def back(self, turned: np.ndarray) -> np.ndarray:
        return np.asarray(self.turn.T @ turned)

    def matrix(self, stiffness: sp.csr_matrix) -> sp.csr_matrix:
        return (self.turn @ stiffness @ self.turn.T).tocsr()

    def rows(self, B: sp.csr_matrix) -> sp.csr_matrix:
        return _rounded(B @ self.turn.T)


def _axes_of(torn: TornSystem) -> _Axes:
    """Return the axes of the nodes of the one subdomain."""
    axes = torn.decomposition.axes
    if not axes:
        return _Axes()
    (mesh,) = torn.decomposition.meshes
    block = np.argsort(mesh.nodes)[axes.nodes]  # the one body has all nodes, in blocks of another order
    order = np.argsort(block)
    return _TurnedAxes(LocalAxes(block[order], axes.axes[order]).matrix(len(mesh.nodes)))


def _rounded(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """Return a matrix of entries one without the rounding beside them."""
    result = sp.csr_matrix(matrix)
    result.data[np.abs(result.data) < 0.5] = 0.0
    result.eliminate_zeros()
    return result
