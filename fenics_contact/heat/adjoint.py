"""Derivatives of quantities of steady heat by all that a scene depends on: loads, laws, materials, shape.

With the residual R(T) of heat at nodes and R_T, its derivative by T at the converged temperatures,

    R_Tᵀ w = ∂J/∂T,  w = 0 where temperatures are held,    dJ/dp = ∂/∂p (J − wᵀ R) at fixed T and w.

R_T = A + N, where A is the symmetric matrix of the last linear system, with its factors and coarse space, and
N what laws add that depend on temperatures: one solution of the dual system where all is linear, else the
fixed point w = A⁻¹ (∂J/∂T − Nᵀ w), accelerated. The derivative by p is a central difference of J − wᵀ R: no
system is solved for it, and it covers what the scene can do, areas, weights and gaps of contacts included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact.errors import ConvergenceError, InvalidInputError, collectively
from fenics_contact.feti.averages import nodal_mean_at, nodal_mean_transposed
from fenics_contact.feti.dual import DualSystem
from fenics_contact.heat.acceleration import Anderson
from fenics_contact.heat.objectives import AtTemperatures, HeatObjective, followed
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatState
from fenics_contact.qp.face_newton import ProjectedCG
from fenics_contact.results.dual_solve import solve_dual


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
        iterations: Linear systems that were solved.
        products: Applications of the dual operator.
    """

    objective: HeatObjective
    state: HeatState
    value: float
    values: np.ndarray
    ties: np.ndarray
    iterations: int
    products: int

    @collectively("HeatAdjoint.gradient", lambda self, *_, **__: self.state.torn.decomposition.comm)
    def gradient(
        self, scenes: Callable[[np.ndarray], HeatScene], at: np.ndarray, step: float = 1e-5
    ) -> np.ndarray:
        """Return dJ/dp by variables on which the scene depends, (n,). Collective; nothing is solved.

        Args:
            scenes: The scene of variables, (n,): any numbers, functions, laws, materials, and places of the
                nodes of the same cells.
            at: Variables of the state, (n,).
            step: Of central differences, relative to each variable, to one where it is zero.
        """
        at = np.asarray(at, dtype=float)
        steps = np.diag(step * np.where(at == 0.0, 1.0, np.abs(at)))
        known = self.state.torn.decomposition, self.state.values
        ends = [
            [self.lagrangian(AtTemperatures.of(scenes(at + sign * change), *known)) for sign in (1.0, -1.0)]
            for change in steps
        ]
        return np.array([ahead - behind for ahead, behind in ends]) / (2.0 * np.diag(steps))

    def lagrangian(self, at: AtTemperatures) -> float:
        """Return J − wᵀ R − ζᵀ B T of a scene at the temperatures of the state, with B of ties."""
        tied, w = at.joints.tied.jump, followed(at.scene, at.decomposition, self.values)
        if tied.shape[0] != len(self.ties):
            raise InvalidInputError(
                f"derivatives need the same tied points, {len(self.ties)}, got {tied.shape[0]} after a step: "
                "take a smaller step, or keep ties as they are"
            )
        of_ties = self.state.ties @ (tied @ w) + self.ties @ (tied @ at.values)
        return float(self.objective.value(at) - w @ at.residual - of_ties)


@collectively("heat_adjoint", lambda state, *_, **__: state.torn.decomposition.comm)
def heat_adjoint(
    state: HeatState, objective: HeatObjective, *, tolerance: float = 1e-11, most: int = 60
) -> HeatAdjoint:
    """Solve the adjoint of a quantity of a steady state. Collective.

    Args:
        state: A steady state, with pressures and gaps of contacts as its scene says.
        objective: The quantity, such as `TemperatureMean`, `HeatOfContact` or `JointResistance`.
        tolerance: Largest relative residual; a tenth of the change of w where laws depend on temperatures.
        most: Linear systems after which an iteration is given up.

    Raises:
        InvalidInputError: If the state stores heat, or mechanics gave its pressures.
        ConvergenceError: If the iteration of laws that depend on temperatures does not settle.

    Example:
        >>> found = heat_adjoint(state, TemperatureMean("chip"))  # doctest: +SKIP
        >>> found.gradient(build, [2e-3, 15.0])  # build(p): the scene of variables  # doctest: +SKIP
    """
    decomposition = state.torn.decomposition
    at = AtTemperatures.of(state.scene, decomposition, state.values)
    _check(state, at)
    wanted, every = objective.by_temperature(at), np.arange(len(at.values))
    w, anderson, system, products = np.zeros_like(wanted), Anderson(depth=most), state.system, 0
    for count in range(1, most + 1):
        right = wanted if state.scene.is_linear else wanted - at.beyond(w)
        load = decomposition.on_followed(nodal_mean_transposed(decomposition, every, right[:, None]))
        pairs = zip(state.torn.subdomains, decomposition.parts, strict=True)
        none, loaded = np.zeros_like(state.torn.right), tuple(replace(s, load=load[own]) for s, own in pairs)
        system = DualSystem(
            replace(state.torn, subdomains=loaded, right=none, supported=none), previous=system
        )
        solution = solve_dual(system, ProjectedCG(tolerance=tolerance))
        field = system.displacement(solution.multiplier, solution.alpha)
        found, products = nodal_mean_at(decomposition, field, every)[:, 0], products + system.products
        change, size = np.abs(found - w).max(), np.abs(found).max()
        if state.scene.is_linear or change <= 10.0 * tolerance * size:
            ties = state.torn.gathered(solution.multiplier, state.torn.groups.joints[0])
            return HeatAdjoint(objective, state, objective.value(at), found, ties, count, products)
        w = anderson.next(w, found)
    raise ConvergenceError(
        f"the adjoint does not settle, it changes by {change:.2g} of {size:.2g} after {most} systems: "
        "allow more"
    )


def _check(state: HeatState, at: AtTemperatures) -> None:
    """Reject states whose balance is not that of the scene alone. Collective."""
    h, own = np.zeros(at.joints.points.count), at.conductance / at.joints.area
    for number, each in enumerate(state.contacts):
        h[at.joints.points.pair == number] = each.conductance
    stores = at.decomposition.comm.allreduce(sum(each.stored.matrix.nnz for each in state.heated))
    if stores or not np.allclose(h, own, rtol=1e-6, atol=0.0):
        raise InvalidInputError(
            "an adjoint of heat needs a steady state with the pressures and gaps of its scene, got one that "
            "stores heat or whose contacts mechanics closed: solve the scene by solve_heat"
        )
