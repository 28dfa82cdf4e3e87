"""A quantity of steady temperatures to the accuracy that is asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from fenics_contact._adaptive.estimates import ErrorEstimate
from fenics_contact._adaptive.levels import (
    AccuracyLoop,
    AccurateResult,
    Level,
    Limits,
    error_in_words,
    require_share,
)
from fenics_contact._adaptive.refined_scene import SceneRefinement
from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.libraries import MPI
from fenics_contact._scene.memory import Subdomains
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import collectively, together
from fenics_contact.heat.goal_errors import heat_goal_error
from fenics_contact.heat.objectives import HeatObjective
from fenics_contact.heat.plan import memory_of_heat
from fenics_contact.heat.plausible import odd_values, warn_of
from fenics_contact.heat.problem import HeatProblem
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatState


@collectively("solve_heat_to", lambda scene, objective, relative_error, comm, **_: comm)
@naming_arguments
def solve_heat_to(
    scene: HeatScene,
    objective: HeatObjective,
    relative_error: float,
    comm: MPI.Comm,
    *,
    limits: Limits | None = None,
    callback: Callable[[Level], None] | None = None,
) -> AccurateResult[HeatState]:
    """Compute a quantity of steady temperatures to an accuracy, on meshes that are refined where it pays.

    As `fenics_contact.solve_to`: the scene is solved on its own mesh, the error of the quantity is estimated
    by its adjoint, see `heat_goal_error`, the cells that hold most of it are halved, and so on until the
    estimate, and what estimates have turned out to miss, is small enough. It is no bound.

    Args:
        scene: The scene on a coarse mesh.
        objective: The quantity, such as `TemperatureMean`, `HeatOfHeld`, `HeatOfContact`, `JointResistance`.
        relative_error: Largest error relative to the size of the quantity, between 0 and 1; of temperatures,
            whose zero may lie anywhere, relative to their range in all bodies.
        comm: Communicator over which the subdomains are spread.
        limits: What may be spent.
        callback: Called on all ranks with every level once it is done.

    Returns:
        The result on the last mesh; where the accuracy was not reached, it says so, and a warning.

    Raises:
        InvalidInputError: If the accuracy is not between 0 and 1, or cells of the meshes cannot be refined.
        InfeasibleError: If nothing holds the temperature of some body.
        ConvergenceError: If laws that depend on temperatures do not settle on some mesh.

    Example:
        >>> result = solve_heat_to(scene, TemperatureMean("chip"), 0.01, MPI.COMM_WORLD)  # doctest: +SKIP
        >>> print(result)  # the levels, and why the last is the last  # doctest: +SKIP
    """
    with together(comm):
        require_share(relative_error)
        objective.check(scene)
    warn_of(odd_values(scene), comm)
    return _Levels(objective, relative_error, limits or Limits(), comm).follow(
        HeatProblem(scene, comm), callback
    )


class _Levels(AccuracyLoop[HeatProblem, HeatState]):
    """The levels so far of a quantity of temperatures."""

    def __init__(self, objective: HeatObjective, wanted: float, limits: Limits, comm: MPI.Comm) -> None:
        super().__init__(wanted, limits, comm)
        self.objective = objective

    @property
    def _scene(self) -> Scene:
        """The meshes of the last state with its temperatures."""
        return self._state.scene.field

    @property
    def _products(self) -> int:
        """Products with F of the last mesh."""
        return self._state.products

    def _size(self, value: float) -> float:
        """Return what errors are relative to."""
        return self.objective.size(value, self._state.values)

    def _memory(self, scene: Scene, partitions: Mapping[str, np.ndarray]) -> float:
        """Return the memory that a mesh needs on all ranks together, [bytes]."""
        return memory_of_heat(scene, Subdomains.of(scene, partitions), self.comm.size)

    def _solved(self, problem: HeatProblem) -> HeatState:
        """Return the state on the next mesh. Collective."""
        return problem.solve()

    def _estimate(self) -> ErrorEstimate:
        """Return the quantity of the last state and what is known of its error. Collective."""
        return heat_goal_error(self._state, self.objective)

    def _refined_scene(self, found: SceneRefinement) -> HeatScene:
        scene = self._state.scene
        bodies = {n: replace(b, mesh=found.scene.bodies[n].mesh) for n, b in scene.bodies.items()}
        return replace(scene, bodies=bodies)

    def _next(
        self, problem: HeatProblem, found: SceneRefinement, partitions: Mapping[str, np.ndarray]
    ) -> HeatProblem:
        """Return the problem on refined meshes."""
        return HeatProblem(self._refined_scene(found), self.comm, partitions=partitions)

    def _hopeless(self) -> str:
        """Say so if the value grows without limit, as heat does between surfaces that are held and meet.

        Where errors fall from mesh to mesh it is chance.
        """
        if not self._without_limit() or 2.0 * self.levels[-1].error < min(x.error for x in self.levels[:-2]):
            return ""
        return (
            f"{error_in_words(self.levels[-1])}, and the value grows without limit as cells get smaller, by "
            "more from mesh to mesh, as temperature does where heat enters at a point, and heat where "
            "surfaces with different held temperatures meet: spread it over a surface, or part these"
        )
