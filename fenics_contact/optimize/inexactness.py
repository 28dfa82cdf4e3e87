"""How accurately a function must be evaluated, and when the centre must be re-evaluated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.optimize.objective import Accuracy, Evaluation

#: Factor on the sufficient accuracy that is requested, so that not every step re-evaluates the centre.
_HEADROOM = 0.25
#: An unconfirmed centre is evaluated with errors smaller by this factor.
_CONFIRM = 0.1


@dataclass(frozen=True)
class Demand:
    """The errors that a decision tolerates.

    A trial is assessed by the difference of two values, a step of length ℓ by a subgradient. Errors of J must
    stay below share · w and those of the subgradient below part · w/ℓ, with w the predicted decrease or,
    where that is larger, the decrease that is not worth a step. No trial that raises J then becomes the
    centre, as long as twice the share is less than the ``descent`` of the method.

    Attributes:
        value: Largest error of J.
        subgradient: Largest relative error of the subgradient.

    References:
        K. C. Kiwiel, A proximal bundle method with approximate subgradient linearizations, SIAM J. Optim. 16
        (2006) 1007-1023. W. de Oliveira, C. Sagastizábal, C. Lemaréchal, Convex proximal bundle methods in
        depth: a unified analysis for inexact oracles, Math. Program. 148 (2014) 241-277.
    """

    value: float
    subgradient: float

    @property
    def asked(self) -> Accuracy:
        """Accuracy to request from the function."""
        return Accuracy(_HEADROOM * self.value, _HEADROOM * self.subgradient)

    def missed_by(self, centre: Evaluation) -> bool:
        """Return whether the centre must be re-evaluated, if that was not tried already."""
        value = centre.error > self.value and centre.asked_value > self.asked.value
        return value or centre.asked_subgradient > self.subgradient

    def confirmed_by(self, centre: Evaluation) -> bool:
        """Return whether a second evaluation has shown that the centre's subgradient is accurate enough."""
        return centre.turned <= self.subgradient / _CONFIRM or centre.asked_subgradient == 0.0

    def sharper_than(self, centre: Evaluation) -> Accuracy:
        """Return the accuracy for a re-evaluation of the centre."""
        value = min(self.asked.value, _CONFIRM * centre.asked_value)
        return Accuracy(value, min(self.asked.subgradient, _CONFIRM * centre.asked_subgradient))


def demand(worth: float, reach: float, norm: float, shares: tuple[float, float]) -> Demand:
    """Return the accuracy that a decision needs.

    Args:
        shares: Fractions of the decrease by which the value and the step's slope may be wrong.
    """
    slope = norm * reach
    return Demand(shares[0] * worth, min(shares[1] * worth / slope if slope > 0.0 else np.inf, 1.0))


def again(centre: Evaluation, evaluation: Evaluation) -> Evaluation:
    """Return the re-evaluated centre with the change of its subgradient since the first evaluation."""
    size = float(np.linalg.norm(evaluation.subgradient))
    change = float(np.linalg.norm(evaluation.subgradient - centre.subgradient))
    turned = change / size if size > 0.0 else (0.0 if change == 0.0 else np.inf)
    return replace(evaluation, turned=float(turned))
