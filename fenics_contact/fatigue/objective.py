"""A smooth bound of the largest fatigue parameter of a cycle, for designs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from ufl.core.expr import Expr

from fenics_contact._base.checks import check_count, checked
from fenics_contact._scene.body import Body
from fenics_contact.design.forms import Density, ShapeForms
from fenics_contact.design.motion import BodyIntegral, require_body
from fenics_contact.design.objective import Objective, Partials, require_linear
from fenics_contact.design.objectives import require_exponent
from fenics_contact.design.several import PathObjective
from fenics_contact.errors import InvalidInputError
from fenics_contact.fatigue.criteria import Criterion, OnPlanes, plane_rows
from fenics_contact.fatigue.cycle import closed_cycle, hookean_strain
from fenics_contact.fatigue.planes import chunks, half_sphere
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.results.at_points import QuadraturePoints
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.fields import COMPONENTS, components_of, tensors
from fenics_contact.results.state import State


@dataclass(frozen=True)
@checked()
class FatigueNorm(PathObjective):
    """J = (Σ V_c P_c^p / Σ V_c)^(1/p), P_c = (Σ P_cm^q / M)^(1/q), over cells c below a surface and M planes.

    P_cm is the parameter of the mean stresses of a cell on a plane, zero where negative. J lies below the
    largest P_cm, the closer the larger p and q. P_cm has a kink where two states have the same largest normal
    stress, which sums over planes and cells smooth.

    Attributes:
        body: Name of the body, of linear material.
        surface: Name of its surface, such as one in contact.
        criterion: Whose parameter P is.
        steps: Names of the load steps of one closed cycle, see `assess_cycle`; a step may recur.
        p: Exponent over cells, from 2 to 100.
        q: Exponent over planes, from 2 to 100.
        layers: How many layers of cells below the surface count.
        spacing: Angle between planes, degrees.
        opening: See `assess_cycle`.

    Raises:
        InvalidInputError: If a number is out of range, there is no such body or surface, or as of
            `assess_cycle`.

    Example:
        >>> cycle = FatigueNorm("pad", "y0", Findley(0.3), ("push", "pull", "push again"))  # doctest: +SKIP
        >>> path = LoadPath(problem, steps, cycle)  # doctest: +SKIP
    """

    body: str
    surface: str
    criterion: Criterion
    steps: tuple[str, ...]
    p: float = 8.0
    q: float = 20.0
    layers: int = 1
    spacing: float = 15.0
    opening: float = 0.02

    def __post_init__(self) -> None:
        """Check exponents, layers and the net of planes."""
        require_exponent("FatigueNorm", self.p)
        require_exponent("FatigueNorm", self.q)
        check_count(self.layers, "FatigueNorm.layers")
        half_sphere(self.spacing)

    def at(self, states: Mapping[str, AnyState], forms: ShapeForms) -> Mapping[str, Objective]:
        """Return the share of each step; that of the last has the value. Collective."""
        cycle = [states[name] for name in self.steps]
        require_body(cycle[0], "FatigueNorm", self.body)
        require_linear(cycle[0], self)
        body = cycle[0].scene.bodies[self.body]
        cells = self._cells(body.mesh)
        stress = closed_cycle(
            cycle, self.body, self.opening, lambda state, name: state.gather_stress(name)[cells]
        )
        size = QuadraturePoints(body, np.zeros_like(body.mesh.points)).weights.sum(axis=1)[cells]
        largest, by_stress = self._of_cells(body, cells, stress)
        value, by_largest = _norm(largest[None], size / size.sum(), self.p)
        # Means of cells change with their integrals and their sizes: δσ = (δ∫σ − σ δV) / V.
        by_stress *= (by_largest[0] / size)[:, None]
        by_size = value[0] / (self.p * size.sum()) * ((largest / (value[0] or 1.0)) ** self.p - 1.0)
        weights = {name: np.zeros((body.mesh.n_cells, 7)) for name in self.steps}
        for name, own, mean in zip(self.steps, by_stress, components_of(stress), strict=True):
            weights[name][cells] += np.column_stack([own, -(own * mean).sum(axis=1)])
        weights[self.steps[-1]][cells, 6] += by_size
        last = {self.steps[-1]: float(value[0])}
        return {name: _Share(self.body, last.get(name, 0.0), own) for name, own in weights.items()}

    def _cells(self, mesh: BodyMesh) -> np.ndarray:
        """Return the cells below the surface."""
        if self.surface not in mesh.surfaces:
            raise InvalidInputError(
                f"FatigueNorm.surface must be one of {sorted(mesh.surfaces)}, got {self.surface!r}"
            )
        near = np.isin(np.arange(mesh.n_nodes), mesh.surfaces[self.surface])
        for _ in range(self.layers):
            cells = np.flatnonzero(near[mesh.cells].any(axis=1))
            near[mesh.cells[cells]] = True
        return cells

    def _of_cells(self, body: Body, cells: np.ndarray, stress: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return P_c, (n_cells,), and its derivatives by the stresses, (n_states, n_cells, 6)."""
        rows = plane_rows(half_sphere(self.spacing))[None]
        value, by_stress = np.zeros(len(cells)), np.zeros((*stress.shape[:2], 6))
        twice = np.array([1.0 if i == j else 2.0 for i, j in COMPONENTS])
        for number, material in enumerate(body.materials):
            mine = np.flatnonzero(body.material_of_cells[cells] == number)
            for part in chunks(len(mine), len(stress) * rows.shape[1]):
                own, sigma = mine[part], stress[:, mine[part]]
                strain = hookean_strain(sigma, material, self.body) if self.criterion.of_strain else sigma
                on = OnPlanes(self.criterion, components_of(np.stack([sigma, strain])), rows)
                sizes = np.maximum(on.combined[0], 0.0)
                value[own], weights = _norm(sizes, np.full(sizes.shape[1], 1.0 / sizes.shape[1]), self.q)
                by_stress[:, own], by_strain = on.pulled_back(weights)
                if self.criterion.of_strain:  # Hooke's law is its own transpose
                    back = hookean_strain(tensors(by_strain / twice), material, self.body)
                    by_stress[:, own] += components_of(back) * twice
        return value, by_stress


def _norm(sizes: np.ndarray, shares: np.ndarray, p: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (Σ share size^p)^(1/p) of rows, (n, k), and its derivatives by the sizes."""
    top = np.where(sizes.any(axis=1), sizes.max(axis=1), 1.0)[:, None]
    value = top[:, 0] * ((sizes / top) ** p @ shares) ** (1.0 / p)
    return value, shares * (sizes / np.where(value > 0.0, value, 1.0)[:, None]) ** (p - 1.0)


@dataclass(frozen=True, eq=False)
class _Share:
    """What an objective of a path depends on in one state; `weights`: of its stresses and of one, by cell."""

    body: str
    amount: float
    weights: np.ndarray

    def value(self, state: State, forms: ShapeForms) -> float:
        return self.amount

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        integral = BodyIntegral(state, forms, _WEIGHED, self.body, (self.weights,))
        return Partials.of(state, self.amount, **integral.derivatives())


def _weighed(u: Expr, x: Expr, stress: Expr, weights: Expr) -> Expr:
    return sum((weights[k] * stress[place] for k, place in enumerate(COMPONENTS)), weights[6])


_WEIGHED = Density("weighed stress", _weighed, in_space=True, of_cells=(7,))
