"""How Newton's method ended in the load steps of a history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.contact.deformed_state import DeformedState
from fenics_contact.contact.state import State
from fenics_contact.display import displayed

#: Near the end residuals may be what rounding and inexact systems leave: the best of this many steps counts.
LAST = 3


@displayed
@dataclass(frozen=True)
class NewtonSteps:
    """Residuals of Newton's method in load steps, in the last of the parts in which each was followed.

    Attributes:
        residuals: The worst residual after each Newton step, relative, one tuple for each load step.
    """

    residuals: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, states: Sequence[State]) -> NewtonSteps:
        """Return those of states with nonlinear materials; states from a checkpoint have none.

        Args:
            states: States after load steps.
        """
        runs = (state.equilibrium.effort.history for state in states if isinstance(state, DeformedState))
        return cls(tuple(tuple(line.residuals.worst for line in run) for run in runs if run))

    @property
    def reduction(self) -> np.ndarray:
        """Best residual reduction of the last three steps, shape (n,), dimensionless.

        Where Newton's method is superlinear it is small, the smaller the smaller the residual. Load steps of
        one Newton step, as of bodies that touch nothing, are left out.
        """
        ends = [np.array(end) for end in self._ends]
        return np.array([float((end[1:] / end[:-1]).min()) for end in ends])

    @property
    def _ends(self) -> list[tuple[float, ...]]:
        """The last residuals of load steps of several Newton steps."""
        return [run[-LAST - 1 :] for run in self.residuals if len(run) > 1]

    def __str__(self) -> str:
        """Return numbers of steps, the last residuals of the median load step, and the reductions."""
        reduction = self.reduction
        if not reduction.size:
            return "Newton's method: no load step with several steps"
        counts = [len(run) for run in self.residuals]
        usual = self._ends[int(np.argsort(reduction)[len(reduction) // 2])]
        ends = ", ".join(f"{value:.0e}" for value in usual)
        median, worst = f"{np.median(reduction):.0e}", f"{reduction.max():.0e}"
        return (
            f"Newton's method: {np.mean(counts):.1f} steps a load step, at most {max(counts)}; residuals at "
            f"the end of a median one {ends}; its best step leaves {median} of them, of the worst load step "
            f"{worst}"
        )
