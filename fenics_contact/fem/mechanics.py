"""What every mesh with materials of nonlinear stress offers: internal forces and tangent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True, eq=False)
class Response:
    """What a mesh with nonlinear materials answers to a displacement.

    Where cells are turned inside out, `least_jacobian` says so and the other numbers mean nothing; with most
    models they are NaN.

    Attributes:
        force: Internal force f(u), by dof, shape (dim n,), [force].
        tangent: Assembles `stiffness`.
        energy: Stored energy, [force · length]; None where materials dissipate.
        least_jacobian: Smallest det F at a Gauss point; 0 or less is an inverted cell.
        history: Internal variables at the end of the step, shape (n_cells, n_gauss, k); None without any.
        stress: Cauchy stress at the Gauss points of materials with a history, [force / length²], shape
            (n_cells, n_gauss, 3, 3), NaN in cells of other materials; None without any.
    """

    force: np.ndarray
    tangent: Callable[[], sp.csr_matrix]
    energy: float | None
    least_jacobian: float
    history: np.ndarray | None = None
    stress: np.ndarray | None = None

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """Tangent ∂f/∂u, shape (dim n, dim n), [force / length]; assembled on first use."""
        return self.tangent()


class Mechanics(Protocol):
    """Internal forces and tangent of one mesh with nonlinear materials."""

    def at(
        self,
        displacement: np.ndarray,
        history: np.ndarray | None = None,
        duration: float = np.nan,
        origin: np.ndarray | None = None,
    ) -> Response:
        """Return the response to a displacement.

        Args:
            displacement: By dof of the mesh's space, block after block, shape (dim n,), [length].
            history: Internal variables at the start of the step, for materials that have some, shape
                (n_cells, n_gauss, k) by the mesh's cells; None for an unloaded body.
            duration: Of the step; NaN where it is not known, which materials that need it refuse.
            origin: Displacement at the start of the Newton step that led here, None where there was none:
                tangents of mean dilatations have the pressures that this step foresaw.
        """

    def least_jacobian(self, displacement: np.ndarray) -> float:
        """Return the smallest det F at a Gauss point, which takes no assembly."""
