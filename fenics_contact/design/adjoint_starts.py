"""How accurately adjoints are solved."""

from __future__ import annotations

from fenics_contact.design.adjoint import WeakPoints


def adjoint_tolerance(
    tolerance: float,
    weak: WeakPoints,
    *,
    share: float = 10.0,
    most: float = 1e-4,
    sharp: float = 0.1,
) -> float:
    """Return the relative residual of the adjoint of a state with such a tolerance.

    It moves the gradient by about as much as the residual of the state does, and by less than twice itself:
    1e-5 at the default tolerance. Whoever compares gradients with difference quotients needs more accurate
    states, and their adjoints follow. Where points are between two statuses, and gradients of both branches
    are compared, adjoints are a hundred times as accurate. `share`: of the state's tolerance; `most`: no
    adjoint is less accurate; `sharp`: the share where points are between two statuses.
    """
    between_statuses, rounding = weak.contacts + weak.discs > 0, 1e-11
    return max(sharp * tolerance if between_statuses else min(share * tolerance, most), rounding)
