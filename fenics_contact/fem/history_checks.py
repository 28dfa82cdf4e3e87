"""Checks on demand of a material with a history: whether it is what the solver takes it for."""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import HistoryMaterial, MaterialResponse

#: A quarter turn about each axis in succession.
_TURN = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def check_history_material(
    material: HistoryMaterial, size: float = 1e-3, duration: float = 1.0, tolerance: float = 1e-5
) -> None:
    """Check a material of your own at random displacement gradients, for two steps in succession.

    Newton's method converges slowly or not at all with a tangent that is not that of the stress, and nothing
    else would tell.

    Args:
        material: The material.
        size: Typical entry of the displacement gradients. Choose it such that about all happens that the
            model describes: some times the yield strain.
        duration: Of each step.
        tolerance: Largest difference between tangent and difference quotients, relative to the largest entry.

    Raises:
        InvalidInputError: If the unloaded material has stress or an unsymmetric tangent, "respond" changes
            its arguments, the answer of a point depends on others, the tangent is not the derivative of the
            stress, a model in large deformations notices rotations of the deformed body, or one in small
            strain notices rotations at all.
        UserCodeError: If "respond" raises.

    Example:
        >>> from fenics_contact.scene import J2Plasticity
        >>> check_history_material(J2Plasticity(2e5, 0.3, 200.0, isotropic_hardening=1e3), size=3e-3)
    """
    _ = material.moduli  # checks the unloaded material
    # Small gradients and large ones: some points stay elastic in a model with a threshold.
    share = np.geomspace(0.03, 1.0, 24)[:, None, None]
    first, second = size * share * np.random.default_rng(1).standard_normal((2, 24, 3, 3))
    history = np.zeros((24, material.history_size))
    for gradient in (first, first + 0.5 * second):
        end = _checked_step(material, gradient, history, duration)
        _check_tangent(material, gradient, history, duration, end, 1e-5 * size, tolerance)
        _check_rotation(material, gradient, history, duration, end)
        history = end.history


def _checked_step(
    material: HistoryMaterial, gradient: np.ndarray, history: np.ndarray, duration: float
) -> MaterialResponse:
    """Answer a step; check that arguments are left alone and points do not depend on each other."""
    name, given = type(material).__name__, (gradient.copy(), history.copy())
    end = material.answer(*given, duration)
    if not (np.array_equal(given[0], gradient) and np.array_equal(given[1], history)):
        raise InvalidInputError(
            f"respond of {name} must leave its arguments as they are, it has written into gradient or "
            "history: Newton's method asks again from the same start, so work on copies"
        )
    other = material.answer(gradient[::-1], history[::-1], duration)
    pairs = ((end.stress, other.stress), (end.tangent, other.tangent), (end.history, other.history))
    if not all(np.allclose(one, two[::-1], rtol=1e-9, atol=1e-12 * np.abs(one).max()) for one, two in pairs):
        raise InvalidInputError(
            f"respond of {name} must answer for each point by itself and alike when asked again, in "
            "reversed order its answers are others: take no sums or indices over points, and keep nothing in "
            "the object"
        )
    return end


def _check_tangent(
    material: HistoryMaterial,
    gradient: np.ndarray,
    history: np.ndarray,
    duration: float,
    end: MaterialResponse,
    step: float,
    tolerance: float,
) -> None:
    central, kinked = np.empty_like(end.tangent), np.zeros(len(gradient), dtype=bool)
    size = np.abs(end.tangent).max()
    for k, m in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[k, m] = step
        ahead, behind = (material.answer(gradient + s * change, history, duration).stress for s in (1, -1))
        central[..., k, m] = (ahead - behind) / (2 * step)
        kinked |= np.abs(ahead + behind - 2 * end.stress).max(axis=(1, 2)) > 1e-2 * step * size
    smooth = np.flatnonzero(~kinked)
    error = np.abs(end.tangent - central)[smooth]
    if len(smooth) and error.max() <= tolerance * size:
        return
    if not len(smooth):
        raise InvalidInputError(
            f"the stress of {type(material).__name__} must be a continuous function of the gradient, it has "
            "kinks or jumps at every point tried: check it, or give another size"
        )
    worst = error > 0.99 * error.max()  # the first of equals, whatever the rounding
    point, i, j, k, m = (int(place) for place in np.unravel_index(worst.argmax(), error.shape))
    wrong = np.count_nonzero(error.max(axis=(1, 2, 3, 4)) > tolerance * size)
    here = smooth[point], i, j, k, m
    raise InvalidInputError(
        f"the tangent of {type(material).__name__} must be the derivative of its stress for the same step, "
        f"it is not at {wrong} of {len(smooth)} points: dP[{i},{j}]/dH[{k},{m}] is {end.tangent[here]:.6g} "
        f"in the tangent and {central[here]:.6g} by difference quotients: differentiate the update of the "
        "step (consistent tangent), not the rate equations"
    )


def _check_rotation(
    material: HistoryMaterial,
    gradient: np.ndarray,
    history: np.ndarray,
    duration: float,
    end: MaterialResponse,
) -> None:
    name = type(material).__name__
    if material.finite:
        turned = _TURN @ (np.eye(3) + gradient) - np.eye(3)
        expected, needed = _TURN @ end.stress, "turn with the deformed body, P(Q F) = Q P(F)"
        remedy = "build it from C = FᵀF and rotated back tensors, or set finite = False for small strain"
    else:
        spin = np.abs(gradient).max() * (_TURN - _TURN.T)
        turned, expected = gradient + spin, end.stress
        needed = "depend on the symmetric part of the gradient alone"
        remedy = "use it, or set finite = True for large deformations"
    found = material.answer(turned, history, duration).stress
    error, size = np.abs(found - expected).max(), np.abs(end.stress).max()
    if not error <= 1e-6 * size:
        raise InvalidInputError(
            f"the stress of {name} (finite = {material.finite}) must {needed}, it misses that by "
            f"{error / size:.1e} of its largest entry: {remedy}"
        )
