"""Energies of a state, primal and dual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.feti import DirectSystem, DualSystem


@dataclass(frozen=True)
class Energies:
    """Energies of all bodies, [force · length].

    Attributes:
        strain: ½ uᵀK u.
        load: Work of the loads, fᵀu.
        friction: Σ Ψ ‖slip‖, the dissipation by friction if the whole load step acts at once: what slips to
            and fro within it counts by where it ends, take more load steps and add up. Where parts of a step
            have histories of their own (`AutomaticSteps.finer_history`), the sum over these.
        dual: Value of the dual functional, −½ (f − Bᵀλ)ᵀK⁺(f − Bᵀλ) − λᵀc.
    """

    strain: float
    load: float
    friction: float
    dual: float

    @property
    def norm(self) -> float:
        """Energy norm of the displacement, √(uᵀK u), [√(force · length)]."""
        return float(np.sqrt(max(2.0 * self.strain, 0.0)))

    @property
    def total_potential(self) -> float:
        """½ uᵀK u − fᵀu."""
        return self.strain - self.load

    @property
    def primal(self) -> float:
        """Functional that the displacement minimises for given slip bounds, total potential plus friction."""
        return self.total_potential + self.friction

    def __str__(self) -> str:
        """List the energies, one per line."""
        names = ("strain", "load", "friction", "total_potential", "primal", "dual")
        return "\n".join(f"{name.replace('_', ' '):16s}{getattr(self, name):14.6e}" for name in names)


def compute_energies(
    system: DualSystem | DirectSystem,
    displacement: np.ndarray,
    multiplier: np.ndarray,
    friction: float,
    rigid: np.ndarray | float = 0.0,
) -> Energies:
    """Compute all energies. Collective.

    Args:
        system: The solved system.
        displacement: Torn displacement of this rank, [length].
        multiplier: λ, owned, [force].
        friction: Σ Ψ ‖slip‖ of all ranks.
        rigid: Rigid motions R α in the displacement: they cause no strain, but forces that are slightly out
            of balance do work on them.
    """
    torn = system.torn
    internal = torn.load - system.force(multiplier)  # = K u
    strained = 0.5 * internal @ (displacement - rigid)
    mine = np.array([strained, multiplier @ torn.right])
    strain, prescribed = (float(total) for total in torn.numbering.comm.allreduce(mine))
    return Energies(strain, torn.load_work(displacement), friction, -strain - prescribed)
