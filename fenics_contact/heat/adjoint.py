"""Derivatives of quantities of steady heat by all that a scene depends on: loads, laws, materials, shape.

With the residual R(T) of heat at nodes and R_T, its derivative by T at the converged temperatures,

    R_Tᵀ w = ∂J/∂T + y(w),  w = 0 where temperatures are held,    dJ/dp = ∂/∂p (J − wᵀ R) at fixed T and w,

and y(w) the derivative of J − wᵀ R by T through the mechanics of a `HeatedState`, by an adjoint of its own.
R_T = A + N, where A is the symmetric matrix of the last linear system, with its factors and coarse space, and
N what laws add that depend on temperatures: one solution of the dual system where all is linear, else the
fixed point w = A⁻¹ (∂J/∂T + y(w) − Nᵀ w), accelerated. The derivative by p is a central difference of J −
wᵀ R, with mechanics at the same forces and its adjoint times what these leave: no system is solved for it,
and it covers what the scene can do, areas, weights and gaps of contacts included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact.design.adjoint import WeakPoints
from fenics_contact.errors import ConvergenceError, InvalidInputError, collectively, together
from fenics_contact.feti.averages import nodal_mean_at, nodal_mean_transposed
from fenics_contact.feti.dual import DualSystem
from fenics_contact.heat.acceleration import Anderson
from fenics_contact.heat.objectives import (
    AtTemperatures,
    HeatObjective,
    NoMechanics,
    OfMechanics,
    followed,
)  # fmt: skip
from fenics_contact.heat.state import HeatState
from fenics_contact.qp.face_newton import ProjectedCG
from fenics_contact.results.dual_solve import solve_dual

if TYPE_CHECKING:
    from fenics_contact.design.objective import Objective
    from fenics_contact.heat.coupled import HeatedState


@displayed
@dataclass(frozen=True, eq=False)
class HeatAdjoint:
    """A quantity of a steady state with its adjoint.

    Attributes:
        objective: The quantity.
        state: The state.
        value: J.
        values: w at the nodes of all bodies, replicated, (n_nodes,), [J / power].
        ties: The same of tied points, (n,).
        iterations: Linear systems of heat that were solved, and adjoints of mechanics where there is one.
        products: Applications of the dual operator of heat.
        at: The scene at the temperatures of the state, as they were differentiated.
        heat: The temperatures of the state.
        mechanics: What moves its bodies, with its adjoint of J − wᵀ R.
    """

    objective: HeatObjective
    state: HeatState | HeatedState
    value: float
    values: np.ndarray
    ties: np.ndarray
    iterations: int
    products: int
    at: AtTemperatures = field(repr=False)
    heat: HeatState = field(repr=False)
    mechanics: NoMechanics = field(repr=False)

    @property
    def weak(self) -> WeakPoints:
        """Contact points at which J has a kink: they only just touch, or are about to slip.

        There derivatives are those of one branch, on which they are open and slip, see `WeakChoice`.
        """
        return self.mechanics.weak

    @collectively("HeatAdjoint.gradient", lambda self, *_, **__: self.state.comm)
    def gradient(self, scenes: Callable[[np.ndarray], Any], at: np.ndarray, step: float = 1e-5) -> np.ndarray:
        """Return dJ/dp by variables on which the scene depends, (n,). Collective; nothing is solved.

        Each costs two assemblies, and of a `HeatedState` two factorisations where stiffness depends on it.

        Args:
            scenes: The `HeatScene` of variables, (n,): any numbers, functions, laws, materials, and places of
                the nodes of the same cells; of a `HeatedState` the pair of `Scene` and `HeatScene`.
            at: Variables of the state, (n,).
            step: Of central differences, relative to each variable, to one where it is zero.
        """
        at = np.asarray(at, dtype=float)
        steps = np.diag(step * np.where(at == 0.0, 1.0, np.abs(at)))
        ends = [[self._varied(scenes(at + sign * change)) for sign in (1.0, -1.0)] for change in steps]
        changes = np.array([ahead - behind for ahead, behind in ends])
        # Ranks must take the same decisions, whatever the rounding in sums over ranks.
        return np.asarray(self.state.comm.bcast(changes / (2.0 * np.diag(steps))))

    def _varied(self, scenes: Any) -> float:
        """Return J − wᵀ R − ζᵀ B T of what a user makes of variables. Collective."""
        scene, mechanics = self.mechanics.of_scenes(scenes)
        known = self.heat.torn.decomposition, self.heat.values
        return self.lagrangian(AtTemperatures.of(scene, *known, mechanics))

    def lagrangian(self, at: AtTemperatures) -> float:
        """Return J − wᵀ R − ζᵀ B T at the temperatures, with B of ties, and mechanics near its balance."""
        tied, w = at.joints.tied.jump, followed(at.scene, at.decomposition, self.values)
        if tied.shape[0] != len(self.ties):
            raise InvalidInputError(
                f"derivatives need the same tied points, {len(self.ties)}, got {tied.shape[0]} after a step: "
                "take a smaller step, or keep ties as they are"
            )
        of_ties = self.heat.ties @ (tied @ w) + self.ties @ (tied @ at.values)
        return float(self.objective.value(at) - w @ at.residual - of_ties + at.mechanics.missing)


@collectively("heat_adjoint", lambda state, *_, **__: state.comm)
def heat_adjoint(
    state: HeatState | HeatedState,
    objective: HeatObjective | Objective,
    *,
    tolerance: float = 1e-11,
    most: int = 60,
) -> HeatAdjoint:
    """Solve the adjoint of a quantity of a steady state, of heat alone or with mechanics. Collective.

    Args:
        state: A steady state.
        objective: The quantity, such as `TemperatureMean`, `HeatOfContact` or `JointResistance`; of a
            `HeatedState` also one of `fenics_contact.design` by forces and displacements, as
            `LargestPressure`.
        tolerance: Largest relative residual; a tenth of the change of w where laws depend on temperatures, or
            bodies on mechanics.
        most: Linear systems after which an iteration is given up.

    Raises:
        InvalidInputError: If the state stores heat, or is one of heat alone whose pressures mechanics gave,
            or mechanics has no adjoint: materials are not linear, friction began in an earlier step.
        ConvergenceError: If the iteration does not settle.

    Example:
        >>> found = heat_adjoint(state, TemperatureMean("chip"))  # doctest: +SKIP
        >>> found.gradient(build, [2e-3, 15.0])  # build(p): the scene of variables  # doctest: +SKIP
    """
    quantity = objective if isinstance(objective, HeatObjective) else OfMechanics(objective)
    warm, mechanics, *_ = *state.adjoining(), NoMechanics()
    systems, anderson, linear = _Systems(warm), Anderson(depth=most), warm.scene.is_linear
    with together(state.comm):
        quantity.check(warm.scene)
    at = AtTemperatures.of(warm.scene, warm.torn.decomposition, warm.values, mechanics)
    at.mechanics.check(at, warm, quantity)
    value, wanted = state.comm.bcast(quantity.value(at)), quantity.partials(at)[0]
    w, mechanics = np.zeros_like(wanted), at.mechanics
    for count in range(1, most + 1):
        mechanics = mechanics.following(at, quantity, w)
        right = wanted + mechanics.by_temperature
        found, ties = systems.solved(right if linear else right - at.beyond(w), tolerance)
        change, size = np.abs(found - w).max(), np.abs(found).max()
        if (linear and mechanics.is_fixed) or change <= 10.0 * tolerance * size:
            products = systems.products
            return HeatAdjoint(quantity, state, value, found, ties, count, products, at, warm, mechanics)
        w = anderson.next(w, found)
    raise ConvergenceError(
        f"the adjoint does not settle, it changes by {change:.2g} of {size:.2g} after {most} systems: "
        "allow more"
    )


@dataclass(eq=False)
class _Systems:
    """Solves the last linear system of a state for heat at nodes, again and again."""

    state: HeatState
    products: int = 0

    def __post_init__(self) -> None:
        """Begin with the system of the state; reject one that stores heat. Collective."""
        state, self._system = self.state, self.state.system
        if state.comm.allreduce(sum(each.stored.matrix.nnz for each in state.heated)):
            raise InvalidInputError(
                "an adjoint of heat needs a steady state, got one that stores heat: leave out before=..."
            )

    def solved(self, right: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
        """Return temperatures of heat at all nodes, (n_nodes,), and what ties pass, (n,). Collective."""
        torn, every = self.state.torn, np.arange(len(right))
        decomposition, none = torn.decomposition, np.zeros_like(torn.right)
        load = decomposition.on_followed(nodal_mean_transposed(decomposition, every, right[:, None]))
        pairs = zip(torn.subdomains, decomposition.parts, strict=True)
        loaded = tuple(replace(each, load=load[own]) for each, own in pairs)
        heated = replace(torn, subdomains=loaded, right=none, supported=none)
        self._system = DualSystem(heated, previous=self._system)
        solution = solve_dual(self._system, ProjectedCG(tolerance=tolerance))
        field = self._system.displacement(solution.multiplier, solution.alpha)
        self.products += self._system.products
        found = nodal_mean_at(decomposition, field, every)[:, 0]
        return found, torn.gathered(solution.multiplier, torn.groups.joints[0])
