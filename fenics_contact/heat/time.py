"""Temperatures in time, in steps of one length or of a given error; heat is balanced in each of them."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, inf, isfinite, nan
from typing import Any, Generic, Literal, Protocol, TypeAlias, TypeVar

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import Task
from fenics_contact._scene.checks import check_known, check_positive
from fenics_contact._scene.fields import evaluate, finite_numbers
from fenics_contact.errors import ConvergenceError, InvalidInputError, collectively, together
from fenics_contact.errors.kinds import safe_log, user_code
from fenics_contact.heat.assembly import Rate
from fenics_contact.heat.parts import Value
from fenics_contact.heat.plausible import odd_values, warn_of
from fenics_contact.heat.problem import HeatProblem
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatBalance, HeatState

_LOG = logging.getLogger(__name__)
#: What is known at a time: a `HeatState`, or that of both fields.
Known = TypeVar("Known", bound=Any)
#: Takes a step and that before; returns a, b, c of the rate of heat at its end, a ΔH − b ΔH₋₁ − c q₋₁, with
#: ΔH what is stored in a step, and ΔH₋₁ and q₋₁ of the step before and at its end.
Weights: TypeAlias = Callable[[float, float], tuple[float, float, float]]


def _theta(theta: float) -> Weights:
    """Return the scheme in whose steps heat is stored at the rate θ q + (1 − θ) q₋₁."""
    return lambda step, before: (1.0 / (theta * step), 0.0, (1.0 - theta) / theta)


def _bdf2(step: float, before: float) -> tuple[float, float, float]:
    """Return the weights of the slope, at the last of three times, of the parabola through their heat."""
    ratio = step / before
    return (1.0 + 2.0 * ratio) / ((1.0 + ratio) * step), ratio**2 / ((1.0 + ratio) * step), 0.0


def _scheme(given: str | float) -> Weights:
    named: dict[Any, Weights] = {"bdf2": _bdf2, "euler": _theta(1.0), "crank-nicolson": _theta(0.5)}
    if given not in named and (isinstance(given, str) or not 0.5 <= given <= 1.0):
        words = f"scheme must be one of {[*named]}, or θ from 0.5 to 1"
        raise InvalidInputError(f"{words}, got {given!r}: give 'bdf2'")
    return named[given] if given in named else _theta(float(given))


class March(Protocol):
    """What leads from the state at one time to that at the next."""

    @property
    def problem(self) -> HeatProblem:
        """The heat."""

    @property
    def doubt(self) -> float:
        """Least error of a step by the difference from twice as long ones."""

    def end(self, last: Any, time: float, step: float, rate: Rate) -> Any:
        """Return the state at the end of a step after the last one, with its `heat`. Collective."""


@dataclass(frozen=True, eq=False)
class Course:
    """How long a history is, and its steps, see `heat_in_time`."""

    duration: float
    step: float
    tolerance: float
    scheme: str | float
    begin: int
    outputs: Sequence[float]

    def __post_init__(self) -> None:
        """Reject what is outside its range."""
        least = min(self.step, self.tolerance)
        check_positive("duration", self.duration, "give the end of the history")
        check_positive("step or tolerance", least, "give the length of steps, or their error")
        if self.begin < 1 or not all(0.0 < time <= self.duration for time in self.outputs):
            needed = f"begin must be at least 1 and outputs lie above 0 and up to {self.duration:g}"
            raise InvalidInputError(f"{needed}, got {self.begin} and {tuple(self.outputs)}: correct them")


@dataclass(frozen=True, eq=False)
class _HeatAlone:
    """Temperatures of a scene that depends on time."""

    problem: HeatProblem
    at: Callable[[float], HeatScene]
    doubt: float = 1.0

    def end(self, last: Any, time: float, step: float, rate: Rate) -> HeatState:
        scene = scene_at(self.at, time, self.problem.scene, self.problem.comm)
        return self.problem.solve(scene, rate=rate)


def scene_at(at: Callable[[float], Any], time: float, known: Any, comm: MPI.Comm) -> Any:
    """Return the scene of a time, which must have the bodies of a known one. Collective."""
    with together(comm), user_code("the scene as a function of time"):
        scene = at(time)
        if dict(scene.bodies) != dict(known.bodies):
            raise InvalidInputError(
                f"a scene must have the same bodies at all times, got others at {time:g}: make meshes "
                "and materials once, and only what holds and heats them in the function of time"
            )
    return scene


@dataclass(frozen=True, eq=False)
class _Moment:
    """Temperatures at a time, and what the next step needs of the last one.

    `state`: that of all fields, before the first step what is known of it;
    `inside`: rate at which the nodes of each subdomain of this rank store heat at its end, and what they
    stored in it, (2, n) each; `power`, `heat`, `total`: the same where it comes from, and since the start.
    """

    time: float
    state: Any
    values: np.ndarray
    inside: tuple[np.ndarray, ...]
    power: HeatBalance
    heat: HeatBalance
    total: HeatBalance
    number: int = 0
    step: float = inf


class _Track:
    """One history; its factors stay while its steps do."""

    def __init__(self, march: March, scheme: Weights, begin: int) -> None:
        self.march, self._scheme, self._begin = march, scheme, begin
        #: Error by the difference from twice as long steps; three and one times it if heat is smooth in time.
        self.doubt = 1.0 if sum(scheme(1.0, 1.0)[:2]) == 2.0 else 2.0  # is the rate of t² that of t = 1?
        self.doubt = max(self.doubt, march.doubt)

    def after(self, last: _Moment, step: float, time: float) -> _Moment:
        """Return the end of a step. Collective."""
        a, b, c = (self._scheme if last.number >= self._begin else _theta(1.0))(step, last.step)
        history = tuple(c * rate + b * heat for rate, heat in last.inside)
        whole = self.march.end(last.state, time, step, Rate(a, last.values, history))
        state: HeatState = whole.heat
        rates = zip(state.rates, history, strict=True)
        inside = tuple(np.stack([rate, (rate + known) / a]) for rate, known in rates)
        power = state.balance
        heat = HeatBalance.combined((1.0 / a, power), (c / a, last.power), (b / a, last.heat))
        total = HeatBalance.combined((1.0, last.total), (1.0, heat))
        return _Moment(time, whole, state.values, inside, power, heat, total, last.number + 1, step)


class _Steps:
    """Steps of one length; with a second history, whose steps are twice as long, of an error that this shows.

    Errors of heat die out, which the difference of whole histories knows: steps become long by themselves.
    """

    #: Part of half the tolerance that a step may use where errors are to die out, else they may grow in
    #: proportion to time; part of this that it aims at.
    greedy, aim = 0.2, 0.4
    #: By which factors steps become shorter or longer, and by which not. Shortest one, by the duration.
    shorter, longer, worth, least = 0.1, 1.5, 1.2, 1e-9
    #: Part of a step that did not converge.
    failing = 0.25

    def __init__(self, tracks: Sequence[_Track], first: Any, values: np.ndarray, course: Course) -> None:
        self.track, *self._others = tracks
        duration, step = course.duration, course.step
        self._duration, self._most, self._tolerance = duration, step, course.tolerance
        inside = tuple(np.zeros((2, len(each))) for each in self.track.march.problem.no_rate.history)
        none = HeatBalance({}, 0.0)
        self._coarse = self.moment = _Moment(0.0, first, values, inside, none, none, none)
        self._next, self.error = (min(1e-3 * duration, step), 0.0) if self._others else (step, nan)
        self._step, self._differs, self.rejected, self._failure = inf, 0.0, 0, ""

    def to(self, end: float) -> Iterator[_Moment]:
        """Go on to a time, step by step. Collective."""
        while (start := self.moment.time) < end:
            count = max(ceil((end - start) / self._next - 1e-9), 1)
            step = (end - start) / count
            if abs(step - self._step) > 1e-9 * step:  # else factors stay
                self._step = step
            time = end if count == 1 else start + step
            if self._made(start, time):
                yield self.moment
            else:
                self.rejected += 1

    def _made(self, start: float, time: float) -> bool:
        """Make a step unless it errs too much; set the length of the next one. Collective."""
        step = self._step
        if not self._others:
            self.moment = self.track.after(self.moment, step, time)
            return True
        if step < self.least * self._duration:
            raise ConvergenceError(
                f"steps must be longer than {step:.2g}, at {start:.6g} shorter ones err too much: loosen the "
                f"tolerance, or give the times at which loads jump as outputs{self._failure}"
            )
        try:
            coarse = self._others[0].after(self._coarse, step, time)
            half = self.track.after(self.moment, 0.5 * step, start + 0.5 * step)
            fine, last = self.track.after(half, 0.5 * step, time), self._differs
        except ConvergenceError as failure:
            self._failure, self._next = f"; the last step failed, {failure}", self.failing * step
            return False
        own = self.track.doubt * float(np.abs(fine.values - coarse.values).max())
        error = max(self.track.march.problem.comm.allgather(own))
        share = min(step / (self._duration - start), 1.0)
        allowed = max(self.greedy * (0.5 * self._tolerance - last), share * (self._tolerance - last))
        used = max((error - last) / allowed, 1e-10)
        factor = float(np.clip((self.aim / used) ** 0.5, self.shorter, self.longer))
        if factor < 1.0 or factor > self.worth:
            self._next = min(step * factor if factor < 1.0 else max(self._next, step * factor), self._most)
        if used <= 1.0:
            self._coarse, self.moment, self._differs = coarse, fine, error
            self.error = max(error, last)  # the difference may be about to change its sign
        return used <= 1.0


@displayed
@dataclass(frozen=True, eq=False)
class HeatHistory(Generic[Known]):
    """Temperatures over time, replicated on all ranks.

    Attributes:
        times: The start, and the outputs or, without these, the ends of all steps, shape (n,), [time].
        values: Temperatures of the nodes of all bodies, body after body, at these times, (n, n_nodes).
        errors: Estimated error by steps at each time, the largest of all nodes, (n,), [degree]; not a number
            where steps have one length.
        states: At the outputs and at the end, each a `HeatState`, or a `HeatedState` of both fields.
        balance: As in a `HeatState`, but of all the time, [energy]: powers by the quadrature of the scheme.
        error: Largest estimated error by steps at any time, [degree].
        steps: Number of steps; with a tolerance two between two times.
        rejected: How often two steps erred too much, or did not converge, and were done again, shorter.
        products: Applications of dual operators of heat.
    """

    times: np.ndarray
    values: np.ndarray
    errors: np.ndarray
    states: tuple[Known, ...]
    balance: HeatBalance
    error: float
    steps: int
    rejected: int
    products: int

    def temperature(self, body: str) -> np.ndarray:
        """Return the temperatures at the nodes of a body at all times, (n, n_nodes of the body)."""
        state: HeatState = self.states[-1].heat
        first = state.torn.decomposition.tearing.first_of(body)
        return self.values[:, first : first + len(state.temperature[body])]

    def _facts(self) -> dict[str, Any]:
        error = f"{self.error:.2g} degrees" if isfinite(self.error) else "not estimated, steps were given"
        return {
            "times": self.times, "temperatures": self.values, "error by steps": error, "steps": self.steps,
            "steps done again": self.rejected, "products": self.products, "heat": self.balance,
        }  # fmt: skip


@collectively("heat_in_time", lambda scene, comm, *_, **__: comm)
@naming_arguments
def heat_in_time(
    scene: HeatScene | Callable[[float], HeatScene],
    comm: MPI.Comm,
    duration: float,
    initial: float | Mapping[str, Value | np.ndarray] | HeatState,
    *,
    step: float = inf,
    tolerance: float = inf,
    scheme: Literal["bdf2", "euler", "crank-nicolson"] | float = "bdf2",
    begin: int = 1,
    outputs: Sequence[float] = (),
    partitions: Mapping[str, np.ndarray] | None = None,
) -> HeatHistory[HeatState]:
    """Compute temperatures over time. Collective on ``comm``.

    With a tolerance two histories go on side by side, one with steps half as long, which is the result. The
    error that is stated is their largest difference at any node, now and a step before, twice that of schemes
    of first order; it never exceeds the tolerance.

    Args:
        scene: Bodies with heat capacities, what heats and cools them, and where heat passes between them; or
            a function of time that returns one with the same bodies. Loads of a step are those at its end.
        comm: Communicator over which the subdomains are spread.
        duration: End of the history, which starts at 0, [time].
        initial: Temperatures at the start: a number; by body a number, an array of one for each node or a
            function of points; or those of a `HeatState`.
        step: Length of steps, [time]; with a tolerance, of the longest.
        tolerance: Largest error of temperatures by steps, [degree].
        scheme: "bdf2", of second order also where steps change; "euler", of first; "crank-nicolson", of
            second, but jumps of temperatures oscillate; or θ from 0.5 to 1, of which these two are the ends.
        begin: Number of Euler steps at the start, at least one: nothing is known of the time before.
        outputs: Times at which steps end, as where loads jump; what is kept is that at these and at the end.
        partitions: As for `solve_heat`.

    Raises:
        InvalidInputError: If a body has no heat capacity, or an argument is outside its range.
        ConvergenceError: If a solver does not converge, or steps become too short.

    Example:
        >>> history = heat_in_time(scene, MPI.COMM_WORLD, 60.0, 20.0, tolerance=0.1)  # doctest: +SKIP
        >>> history.temperature("plate").max(axis=1)  # doctest: +SKIP
    """
    at = always(scene)
    with together(comm):
        with user_code("the scene as a function of time"):
            first = at(0.0)
        values = at_start(first, initial)
    warn_of(odd_values(first), comm)

    def march() -> March:
        return _HeatAlone(HeatProblem(first, comm, partitions=partitions), at)

    return march_on(march, None, values, Course(duration, step, tolerance, scheme, begin, outputs))


def always(given: Any) -> Callable[[float], Any]:
    """Return what is given, a function of time or the same at all times, as a function."""
    return given if callable(given) else lambda time: given


def march_on(march: Callable[[], March], first: Any, values: np.ndarray, course: Course) -> HeatHistory[Any]:
    """Return the history that begins with temperatures, (n_nodes,). Collective.

    `march`: makes one of its own for each of the histories side by side; `first`: what is known at the start.
    """
    weights, outputs = _scheme(course.scheme), course.outputs
    tracks = [_Track(march(), weights, course.begin) for _ in range(1 + isfinite(course.tolerance))]
    steps = _Steps(tracks, first, values, course)
    return _history(steps, tracks, sorted({*outputs, course.duration}), every=len(outputs) == 0)


def _history(
    steps: _Steps, tracks: Sequence[_Track], ends: Sequence[float], *, every: bool
) -> HeatHistory[Any]:
    """Return the history of all steps. Collective."""
    problems = [track.march.problem for track in tracks]
    last, watch, states = steps.moment, _Watch(problems[0].comm), []
    kept, worst = [(0.0, last.values, steps.error)], steps.error
    with Task("heat in time") as task:
        for end in ends:
            for number, moment in enumerate(steps.to(end), last.number + 1):
                watch.see(moment.state.heat.scene, last.values, moment.values)
                last, worst = moment, max(worst, steps.error)
                task.step(number, words=f"time {moment.time:.6g} of {ends[-1]:.6g}")
                if every or moment.time == end:
                    kept.append((moment.time, moment.values, steps.error))
            states.append(last.state)
    times, values, errors = (np.array(each) for each in zip(*kept, strict=True))
    return HeatHistory(
        times, values, errors, tuple(states), last.total, worst, last.number,
        steps.rejected, sum(problem.products for problem in problems),
    )  # fmt: skip


def at_start(scene: HeatScene, given: Any) -> np.ndarray:
    """Return temperatures of the nodes of all bodies, (n_nodes,), if these can store heat."""
    found, given = [], getattr(given, "temperature", given)
    for name in given if isinstance(given, Mapping) else ():
        check_known(name, scene.bodies, f"initial names body {name!r}, the scene has")
    for name, body in scene.bodies.items():
        words, count, mine = f"the initial temperature of body {name!r}", body.mesh.n_nodes, given
        if any(each.heat_capacity is None for each in body.materials):
            raise InvalidInputError(
                f"body {name!r} must have a heat capacity where temperatures change in time, got none: give "
                "Conductor(conductivity, heat_capacity)"
            )
        if isinstance(given, Mapping):
            check_known(name, given, f"initial must have body {name!r}, it has", "add it")
            mine = given[name]
        values = evaluate(words, mine, body.mesh.points, ()) if callable(mine) else finite_numbers(mine)
        if values.shape not in ((), (count,)):
            needed = f"{words} must be a finite number, or one for each of {count} nodes"
            raise InvalidInputError(f"{needed}, got {mine!r}: correct it")
        found.append(np.broadcast_to(values, count))
    return np.concatenate(found)


class _Watch:
    """Warns once of temperatures that no body can have, and once of those that go up and down.

    `unnoticed`: what rounding may change of temperatures near zero, [degree].
    """

    unnoticed = 1e-9

    def __init__(self, comm: MPI.Comm) -> None:
        self._log = _LOG.debug if comm.rank else _LOG.warning
        self._warned, self._changes = set[str](), list[np.ndarray]()

    def see(self, scene: HeatScene, last: np.ndarray, values: np.ndarray) -> None:
        """Look at the end of a step."""
        known = np.array([last.min(), last.max(), *scene.levels])
        low, high = known.min(), known.max()
        sources = [*(each.value for each in scene.held), *(each.level for each in scene.loads)]
        rubbed = any(each.friction.part > 0.0 for each in scene.contacts)
        if not rubbed and all(not callable(each) and isfinite(each) for each in sources):
            words = (
                "temperatures lie %.3g degrees beyond those held, around and before: steps are short for the "
                "cells where temperatures jump (below h² c / (6 k) of linear cells of size h); give smaller "
                "cells there, or longer steps"
            )
            self._warn(words, max(low - values.min(), values.max() - high), high - low)
        self._changes = [*self._changes[-2:], values - last]
        if len(self._changes) == 3:
            first, second, third = self._changes
            turns = (first * second < 0.0) & (second * third < 0.0)
            words = (
                "temperatures go up and down by %.3g degrees from step to step: after jumps, as at the "
                "start, steps with θ near 1/2 oscillate; give scheme='bdf2', or begin=4 Euler steps"
            )
            self._warn(words, np.abs(self._changes).min(axis=0)[turns].max(initial=0.0), high - low)

    def _warn(self, words: str, degrees: float, scale: float, least: float = 0.01) -> None:
        if degrees > max(least * scale, self.unnoticed) and words not in self._warned:
            self._warned.add(words)
            safe_log(self._log, words, degrees)
