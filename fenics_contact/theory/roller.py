"""Profiles of rollers under which the pressure is the same all along the axis.

References:
    Lundberg, Elastische Berührung zweier Halbräume, Forsch. Geb. Ingenieurwes. 10 (1939), 201-211.
    Johns, Gohar, Roller bearings under radial and eccentric loads, Tribol. Int. 14 (1981), 131-136.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.theory.arguments import require_positive


def roller_relief(position: np.ndarray, length: float, half_width: float | None = None) -> np.ndarray:
    """Return the relief of a roller on a plane that makes its line load even, over A = w / (π E*).

    The line load w [force / length] acts on a half space. Under a line the surface sinks in the middle by
    A ln 1/(1 − (2y/l)²) more than at y, infinitely more than at the ends (Lundberg); under a strip with the
    pressure of Hertz over ±b, of constant width, at the ends by about A (1.1932 + ln l/(2b)).

    Args:
        position: y from the middle of the roller, between −l/2 and l/2, any shape, [length].
        length: Length l of the roller, [length].
        half_width: Hertz's half width b, [length]; None for a line.

    Returns:
        Relief over A, zero in the middle, infinite at the ends under a line.

    Raises:
        InvalidInputError: If a length is not positive or a position beyond the ends.

    Example:
        >>> import numpy as np
        >>> roller_relief(np.array([0.5, 0.9, 1.0]), 2.0, 0.1).round(4).tolist()
        [0.2862, 1.6082, 3.4967]
    """
    require_positive(length=length)
    relative = np.abs(np.asarray(position, dtype=float)) / (length / 2)
    if np.any(~(relative <= 1.0)):
        raise InvalidInputError(
            f"position must lie within half the length, {length / 2:g}, from the middle of the roller, got "
            f"{np.max(np.abs(position)):g}: measure it from there"
        )
    if half_width is None:
        with np.errstate(divide="ignore"):
            return np.asarray(-np.log1p(-(relative**2)))
    require_positive(half_width=half_width)
    # ∫ p/r along y is the sum of two areas sinh; over x = b sin t the midpoint rule avoids x = 0.
    step = np.pi / 2 / 4000
    angle = np.arange(0.5 * step, np.pi / 2, step)
    share, x = 4.0 / np.pi * step * np.cos(angle) ** 2, np.sin(angle) * half_width

    def sunk(y: np.ndarray) -> np.ndarray:
        ends = [np.arcsinh((length / 2 + sign * y[..., None]) / x) for sign in (-1.0, 1.0)]
        return np.asarray((ends[0] + ends[1]) @ share)

    return sunk(np.zeros(1))[0] - sunk(relative * length / 2)
