"""Material points driven by given strains or in uniaxial stress, and difference quotients of their stress."""

from __future__ import annotations

import numpy as np

from fenics_contact.materials import HistoryMaterial, MaterialResponse

#: A quarter turn about z.
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def deformations(size: float, n: int = 20, seed: int = 1) -> np.ndarray:
    """Return random displacement gradients, shape (n, 3, 3)."""
    return size * np.random.default_rng(seed).standard_normal((n, 3, 3))


def at_rest(material: HistoryMaterial, n: int = 1) -> np.ndarray:
    """Return the history of n points of an unloaded body."""
    return np.zeros((n, material.history_size))


def quotients(
    material: HistoryMaterial, gradient: np.ndarray, history: np.ndarray, step: float
) -> np.ndarray:
    """Return central difference quotients of the stress, shape (n, 3, 3, 3, 3)."""
    tangent = np.empty((*gradient.shape, 3, 3))
    for k, m in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[k, m] = step
        ahead, behind = (material.answer(gradient + s * change, history, 0.0).stress for s in (1, -1))
        tangent[..., k, m] = (ahead - behind) / (2 * step)
    return tangent


def tangent_error(material: HistoryMaterial, gradient: np.ndarray, history: np.ndarray, step: float) -> float:
    """Return the largest difference between tangent and quotients, relative to the largest entry."""
    tangent = material.answer(gradient, history, 0.0).tangent
    return float(np.abs(tangent - quotients(material, gradient, history, step)).max() / np.abs(tangent).max())


def in_tension(material: HistoryMaterial, stretches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drive a point in uniaxial stress along x; lateral strains by Newton's method.

    Args:
        material: The material.
        stretches: ∂u_x/∂x at the end of each step.

    Returns:
        P_xx and the history at the end of each step.
    """
    history, gradient = at_rest(material), np.zeros((1, 3, 3))
    stresses, histories = [], []
    for stretch in stretches:
        gradient[0, 0, 0] = stretch
        for _ in range(40):
            end: MaterialResponse = material.answer(gradient, history, 0.0)
            lateral = end.stress[0, [1, 2], [1, 2]]
            if np.abs(lateral).max() < 1e-12 * np.abs(end.tangent).max():
                break
            slope = end.tangent[0][[[1], [2]], [[1], [2]], [1, 2], [1, 2]]
            gradient[0, [1, 2], [1, 2]] -= np.linalg.solve(slope, lateral)
        else:
            raise AssertionError("no lateral strains were found")
        history = end.history
        stresses.append(end.stress[0, 0, 0])
        histories.append(history[0])
    return np.array(stresses), np.array(histories)
