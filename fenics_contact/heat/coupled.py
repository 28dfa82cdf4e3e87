"""Heat and mechanics of the same bodies: temperatures strain, pressures and gaps conduct, friction heats.

Mechanics at temperatures T leads to temperatures G(T), and the answer is a fixed point of G. Where touching
warms bodies, which then press harder, G rises: there may be several fixed points, and repeating G leads to
stable ones. Where it cools them, G falls: repeating it alternates, combining passes finds the fixed point,
where films are steep Newton's method does, and there is none where conductance jumps as contact opens (J. R.
Barber, J. Elasticity 8 (1978) 409-423; J. R. Barber, J. Dundurs, M. Comninou, J. Appl. Mech. 47 (1980)
871-874). Tangents are differences of passes, which hold for any material and law (D. A. Knoll, D. E. Keyes,
Jacobian-free Newton-Krylov methods, J. Comput. Phys. 193 (2004) 357-397).
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._equilibrium.previous import ONLY_STEP
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._scene.checks import check_known
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.errors import ConvergenceError, InvalidInputError, collectively, together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.heat.acceleration import Anderson
from fenics_contact.heat.assembly import Rate
from fenics_contact.heat.fields import BothOnBodies
from fenics_contact.heat.interaction import Interaction, check_fit
from fenics_contact.heat.plausible import odd_power, warn_of
from fenics_contact.heat.problem import HeatProblem, as_given
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatState
from fenics_contact.qp.krylov import gmres
from fenics_contact.results.deformed_state import AnyState

_LOG = logging.getLogger(__name__)


@displayed
@dataclass(frozen=True, eq=False)
class HeatedState(BothOnBodies):
    """Mechanics and temperatures that agree.

    Attributes:
        mechanics: The state of the bodies, with `ThermalStrain` of the temperatures.
        heat: The temperatures, with the pressures and gaps of the bodies.
        passes: How often both were solved in turn; one where one of them does not depend on the other.
        start: Which temperatures the first pass had, in words: of several possible states they choose one.
        gain: Part of a small change of temperatures that a pass returns, estimated from the last two.
        problems: Those that computed it, used again in the next step.
        interaction: How each enters the other.
    """

    mechanics: AnyState
    heat: HeatState
    passes: int
    start: str
    gain: float
    problems: tuple[ContactProblem, HeatProblem] = field(repr=False)
    interaction: Interaction = field(repr=False)

    def adjoining(self) -> tuple[Any, ...]:
        """Return the temperatures for an adjoint, and mechanics that follows them. Collective."""
        from fenics_contact.heat.coupled_adjoint import Mechanics

        tolerance = self.problems[0].tolerance
        return self.heat, Mechanics.of(self.interaction, self.mechanics, self.heat.values, tolerance)


@dataclass(eq=False)
class Passes:
    """Passes of one step: mechanics at temperatures, then temperatures at its contacts.

    `before`: mechanics before the step.
    """

    interaction: Interaction
    problems: tuple[ContactProblem, HeatProblem]
    before: AnyState | None
    rate: Rate
    settled: float
    start: str
    known: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    gain: float = 0.0
    answers: list[HeatedState] = field(default_factory=list)

    def run(self, guess: np.ndarray, early: int = 30, most: int = 80) -> HeatedState:
        """Return the state in which both agree. Collective.

        `early`: passes after which Newton's method takes over, unless changes grow or are small; earlier
        where they turn.
        """
        if not self.interaction.mechanics_heats:
            given = as_given(self.interaction.joints)
            heat = self.problems[1].solve(self.interaction.heat, rate=self.rate, given=given)
            return self._answer(self._mechanics(heat.values), heat)
        if not (self.interaction.expanding or self.interaction.rubbing):
            state = self._mechanics(guess)
            return self._answer(state, self._heat_after(state))
        anderson = Anderson()
        for count in range(1, most + 1):
            change = self._pass(guess)
            if self.answers:
                return self.answers[0]
            left = np.linalg.norm(change) / np.linalg.norm(self.known[0][1])
            turning = left > 1e-3 and count == 10 and any(change @ r < 0.0 for _, r in self.known[-6:])
            if turning or (count >= early and self.gain <= 1.0 and left > 1e-6):
                return self._newton(guess, change)
            if self.gain > 1.0:  # follow what grows to where it grows no more
                anderson, guess = Anderson(), guess + change
            else:
                guess = anderson.next(guess, guess + change)
        raise self._unsettled(change)

    def _unsettled(self, change: np.ndarray) -> ConvergenceError:
        return ConvergenceError(
            f"temperatures and contact do not settle: after {len(self.known)} passes temperatures still "
            f"change by {np.abs(change).max():.2g}; start from a state nearby by start=..., heat in steps, "
            "or give a smaller tolerance if little is missing"
        )

    def _answer(self, state: AnyState, heat: HeatState) -> HeatedState:
        count = max(len(self.known), 1)
        return HeatedState(state, heat, count, self.start, self.gain, self.problems, self.interaction)

    def _pass(self, guess: np.ndarray) -> np.ndarray:
        """Return by how much temperatures change in a pass; it is an answer if that is little. Collective."""
        state = self._mechanics(guess)
        heat = self._heat_after(state)
        change = heat.values - guess
        if self.known:
            way, turn = guess - self.known[-1][0], change - self.known[-1][1]
            self.gain = 1.0 + float(way @ turn) / (float(way @ way) or 1.0)
        self.known.append((guess, change))
        size, first = (np.ptp([*x, *(x + r)]) for x, r in (self.known[-1], self.known[0]))
        words = "pass %d from %s: temperatures change by %.1e of %.2g, gain %.2g"
        largest = np.abs(change).max()
        safe_log(_LOG.info, words, len(self.known), self.start, largest, size, self.gain)
        if largest <= self.settled * size:
            self.answers.append(self._answer(state, heat))
        elif size > 1e6 * first:
            raise ConvergenceError(
                "heat and pressure raise each other without end, there is no steady state: bodies slide "
                "faster, or are held more stiffly, than heat leaves them (thermoelastic instability); cool "
                "more, slide slower, or follow the course in time by before=... and duration=..."
            )
        return change

    def _newton(self, guess: np.ndarray, change: np.ndarray, most: int = 400) -> HeatedState:
        """Return the state by Newton's method for G(T) − T = 0. Collective."""
        while not self.answers:
            before = np.linalg.norm(change)
            guess, change = self._along(guess, change, self._direction(guess, change))
            stuck = np.linalg.norm(change) > (1.0 - 1e-9) * before
            if not self.answers and (stuck or len(self.known) >= most):
                raise self._unsettled(change)
        return self.answers[0]

    def _direction(self, guess: np.ndarray, change: np.ndarray, probe: float = 1e-7) -> np.ndarray:
        """Return d with (1 − G′) d = G(T) − T to a tenth, (n_nodes,). Collective.

        `probe`: size of the steps whose differences are G′ d, relative to the range of temperatures.
        """
        scale = float(np.ptp([*guess, *(guess + change)]))

        def expand(way: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
            step = probe * scale / np.abs(way).max()
            return (change - self._pass(guess + step * way)) / step, (way,)

        enough, size = 0.1 * float(np.linalg.norm(change)), len(guess)
        way = gmres(MPI.COMM_SELF, change, expand, enough, min(size, 100), size).combined(0, size)
        return np.asarray(way * min(1.0, 10.0 * scale / np.abs(way).max(initial=1e-300)))

    def _along(
        self, guess: np.ndarray, change: np.ndarray, way: np.ndarray, halvings: int = 36
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return temperatures on a way which change less, and their change. Collective.

        Where changes turn round between two temperatures on the way, it looks for those between. Raises where
        they stay large and opposite however close these are: there conductance jumps.
        """
        size, along, best = np.linalg.norm(change), abs(change @ way), (guess, change)
        low, high, part = (0.0, change), (0.0, change), 1.0
        for _ in range(halvings):
            at = guess + part * way
            found = self._pass(at)
            left = np.linalg.norm(found)
            if left < np.linalg.norm(best[1]):
                best = at, found
            less, between = left < (1.0 - 1e-4 * part) * size, abs((found - high[1]) @ way) > 0.5 * along
            if self.answers or left < 0.7 * size or (less and not (high[0] and between)):
                return best
            if less and (found @ way) * (change @ way) > 0.0:
                low = part, found
            else:
                high = part, found
            part = 0.5 * (low[0] + high[0])
        if abs((high[1] - low[1]) @ way) > 0.5 * along and (high[1] @ way) * (low[1] @ way) < 0.0:
            raise self._jumping(*(guess + t * way + r for t, r in (low, high)))
        return best

    def _jumping(self, *temperatures: np.ndarray) -> ConvergenceError:
        found = (self.interaction.joints.sides(each)[0].max() for each in temperatures)
        return ConvergenceError(
            "there is no steady state: bodies that touch cool until they part, and warm until they touch "
            "(Barber's thermoelastic contact), surfaces are at {:.6g} or {:.6g} in turn as the conductance "
            "jumps where contact opens: give one that is continuous, such as a PressureConductance plus a "
            "GapConductance".format(*sorted(found))
        )

    def _mechanics(self, temperature: np.ndarray) -> AnyState:
        """Return the state at temperatures of all nodes. Collective."""
        step, before, duration = ONLY_STEP, self.before, self.interaction.duration
        if duration < np.inf:
            step = LoadStep("heated", time=duration + (0.0 if before is None else before.time))
        return self.problems[0].solve(self.interaction.heated(temperature), before=before, step=step)

    def _heat_after(self, state: AnyState) -> HeatState:
        given, heat = self.interaction.given(state), self.interaction.worked(self.before, state)
        return self.problems[1].solve(heat, rate=self.rate, given=given)


def by_body(given: float | Mapping[str, float], heat: HeatScene) -> Mapping[str, float]:
    """Return a number for each body, given for all or by body."""
    return given if isinstance(given, Mapping) else dict.fromkeys(heat.bodies, given)


@collectively("solve_heated", lambda scene, heat, comm, **_: comm)
@naming_arguments
def solve_heated(
    scene: Scene,
    heat: HeatScene,
    comm: MPI.Comm,
    *,
    stress_free: float | Mapping[str, float] = 0.0,
    start: Mapping[str, float | np.ndarray] | None = None,
    before: HeatedState | None = None,
    duration: float = np.inf,
    partitions: Mapping[str, np.ndarray] | None = None,
    tolerance: float = 1e-9,
    settled: float = 1e-7,
) -> HeatedState:
    """Compute temperatures and deformation that depend on each other. Collective on ``comm``.

    Temperatures strain bodies that expand, and change `TemperatureDependentElasticity`. A `ThermalContact`
    has the pressures, forces by undeformed area, and gaps of the contact pair with its surfaces, whichever is
    the slave; without such a pair the gap that displacements leave. A `TemperatureTable` of its
    `FrictionHeat` is also the friction coefficient of a pair with Coulomb's law. Where one field does not
    depend on the other, each is solved once.

    Args:
        scene: Mechanics of the bodies.
        heat: Heat of these bodies on the same meshes, see `HeatScene.on`; others have no thermal strain.
        comm: Communicator over which the subdomains are spread.
        stress_free: Temperature at which bodies are free of thermal strain, one for all or by body.
        start: Temperatures to begin with, by body; by default those before, or free of stress. Of several
            steady states one that they lead to is found.
        before: State at the end of the step before, with the same bodies.
        duration: Time of the step, in which bodies store heat since ``before``, by Euler's rule of the first
            order, and friction forces times slips become heat; by default so long that a steady state is
            reached, in which prescribed speeds alone heat. Without ``before`` nothing is stored.
        partitions: As for `solve_scene`.
        tolerance: Largest relative residual of mechanics; it bounds how steep films may be.
        settled: Largest change of temperatures in the last pass, relative to their range.

    Raises:
        InvalidInputError: If both scenes do not fit each other.
        InfeasibleError: If nothing holds a body, or the temperature of a heated one.
        ConvergenceError: If there is no steady state, or none is found.

    Example:
        >>> steel, hot = Conductor(0.05, 3.7e-3), HeldTemperature("rod", "x0", 80.0)
        >>> heat = HeatScene.on(scene, {"rod": steel}, held=[hot])  # doctest: +SKIP
        >>> steady = solve_heated(scene, heat, comm, stress_free=20.0)  # doctest: +SKIP
        >>> later = solve_heated(scene, heat, comm, before=steady, duration=5.0)  # doctest: +SKIP
    """
    cold = by_body(stress_free, heat)
    old: Mapping[str, float | np.ndarray] = cold
    given, words = start or {}, "temperatures free of stress"
    with together(comm):
        check_fit(scene, heat, cold)
        for name in given:
            check_known(name, heat.bodies, f"start has temperatures of body {name!r}, the heat has")
        materials = [each for body in heat.bodies.values() for each in body.materials]
        if before is not None and duration < np.inf and not all(each.capacities for each in materials):
            raise InvalidInputError(
                f"a step of a time, got {duration:g}, needs heat capacities of all bodies: give "
                "Conductor(conductivity, heat_capacity), or leave out the duration for a steady state"
            )
    if before is not None:
        problems, mechanics = before.problems, before.mechanics
        old, words = before.heat.temperature, "those before the step"
        rate = Rate(1.0 / duration, before.heat.values, problems[1].no_rate.history)
    else:
        warn_of(odd_power(scene, heat), comm)
        problems = (
            ContactProblem(scene, comm, partitions=partitions, tolerance=tolerance),
            HeatProblem(heat, comm, partitions=partitions),
        )
        rate, mechanics = problems[1].no_rate, None
    first = [np.zeros(body.mesh.n_nodes) + {**old, **given}[name] for name, body in heat.bodies.items()]
    tearing, words = problems[1].decomposition.tearing, "the given temperatures" if start else words
    interaction = Interaction(scene, heat, problems[1].joints(heat), tearing, cold, duration)
    passes = Passes(interaction, problems, mechanics, rate, settled, words)
    return passes.run(np.concatenate(first))
