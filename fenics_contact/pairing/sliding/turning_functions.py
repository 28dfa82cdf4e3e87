"""Functions that turn a patch about its edges and leave the edges where they are."""

from __future__ import annotations

import numpy as np

from fenics_contact.surfaces import corner_places


def turning_functions(local: np.ndarray, corners: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Evaluate two functions for each edge of a patch with 4 or 3 corners.

    They vanish on all edges. The derivatives of those of an edge are 3t(1 − t)² and 3t²(1 − t) across it, and
    zero across the others. With the coordinates b along the edge, from the end next to which it is steeper,
    and c across it, a function is

        3 b (1 − b)² c (1 − c)² w,  in triangles 3 b c (1 − b − c)² w,  w = b² / (b² + c²),

    so that each of two edges has the twist that it needs where they meet. First derivatives are continuous.

    Args:
        local: Local coordinates, shape (n, 2).
        corners: 4 or 3.

    Returns:
        Values, shape (n, 2 · corners), first derivatives, (n, 2 · corners, 2), and second ones, (n, 2 ·
        corners, 2, 2).

    References:
        H. Chiyokura, F. Kimura, Design of solids with free-form surfaces, Computer Graphics 17 (1983), with
        b and c in the blend for b² and c²: that has poles beside the patch.
    """
    start, slope = _coordinates(corners)
    b, c = start[:, :, None] + slope @ local.T  # one row for each function
    blend = _blend(b, c)
    product = _over_triangles(b, c) if corners == 3 else _over_quadrilaterals(b, c)
    value, d_b, d_c, d_bb, d_bc, d_cc = _product(product, blend)
    first = d_b[..., None] * slope[0][:, None] + d_c[..., None] * slope[1][:, None]
    bb, bc, cc = (np.einsum("ka,kb->kab", slope[i], slope[j])[:, None] for i, j in ((0, 0), (0, 1), (1, 1)))
    mixed = bc + np.swapaxes(bc, 2, 3)
    second = d_bb[..., None, None] * bb + d_bc[..., None, None] * mixed + d_cc[..., None, None] * cc
    return value.T, np.swapaxes(first, 0, 1), np.swapaxes(second, 0, 1)


def _coordinates(corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Return b and c at the origin, shape (2, 2 · corners), and their gradients, (2, 2 · corners, 2)."""
    place = corner_places(corners)
    along, across = np.roll(place, -1, axis=0) - place, np.roll(place, 1, axis=0) - place
    # Barycentric in triangles, from 0 to 1 in quadrilaterals: dual to the edge and the way across it.
    dual = np.linalg.inv(np.stack([along, across], axis=2))
    start = -np.einsum("eka,ea->ek", dual, place)
    t, c = (start[:, 0], dual[:, 0]), (start[:, 1], dual[:, 1])
    rest = (1.0 - t[0] - c[0], -t[1] - c[1]) if corners == 3 else (1.0 - t[0], -t[1])
    b = [np.stack([one, other], axis=1) for one, other in zip(t, rest, strict=True)]
    both = [np.repeat(each, 2, axis=0) for each in c]
    return (
        np.stack([b[0].ravel(), both[0]]),
        np.stack([b[1].reshape(-1, 2), both[1]]),
    )


_Jet = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _product(f: _Jet, g: _Jet) -> _Jet:
    """Return f g with its derivatives by b, c, bb, bc and cc."""
    return (
        f[0] * g[0],
        f[1] * g[0] + f[0] * g[1],
        f[2] * g[0] + f[0] * g[2],
        f[3] * g[0] + 2 * f[1] * g[1] + f[0] * g[3],
        f[4] * g[0] + f[1] * g[2] + f[2] * g[1] + f[0] * g[4],
        f[5] * g[0] + 2 * f[2] * g[2] + f[0] * g[5],
    )


def _over_quadrilaterals(b: np.ndarray, c: np.ndarray) -> _Jet:
    """Return 3 b (1 − b)² c (1 − c)²."""
    (f, f_b, f_bb), (g, g_c, g_cc) = ((x * (1 - x) ** 2, (1 - x) * (1 - 3 * x), 6 * x - 4) for x in (b, c))
    return 3 * f * g, 3 * f_b * g, 3 * f * g_c, 3 * f_bb * g, 3 * f_b * g_c, 3 * f * g_cc


def _over_triangles(b: np.ndarray, c: np.ndarray) -> _Jet:
    """Return 3 a² b c with a = 1 − b − c."""
    a = 1 - b - c
    return (
        3 * a**2 * b * c,
        3 * a * c * (a - 2 * b),
        3 * a * b * (a - 2 * c),
        6 * c * (b - 2 * a),
        3 * (a**2 - 2 * a * (b + c) + 2 * b * c),
        6 * b * (c - 2 * a),
    )


def _blend(b: np.ndarray, c: np.ndarray) -> _Jet:
    """Return b² / (b² + c²), zero with its derivatives at the corner itself."""
    whole = b**2 + c**2
    s = np.where(whole > 0.0, whole, 1.0)
    return (
        b**2 / s,
        2 * b * c**2 / s**2,
        -2 * b**2 * c / s**2,
        2 * c**2 * (c**2 - 3 * b**2) / s**3,
        4 * b * c * (b**2 - c**2) / s**3,
        -2 * b**2 * (b**2 - 3 * c**2) / s**3,
    )
