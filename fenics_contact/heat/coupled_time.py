"""Mechanics and temperatures in time: load steps and time steps are the same steps, of a given error."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, Literal

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.libraries import MPI
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import collectively, together
from fenics_contact.errors.kinds import user_code
from fenics_contact.heat.assembly import Rate
from fenics_contact.heat.coupled import HeatedState, Passes, by_body
from fenics_contact.heat.interaction import Interaction, check_fit
from fenics_contact.heat.parts import Value
from fenics_contact.heat.plausible import odd_power, odd_values, warn_of
from fenics_contact.heat.problem import HeatProblem
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatState
from fenics_contact.heat.time import Course, HeatHistory, March, always, at_start, march_on, scene_at


class _AtRest:
    """What is known before the first step of bodies at rest."""

    mechanics = None


@dataclass(frozen=True, eq=False)
class _Both:
    """Scenes of mechanics and heat that depend on time; `cold`: temperatures free of stress, by body."""

    mechanics: ContactProblem
    problem: HeatProblem
    at: tuple[Callable[[float], Any], Callable[[float], Any]]
    cold: Mapping[str, float]
    settled: float

    @property
    def doubt(self) -> float:
        """Friction and plastic flow heat by the mean of their work in a step, of the first order."""
        scene = self.problem.scene
        works = [*(each.friction.part > 0.0 for each in scene.contacts)]
        return 2.0 if any([*works, *(each.by_mechanics for each in scene.loads)]) else 1.0

    def end(self, last: Any, time: float, step: float, rate: Rate) -> HeatedState:
        problems, comm = (self.mechanics, self.problem), self.problem.comm
        scene = scene_at(self.at[0], time, self.mechanics.scene, comm)
        heat = scene_at(self.at[1], time, self.problem.scene, comm)
        tearing = self.problem.decomposition.tearing
        both = Interaction(scene, heat, self.problem.joints(heat), tearing, self.cold, step)
        passes = Passes(both, problems, last.mechanics, rate, self.settled, "those before the step")
        return passes.run(rate.before)


@collectively("heated_in_time", lambda scene, heat, comm, *_, **__: comm)
@naming_arguments
def heated_in_time(
    scene: Scene | Callable[[float], Scene],
    heat: HeatScene | Callable[[float], HeatScene],
    comm: MPI.Comm,
    duration: float,
    initial: float | Mapping[str, Value | np.ndarray] | HeatState | HeatedState,
    *,
    stress_free: float | Mapping[str, float] = 0.0,
    step: float = inf,
    tolerance: float = inf,
    scheme: Literal["bdf2", "euler", "crank-nicolson"] | float = "bdf2",
    begin: int = 1,
    outputs: Sequence[float] = (),
    partitions: Mapping[str, np.ndarray] | None = None,
    mechanics_tolerance: float = 1e-9,
    settled: float = 1e-7,
) -> HeatHistory[HeatedState]:
    """Compute temperatures and deformation that depend on each other over time. Collective on ``comm``.

    In each step both agree at its end, see `solve_heated`; mechanics has no inertia, and goes on from the
    step before, with its slips and plastic strains. With a tolerance steps are those of `heat_in_time`: two
    histories side by side state the error of temperatures. A step that errs too much, or in which mechanics
    or both together do not converge, is done again, shorter.

    Args:
        scene: Mechanics of the bodies, or a function of time that returns it: loads of a step are those at
            its end.
        heat: Heat of these bodies, or a function of time that returns it, see `heat_in_time`.
        comm: Communicator over which the subdomains are spread.
        duration: End of the history, which starts at 0, [time].
        initial: As for `heat_in_time`; mechanics starts at rest, or from that of a `HeatedState`.
        stress_free: As for `solve_heated`.
        step: Length of steps, [time]; with a tolerance, of the longest.
        tolerance: Largest error of temperatures by steps, [degree].
        scheme: As for `heat_in_time`. Work of friction forces and plastic work are the mean of a step, of
            the first order, and balanced with mechanics by Euler steps.
        begin: Number of Euler steps at the start.
        outputs: Times at which steps end, as where loads jump; what is kept is that at these and at the end.
        partitions: As for `solve_scene`.
        mechanics_tolerance: Largest relative residual of mechanics.
        settled: Largest change of temperatures in the last pass of a step, relative to their range.

    Raises:
        InvalidInputError: If both scenes do not fit each other, or an argument is outside its range.
        InfeasibleError: If nothing holds a body.
        ConvergenceError: If steps become too short, or without a tolerance one does not converge.

    Example:
        >>> warm = heated_in_time(scene, heat, comm, 60.0, 20.0, tolerance=0.1)  # doctest: +SKIP
        >>> warm.temperature("rod").max(axis=1)  # doctest: +SKIP
    """
    at = always(scene), always(heat)
    with together(comm):
        with user_code("the scene as a function of time"):
            first = at[0](0.0), at[1](0.0)
        cold = by_body(stress_free, first[1])
        check_fit(*first, cold)
        values = at_start(first[1], getattr(initial, "heat", initial))
    warn_of(odd_values(first[1]), comm)
    warn_of(odd_power(*first), comm)
    problems = getattr(initial, "problems", ())
    rest: Any = {"partitions": partitions, "tolerance": mechanics_tolerance}
    mechanics = problems[0] if problems else ContactProblem(first[0], comm, **rest)

    def march() -> March:
        return _Both(mechanics, HeatProblem(first[1], comm, partitions=partitions), at, cold, settled)

    known = initial if problems else _AtRest()
    return march_on(march, known, values, Course(duration, step, tolerance, scheme, begin, outputs))
