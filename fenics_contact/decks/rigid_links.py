"""Surfaces of several bodies that one node drives: further ones follow the rigid surface of the first."""

from __future__ import annotations

import numpy as np

from fenics_contact._scene.constraints import ConstraintTerm, LinearConstraint


def spread_out(points: np.ndarray, near: float = 1e-9) -> np.ndarray:
    """Return numbers of points, (n, dim), that are not in a line or plane unless all are: at most dim + 1."""
    away = points - points.mean(axis=0)
    chosen = [int(np.argmax(np.einsum("nd,nd->n", away, away)))]
    away = points - points[chosen[0]]
    size = float(np.linalg.norm(away, axis=1).max())
    while len(chosen) <= points.shape[1]:
        off = np.linalg.norm(away, axis=1)
        if off.max() <= near * size:
            break
        chosen.append(int(np.argmax(off)))
        along = away[chosen[-1]] / off.max()
        away = away - np.outer(away @ along, along)
    return np.array(chosen)


def in_their_space(points: np.ndarray, others: np.ndarray, near: float = 1e-9) -> np.ndarray | None:
    """Return the weights with the sum one by which points are means of others, if all are, or None.

    These keep their meaning in every rotation, however large.
    """
    size = float(np.ptp(np.concatenate([points, others]), axis=0).max()) or 1.0
    ones = np.ones((1, len(others)))
    system = np.vstack([(others - others[0]).T / size, ones])
    wanted = np.vstack([(points - others[0]).T / size, np.ones((1, len(points)))])
    weights = np.linalg.lstsq(system, wanted, rcond=None)[0]
    return np.asarray(weights.T) if np.abs(system @ weights - wanted).max() <= near else None


def by_small_turns(points: np.ndarray, others: np.ndarray) -> np.ndarray | None:
    """Return how points move with others of a rigid piece that turns little, (n, dim, m, dim), or None.

    None if the others are in a line, so that they do not show all of its motions.
    """
    at, dim = others.mean(axis=0), points.shape[1]
    size = float(np.abs(others - at).max()) or 1.0

    def motions(places: np.ndarray) -> np.ndarray:
        arms = np.pad((places - at) / size, ((0, 0), (0, 3 - dim)))
        axes = np.eye(3) if dim == 3 else np.eye(3)[2:]
        columns = [np.tile(axis, (len(places), 1)) for axis in np.eye(dim)]
        columns += [np.cross(axis, arms)[:, :dim] for axis in axes]
        return np.stack([column.ravel() for column in columns], axis=1)

    known = motions(others)
    if np.linalg.matrix_rank(known, 1e-9 * len(others)) < known.shape[1]:
        return None
    return np.asarray((motions(points) @ np.linalg.pinv(known)).reshape(*points.shape, len(others), dim))


def following(
    name: str, body: str, nodes: np.ndarray, first: str, leaders: np.ndarray, moved: np.ndarray
) -> LinearConstraint:
    """Return that nodes of a body move with others: u = Σ A u_leader.

    `leaders`: nodes of body `first`; `moved`: A, (n, components, m, dim).
    """
    count, parts, width, dim = moved.shape
    axes = np.tile(np.eye(dim)[-parts:], (count, 1))
    own = ConstraintTerm(body, np.repeat(nodes, parts), axes, 1.0, np.arange(count * parts))
    number = np.repeat(np.arange(count * parts), width)
    theirs = ConstraintTerm(first, np.tile(leaders, count * parts), moved.reshape(-1, dim), -1.0, number)
    return LinearConstraint([own, theirs], name=name)
