"""Published nonsmooth test functions.

Every function returns its value and one subgradient: the gradient of the first piece that
attains the maximum, or the sign convention sign(0) = 1 for an absolute value.

References:
    L. Lukšan and J. Vlček, Test Problems for Nonsmooth Unconstrained and Linearly Constrained
    Optimization, Technical Report V-798, Institute of Computer Science, Academy of Sciences of
    the Czech Republic, 2000.
    M. M. Mäkelä and P. Neittaanmäki, Nonsmooth Optimization, World Scientific, 1992.
    W. Hock and K. Schittkowski, Test Examples for Nonlinear Programming Codes, Springer, 1981.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Fun = Callable[[Array], tuple[float, Array]]


def largest(values: Sequence[float] | Array, gradients: Sequence[ArrayLike] | Array) -> tuple[float, Array]:
    """Return the largest of several smooth pieces and its gradient."""
    which = int(np.argmax(values))
    return float(values[which]), np.array(gradients[which], dtype=float)


def sign(values: Array) -> Array:
    """Return ±1, with sign(0) = 1: one subgradient of the absolute value."""
    return np.where(values >= 0.0, 1.0, -1.0)


def cb2(x: Array) -> tuple[float, Array]:
    """Charalambous and Bandler 2: three smooth convex pieces."""
    a, b = x
    e = 2.0 * np.exp(b - a)
    return largest(
        [a**2 + b**4, (2 - a) ** 2 + (2 - b) ** 2, e],
        [[2 * a, 4 * b**3], [2 * (a - 2), 2 * (b - 2)], [-e, e]],
    )


def cb3(x: Array) -> tuple[float, Array]:
    """Charalambous and Bandler 3: as `cb2` with the powers exchanged."""
    a, b = x
    e = 2.0 * np.exp(b - a)
    return largest(
        [a**4 + b**2, (2 - a) ** 2 + (2 - b) ** 2, e],
        [[4 * a**3, 2 * b], [2 * (a - 2), 2 * (b - 2)], [-e, e]],
    )


def dem(x: Array) -> tuple[float, Array]:
    """Demyanov and Malozemov: two planes and a paraboloid."""
    a, b = x
    return largest([5 * a + b, -5 * a + b, a**2 + b**2 + 4 * b], [[5, 1], [-5, 1], [2 * a, 2 * b + 4]])


def ql(x: Array) -> tuple[float, Array]:
    """Quadratic objective with two linear constraints in an exact penalty."""
    a, b = x
    q = a**2 + b**2
    return largest(
        [q, q + 10 * (-4 * a - b + 4), q + 10 * (-a - 2 * b + 6)],
        [[2 * a, 2 * b], [2 * a - 40, 2 * b - 10], [2 * a - 10, 2 * b - 20]],
    )


def lq(x: Array) -> tuple[float, Array]:
    """Linear objective over the unit disc, the disc in an exact penalty."""
    a, b = x
    return largest([-a - b, -a - b + a**2 + b**2 - 1], [[-1, -1], [-1 + 2 * a, -1 + 2 * b]])


def mifflin1(x: Array) -> tuple[float, Array]:
    """Steep valley along the unit circle."""
    a, b = x
    return largest([-a, -a + 20 * (a**2 + b**2 - 1)], [[-1, 0], [-1 + 40 * a, 40 * b]])


def mifflin2(x: Array) -> tuple[float, Array]:
    """Nonconvex along the unit circle."""
    a, b = x
    c = a**2 + b**2 - 1
    k = 2 * (2 + 1.75 * (1.0 if c >= 0 else -1.0))
    return float(-a + 2 * c + 1.75 * abs(c)), np.array([-1 + k * a, k * b])


def rosen_suzuki(x: Array) -> tuple[float, Array]:
    """Rosen and Suzuki's quadratic programme in an exact penalty."""
    a, b, c, d = x
    f = a**2 + b**2 + 2 * c**2 + d**2 - 5 * a - 5 * b - 21 * c + 7 * d
    g = np.array([2 * a - 5, 2 * b - 5, 4 * c - 21, 2 * d + 7])
    limits = [
        a**2 + b**2 + c**2 + d**2 + a - b + c - d - 8,
        a**2 + 2 * b**2 + c**2 + 2 * d**2 - a - d - 10,
        2 * a**2 + b**2 + c**2 + 2 * a - b - d - 5,
    ]
    slopes = [
        [2 * a + 1, 2 * b - 1, 2 * c + 1, 2 * d - 1],
        [2 * a - 1, 4 * b, 2 * c, 4 * d - 1],
        [4 * a + 2, 2 * b - 1, 2 * c, -1],
    ]
    return largest([f, *(f + 10 * v for v in limits)], [g, *(g + 10 * np.array(s) for s in slopes)])


_SHOR_CENTRES = np.array(
    [
        [0, 0, 0, 0, 0],
        [2, 1, 1, 1, 3],
        [1, 2, 1, 1, 2],
        [1, 4, 1, 2, 2],
        [3, 2, 1, 0, 1],
        [0, 2, 1, 0, 1],
        [1, 1, 1, 1, 1],
        [1, 0, 1, 2, 1],
        [0, 0, 2, 1, 0],
        [1, 1, 2, 0, 0],
    ],
    dtype=float,
)
_SHOR_WEIGHTS = np.array([1, 5, 10, 2, 4, 3, 1.7, 2.5, 6, 3.5])


def shor(x: Array) -> tuple[float, Array]:
    """Largest of ten weighted squared distances."""
    away = x - _SHOR_CENTRES
    return largest(_SHOR_WEIGHTS * (away**2).sum(axis=1), 2 * _SHOR_WEIGHTS[:, None] * away)


def _maxquad_data() -> tuple[Array, Array]:
    i, j, k = np.ogrid[1:11, 1:11, 1:6]
    upper = np.where(i < j, np.exp(i / j) * np.cos(i * j) * np.sin(k), 0.0)
    matrices = upper + upper.transpose(1, 0, 2)
    diagonal = (i / 10 * np.abs(np.sin(k)))[:, 0] + np.abs(matrices).sum(axis=1)
    matrices[np.arange(10), np.arange(10)] = diagonal
    return matrices.transpose(2, 0, 1), (np.exp(i / k) * np.sin(i * k))[:, 0].T


_MAXQUAD_A, _MAXQUAD_B = _maxquad_data()


def maxquad(x: Array) -> tuple[float, Array]:
    """Lemaréchal's largest of five quadratics in ten variables."""
    product = _MAXQUAD_A @ x
    return largest(product @ x - _MAXQUAD_B @ x, 2 * product - _MAXQUAD_B)


def maxq(x: Array) -> tuple[float, Array]:
    """Largest of the squares."""
    k = int(np.argmax(x**2))
    return float(x[k] ** 2), 2 * x[k] * np.eye(x.size)[k]


def maxl(x: Array) -> tuple[float, Array]:
    """Largest of the absolute values."""
    k = int(np.argmax(np.abs(x)))
    return float(abs(x[k])), sign(x)[k] * np.eye(x.size)[k]


def goffin(x: Array) -> tuple[float, Array]:
    """Largest component against the mean: a polyhedral cone, unbounded valley."""
    k = int(np.argmax(x))
    return float(x.size * x[k] - x.sum()), x.size * np.eye(x.size)[k] - 1.0


def mxhilb(x: Array) -> tuple[float, Array]:
    """Largest absolute value of Hilbert matrix times x."""
    i = np.arange(x.size)
    hilbert = 1.0 / (i[:, None] + i + 1)
    y = hilbert @ x
    k = int(np.argmax(np.abs(y)))
    return float(abs(y[k])), sign(y)[k] * hilbert[k]


def wolfe(x: Array) -> tuple[float, Array]:
    """Wolfe's function, on which steepest descent stops at a point that is no minimum."""
    a, b = x
    s = 1.0 if b >= 0 else -1.0
    if a >= abs(b):
        root = np.sqrt(9 * a**2 + 16 * b**2)
        gradient = np.array([9 * a, 16 * b]) * (5 / root if root > 0 else 0.0)
        return float(5 * root), gradient
    if a > 0:
        return float(9 * a + 16 * abs(b)), np.array([9.0, 16 * s])
    return float(9 * a + 16 * abs(b) - a**9), np.array([9 - 9 * a**8, 16 * s])


def crescent(x: Array) -> tuple[float, Array]:
    """Nonconvex: a curved narrow valley between two circles."""
    a, b = x
    q = a**2 + (b - 1) ** 2
    return largest([q + b - 1, -q + b + 1], [[2 * a, 2 * (b - 1) + 1], [-2 * a, -2 * (b - 1) + 1]])


def rosenbrock(x: Array) -> tuple[float, Array]:
    """Smooth and nonconvex: the curved valley."""
    a, b = x
    c = b - a**2
    return float(100 * c**2 + (1 - a) ** 2), np.array([-400 * a * c - 2 * (1 - a), 200 * c])


_COLVILLE_E = np.array([-15.0, -27, -36, -18, -12])
_COLVILLE_D = np.array([4.0, 8, 10, 6, 2])
_COLVILLE_C = np.array(
    [
        [30.0, -20, -10, 32, -10],
        [-20, 39, -6, -31, 32],
        [-10, -6, 10, -6, -10],
        [32, -31, -6, 39, -20],
        [-10, 32, -10, -20, 30],
    ]
)
COLVILLE_A = np.array(
    [
        [-16.0, 2, 0, 1, 0],
        [0, -2, 0, 0.4, 2],
        [-3.5, 0, 2, 0, 0],
        [0, -2, 0, -4, -1],
        [0, -9, -2, 1, -2.8],
        [2, 0, -4, 0, 0],
        [-1, -1, -1, -1, -1],
        [-1, -2, -3, -2, -1],
        [1, 2, 3, 4, 5],
        [1, 1, 1, 1, 1],
    ]
)
COLVILLE_B = np.array([-40, -2, -0.25, -4, -4, -1, -40, -60, 5, 1])


def hs86(x: Array) -> tuple[float, Array]:
    """Colville's cubic (Hock and Schittkowski 86); its rows are COLVILLE_A x ≥ COLVILLE_B."""
    product = _COLVILLE_C @ x
    value = _COLVILLE_D @ x**3 + x @ product + _COLVILLE_E @ x
    return float(value), 3 * _COLVILLE_D * x**2 + 2 * product + _COLVILLE_E


def colville1(x: Array) -> tuple[float, Array]:
    """`hs86` with the worst violated row in an exact penalty."""
    value, gradient = hs86(x)
    violation = COLVILLE_B - COLVILLE_A @ x
    worst = int(np.argmax(violation))
    if violation[worst] <= 0:
        return value, gradient
    return value + 50 * float(violation[worst]), gradient - 50 * COLVILLE_A[worst]


def hs78(x: Array) -> tuple[float, Array]:
    """Hock and Schittkowski 78, its equations in an exact penalty: nonconvex."""
    a, b, c, d, e = x
    h = np.array([x @ x - 10, b * c - 5 * d * e, a**3 + b**3 + 1])
    slopes = np.array([2 * x, [0, c, b, -5 * e, -5 * d], [3 * a**2, 3 * b**2, 0, 0, 0]])
    product = np.array([b * c * d * e, a * c * d * e, a * b * d * e, a * b * c * e, a * b * c * d])
    return float(np.prod(x) + 10 * np.abs(h).sum()), product + 10 * sign(h) @ slopes


def el_attar(x: Array) -> tuple[float, Array]:
    """El-Attar, Vidyasagar and Dutta: fit of 51 values in the 1-norm, nonconvex."""
    t = 0.1 * np.arange(51)
    y = 0.5 * np.exp(-t) - np.exp(-2 * t) + 0.5 * np.exp(-3 * t)
    y += 1.5 * np.exp(-1.5 * t) * np.sin(7 * t) + np.exp(-2.5 * t) * np.sin(5 * t)
    decay, second = np.exp(-x[1] * t), np.exp(-x[5] * t)
    cosine, sine = np.cos(x[2] * t + x[3]), np.sin(x[2] * t + x[3])
    misfit = x[0] * decay * cosine + x[4] * second - y
    swing = -x[0] * decay * sine
    columns = [decay * cosine, -t * x[0] * decay * cosine, t * swing, swing, second, -t * x[4] * second]
    return float(np.abs(misfit).sum()), np.array(columns) @ sign(misfit)


def mad1(x: Array) -> tuple[float, Array]:
    """Madsen and Schjaer-Jacobsen 1 and 2: nonconvex pieces, one linear constraint."""
    a, b = x
    return largest(
        [a**2 + b**2 + a * b - 1, np.sin(a), -np.cos(b)],
        [[2 * a + b, 2 * b + a], [np.cos(a), 0], [0, np.sin(b)]],
    )


def mad4(x: Array) -> tuple[float, Array]:
    """Madsen and Schjaer-Jacobsen 4 and 5."""
    a, b = x
    e = np.exp(a - b)
    return largest([-e, np.sinh(a - 1) - 1, -np.log(b) - 1], [[-e, e], [np.cosh(a - 1), 0], [0, -1 / b]])


def pentagon(x: Array) -> tuple[float, Array]:
    """Three points in a pentagon, as far from each other as they can be: nonconvex."""
    p = x.reshape(3, 2)
    away = p - np.roll(p, -1, axis=0)
    lengths = np.sqrt((away**2).sum(axis=1))
    k = int(np.argmin(lengths))
    gradient = np.zeros((3, 2))
    gradient[k] -= away[k] / lengths[k]
    gradient[(k + 1) % 3] += away[k] / lengths[k]
    return float(-lengths[k]), gradient.ravel()
