"""Effect of an inexact state on the objective: its residuals weighted by the adjoint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.contact import State
from fenics_contact.qp import STEEP, ContactLayout, FeasibleSet
from fenics_contact.shape.adjoint import Adjoint
from fenics_contact.shape.linearised_face import LinearisedFace
from fenics_contact.shape.objective import Partials


@dataclass(frozen=True)
class StateError:
    """First-order error of an objective at an inexact state, units of the objective.

    Attributes:
        correction: Difference of the value at the exact state, to first order.
        spread: √Σ (share of a row or disc)², which does not vanish where shares of both signs cancel.
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
    r"""Return the effect of a state's residuals on the objective. Collective; no product.

    The state is u = K⁺(f − Bᵀλ) + R α. Its residuals are r = −(B u − c) along the test directions of the
    face, to which a slipping disc adds κ s, with the part s of its force across the slip: there the law
    requires r + κ s = 0 (`Face.curvature`); the balance G λ − e of the bodies; and n = λ − P_Λ(λ − ρ r) off
    the face, where the law prescribes the multiplier. One step of Newton's method on the face would remove
    all of it; along it the objective changes by

        δJ = ζᵀ r + zᵀ κ s − βᵀ(G λ − e) − (∂J/∂λ − B w)ᵀ n_off,

    with the adjoint w, ζ = Z_s z and β. The error of J + δJ is of second order, as long as the face is the
    right one.

    Args:
        unbalanced: Shares βᵀ(G λ − e) of forces out of balance.

    References:
        R. Becker, R. Rannacher, An optimal control approach to a posteriori error estimation in finite
        element methods, Acta Numer. 10 (2001) 1-102. M. B. Giles, E. Süli, ibid. 11 (2002) 145-236.
    """
    torn, rows, layout = state.torn, state.rows, state.torn.layout
    trial = rows.multiplier - rows.step * rows.residual
    miss = rows.multiplier - FeasibleSet(layout, rows.slip_bound).project(trial)
    slope = partials.by_multiplier - torn.jump(adjoint.displacement)
    tested = rows.residual + _bent(linearised, rows.multiplier)
    shares = adjoint.multiplier * tested - slope * _off_face(miss, linearised, layout)
    discs = shares[layout.tangential].sum(axis=1)
    single = np.concatenate([shares[layout.equality], shares[layout.normal], discs])
    total, squares = torn.decomposition.comm.allreduce(np.array([single.sum(), single @ single]))
    return StateError(float(total - unbalanced.sum()), float(np.sqrt(squares + unbalanced @ unbalanced)))


def _bent(linearised: LinearisedFace, multiplier: np.ndarray) -> np.ndarray:
    """Return κ s across the slip of slipping discs, zero in all other rows, owned."""
    across = linearised.face.curvature * linearised.face.restrict(multiplier)
    return np.asarray(linearised.face.prolong(across))


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
