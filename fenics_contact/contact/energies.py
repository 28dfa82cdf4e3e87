"""Energies of a state, primal and dual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.feti import TornSystem


@dataclass(frozen=True)
class Energies:
    """Energies of all bodies, [force · length].

    Attributes:
        strain: Stored energy, of linear materials ½ uᵀK u; NaN where materials dissipate.
        load: Work of the loads, of dead ones fᵀu; NaN where pressures follow their surfaces.
        friction: Σ Ψ ‖slip‖, the dissipation by friction if the whole load step acts at once: what slips to
            and fro within it counts by where it ends, take more load steps and add up. Where parts of a step
            have histories of their own (`AutomaticSteps.finer_history`), the sum over these.
        dual: Value of the dual functional, −½ (f − Bᵀλ)ᵀK⁺(f − Bᵀλ) − λᵀc; None for nonlinear materials.
    """

    strain: float
    load: float
    friction: float
    dual: float | None = None

    @property
    def norm(self) -> float:
        """Energy norm of the displacement, √(uᵀK u), [√(force · length)]."""
        return float(np.sqrt(max(2.0 * self.strain, 0.0)))

    @property
    def total_potential(self) -> float:
        """The stored energy less the work of the loads."""
        return self.strain - self.load

    @property
    def primal(self) -> float:
        """Functional that the displacement minimises for given slip bounds, total potential plus friction."""
        return self.total_potential + self.friction

    def __str__(self) -> str:
        """List the energies, one per line."""
        names = ("strain", "load", "friction", "total_potential", "primal", "dual")
        known = [(name, getattr(self, name)) for name in names if getattr(self, name) is not None]
        return "\n".join(f"{name.replace('_', ' '):16s}{value:14.6e}" for name, value in known)


def compute_energies(
    torn: TornSystem,
    displacement: np.ndarray,
    multiplier: np.ndarray,
    friction: float,
    rigid: np.ndarray | float = 0.0,
) -> Energies:
    """Compute all energies. Collective.

    Args:
        torn: The torn system.
        displacement: Torn displacement of this rank, [length].
        multiplier: λ, owned, [force].
        friction: Σ Ψ ‖slip‖ of all ranks.
        rigid: Rigid motions R α in the displacement: they cause no strain, but forces that are slightly out
            of balance do work on them.
    """
    internal = torn.load - torn.force(multiplier)  # = K u
    strained = 0.5 * internal @ (displacement - rigid)
    mine = np.array([strained, multiplier @ torn.right])
    strain, prescribed = (float(total) for total in torn.numbering.comm.allreduce(mine))
    return Energies(strain, torn.load_work(displacement), friction, -strain - prescribed)
