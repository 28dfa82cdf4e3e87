"""Places of plane bodies where stiff and soft materials cross, which need far smaller cells than others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigvalsh

from fenics_contact._adaptive.refined_scene import SceneRefinement, refined_again
from fenics_contact._scene.body import Body
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.supports import AnySupport
from fenics_contact.materials.elastic import isotropic_constants
from fenics_contact.mesh.cell_types import CELL_TYPES


def refined_at_crossings(found: SceneRefinement, halvings: int = 3) -> SceneRefinement:
    """Halve the cells around the crossings of plane bodies some more times.

    Displacements at a crossing grow with a small power α of the distance, by Young's moduli 100:1 with about
    0.15, and halving the cells there leaves 2^(−2α) of the error, four fifths. Estimates see little of it, as
    stresses next to it are even: where cells became smaller at the rate of others, what `solve_to` stated was
    half of the error. A crossing is a node, and these cells are few.
    """

    def around(scene: Scene) -> Mapping[str, np.ndarray]:
        return {name: around_crossings(body, _of(name, scene.supports)) for name, body in _bodies(scene)}

    return refined_again(found, around, halvings)


def around_crossings(body: Body, supports: Sequence[AnySupport] = (), finest: float = 1e-7) -> np.ndarray:
    """Return the cells around the crossings of a body, see `Crossings`.

    None of quadratic quadrilaterals, which are halved all together. `finest`: width of cells that are not
    halved any more, relative to it.
    """
    mesh = body.mesh
    if mesh.order > 1 and not CELL_TYPES[mesh.cell_type].is_simplex:
        return np.zeros(0, dtype=np.int64)
    at_crossings = np.isin(mesh.cells, Crossings.of(body, supports).nodes).any(axis=1)
    return np.flatnonzero(at_crossings & (_widths(body) > finest))


def left_at_crossings(scene: Scene) -> float:
    """Return (h/L)^2α of the crossing where it is largest, 0 without crossings.

    What cells of the width h there miss of an energy, or of a quantity whose adjoint is as singular as the
    state, is proportional to it; L is the size of the body.
    """
    left = [0.0]
    for name, body in _bodies(scene):
        found, widths = Crossings.of(body, _of(name, scene.supports)), _widths(body)
        for node, exponent in zip(found.nodes, found.exponents, strict=True):
            width = widths[(body.mesh.cells == node).any(axis=1)].max()
            left.append(float(width ** (2.0 * exponent)))
    return max(left)


def _bodies(scene: Scene) -> Sequence[tuple[str, Body]]:
    return list(scene.deforming.items())


def _of(name: str, supports: Sequence[AnySupport]) -> list[AnySupport]:
    return [each for each in supports if each.body == name]


def _widths(body: Body) -> np.ndarray:
    """Return the width of each cell relative to the body, (n_cells,)."""
    mesh = body.mesh
    widths = np.ptp(mesh.points[mesh.cells], axis=1).max(axis=1)
    return np.asarray(widths / np.ptp(mesh.points, axis=0).max())


@dataclass(frozen=True, eq=False)
class Crossings:
    """Nodes of a plane body around which stiff and soft sectors alternate.

    Fixed surfaces are rigid sectors, free ones soft: where a support ends at a soft material, and a stiff one
    begins there, both are held together by the material next to that node alone. `exponents`: for each the
    least α > 0 for which r^α φ(θ) with the power of the distance r solves ∇·(E ∇u) = 0 around it, with
    Young's modulus E, u = 0 on fixed surfaces and no flux through free ones: (4/π) arctan(1/√c) where four
    squares with the moduli 1:c alternate. Displacements of plane elasticity grow with a similar power. Shape
    (n,).
    """

    nodes: np.ndarray
    exponents: np.ndarray

    @classmethod
    def of(cls, body: Body, supports: Sequence[AnySupport], largest: float = 0.39) -> Crossings:
        """Return those of a body: none in space, where they are lines, or of materials without E.

        `largest`: exponent above which a node is none, that of four squares with the moduli 1:10. Estimates
        see the errors of others, as of corners.
        """
        constants = [isotropic_constants(material) for material in body.materials]
        if body.mesh.dim != 2 or len(constants) < 2 or None in constants:
            return cls(np.zeros(0, dtype=np.int64), np.zeros(0))
        stiffness = np.array([each[0] for each in constants if each is not None])[body.material_of_cells]
        edges = body.mesh.cells[:, [face[:2] for face in CELL_TYPES[body.mesh.cell_type].faces]]
        candidates = _candidates(edges, stiffness)
        near = np.flatnonzero(np.isin(edges, candidates).any(axis=(1, 2)))
        fixed, points = _fixed(body, supports), body.mesh.points
        found = np.array([_exponent(n, points, edges[near], stiffness[near], fixed) for n in candidates])
        small = found < largest
        return cls(candidates[small], found[small])


def _candidates(edges: np.ndarray, stiffness: np.ndarray, contrast: float = 2.0) -> np.ndarray:
    """Return the nodes of several materials in which more than two edges between them meet.

    Edges of one cell alone count, too: they lie on the boundary, or smaller cells are on the other side.
    `contrast`: least ratio of the stiffness on both sides of an edge, and around a node.
    """
    ends, of_edges = np.sort(edges.reshape(-1, 2), axis=1), np.repeat(stiffness, edges.shape[1])
    alike, number = np.unique(ends, axis=0, return_inverse=True)
    softest, hardest = _extremes(number.ravel(), of_edges, len(alike))
    counts = (np.bincount(number.ravel()) == 1) | (hardest >= contrast * softest)
    softest, hardest = _extremes(ends.T.ravel(), np.tile(of_edges, 2), int(ends.max()) + 1)
    meeting = np.bincount(alike[counts].ravel(), minlength=len(softest))
    return np.flatnonzero((meeting > 2) & (hardest >= contrast * softest))


def _extremes(place: np.ndarray, values: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest value at each place, inf and 0 where there is none."""
    least, largest = np.full(size, np.inf), np.zeros(size)
    np.minimum.at(least, place, values)
    np.maximum.at(largest, place, values)
    return least, largest


def _fixed(body: Body, supports: Sequence[AnySupport]) -> np.ndarray:
    """Return the ends of the facets that supports move as rigid pieces, (n, 2)."""
    rigid = [each for each in supports if each.holds(body.components).all()]
    facets = [body.mesh.surfaces[each.surface] for each in rigid if each.surface in body.mesh.surfaces]
    return np.concatenate([np.zeros((0, 2), dtype=np.int64), *(each[:, :2] for each in facets)])


def _exponent(
    node: int, points: np.ndarray, edges: np.ndarray, stiffness: np.ndarray, fixed: np.ndarray
) -> float:
    """Return the exponent of a node, see `Crossings`.

    `edges`, `stiffness`: of cells around, (n_cells, n_edges, 2), (n_cells,); `fixed`: ends of fixed facets.
    """
    meets = (edges == node).any(axis=2) & (edges[..., 0] != edges[..., 1])
    sectors = _angles(node, points, edges[meets]).reshape(-1, 2)
    held = _angles(node, points, fixed[(fixed == node).any(axis=1)])
    values = _eigenvalues(sectors, stiffness[meets.any(axis=1)], held)
    return float(np.sqrt(max(values[0 if len(held) else 1], 0.0)))


def _eigenvalues(
    sectors: np.ndarray, stiffness: np.ndarray, held: np.ndarray, turn: int = 10**6
) -> np.ndarray:
    """Return all α² of −(E φ')' = α² E φ around a node, by quadratic elements, ascending.

    `turn`: angles that differ by less than this part of a turn are one.
    """
    width = np.abs((np.diff(sectors, axis=1)[:, 0] + np.pi) % (2.0 * np.pi) - np.pi)
    whole, held = (np.round(each / (2.0 * np.pi) * turn).astype(int) % turn for each in (sectors, held))
    directions, ends = np.unique(whole, return_inverse=True)
    size = len(directions) + len(width)
    dofs = np.insert(ends.reshape(-1, 2), 1, len(directions) + np.arange(len(width)), axis=1)
    K, M = np.zeros((2, size, size))
    at = dofs[:, :, None], dofs[:, None, :]
    E, h = stiffness[:, None, None], width[:, None, None]
    np.add.at(K, at, E / (3.0 * h) * np.array([[7.0, -8, 1], [-8, 16, -8], [1, -8, 7]]))
    np.add.at(M, at, E * h / 30.0 * np.array([[4.0, 2, -1], [2, 16, 2], [-1, 2, 4]]))
    scale = 1.0 / np.sqrt(np.diag(M))  # moduli differ by many orders
    free = np.ones(size, dtype=bool)
    free[: len(directions)] = ~np.isin(directions, held)
    block = np.ix_(free, free)
    return np.asarray(eigvalsh((K * scale * scale[:, None])[block], (M * scale * scale[:, None])[block]))


def _angles(node: int, points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the angle of each edge that leaves a node, (n,)."""
    x, y = (points[np.where(edges[:, 0] == node, edges[:, 1], edges[:, 0])] - points[node]).T
    return np.asarray(np.arctan2(y, x))
