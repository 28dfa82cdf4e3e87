"""Mesh after mesh until a quantity is as accurate as asked for, refined where it matters for the quantity."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from fenics_contact._adaptive.marking import bulk
from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact._base.checks import check_numbers, checked
from fenics_contact._base.display import Table, displayed, tabled
from fenics_contact._base.libraries import MPI
from fenics_contact._base.memory import available_memory
from fenics_contact._base.progress import Task
from fenics_contact._scene.memory import Subdomains, expected_memory
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.kinds import safe_log, user_code

_LOG = logging.getLogger(__name__)

_State = TypeVar("_State")
_Problem = TypeVar("_Problem")


@displayed
@dataclass(frozen=True)
class Level:
    """One mesh of the way to an accuracy.

    Attributes:
        cells: Number of cells of all bodies.
        unknowns: Displacements or temperatures of all nodes, those that are held included.
        value: The quantity: that of the state, and what its adjoint has for its error.
        error: Estimate of the error of ``value``, ≥ 0, in its unit.
        products: Products of the dual solver with F.
        seconds: Wall time of the level: its mesh, its state and the estimate.
        predicted: What ``seconds`` was expected to be before the level began; NaN for the first.
        state_value: The quantity of the state alone.
        size: What the error is relative to, ≥ 0: the size of the value, of temperatures their range.
    """

    cells: int
    unknowns: int
    value: float
    error: float
    products: int
    seconds: float
    predicted: float
    state_value: float
    size: float

    @property
    def relative_error(self) -> float:
        """The error relative to the size."""
        if self.error == 0.0:
            return 0.0
        return self.error / self.size if self.size else float(np.inf)

    @property
    def in_words(self) -> tuple[str, ...]:
        """The numbers as far as ``predicted`` in this order, the error relative to the size."""
        relative = self.relative_error
        error = f"{100 * relative:.2g} %" if np.isfinite(relative) else "unknown"
        predicted = "" if np.isnan(self.predicted) else f"{self.predicted:.2f}"
        numbers = f"{self.cells}", f"{self.unknowns}", f"{self.value:.6g}", error, f"{self.products}"
        return (*numbers, f"{self.seconds:.2f}", predicted)


@tabled
@dataclass(frozen=True, eq=False)
class AccurateResult(Generic[_State]):
    """A quantity with its error, and the meshes on the way.

    Attributes:
        state: The state on the last mesh; its scene is ``state.scene``.
        value: The quantity: that of the state, and what its adjoint has for its error; see ``levels`` for
            that of the state alone.
        error: Estimate of the error of ``value``, ≥ 0, in its unit.
        wanted: Relative error that was asked for.
        reached: Whether ``error`` is at most ``wanted`` times the size of the quantity, see `Level`.
        reason: Why the last mesh is the last, in words.
        levels: All meshes, the coarsest first.
    """

    state: _State
    value: float
    error: float
    wanted: float
    reached: bool
    reason: str
    levels: tuple[Level, ...]

    @property
    def relative_error(self) -> float:
        """The error relative to the size of the quantity."""
        return self.levels[-1].relative_error

    def _tables(self) -> list[Table]:
        """Return a table with one line for each mesh, and how it ended."""
        head = ("cells", "unknowns", "value", "error", "products", "seconds", "predicted")
        rows: list[tuple[str, ...]] = [head, *(level.in_words for level in self.levels)]
        return [Table(rows, 0, (self.reason,))]


@displayed
@dataclass(frozen=True)
@checked()
class Limits:
    """What the way to an accuracy may cost; a mesh beyond it is not begun.

    Attributes:
        levels: Number of meshes, ≥ 1.
        unknowns: Largest number of unknowns of a mesh, ≥ 1.
        seconds: Largest wall time that a level may be expected to take, > 0, None for any.
        memory: Memory of all ranks together, > 0, [bytes]; None for what the machine has left.

    Raises:
        InvalidInputError: If a limit is not positive.
    """

    levels: int = 20
    unknowns: int = 100_000_000
    seconds: float | None = None
    memory: float | None = None

    def __post_init__(self) -> None:
        """Reject limits that allow nothing."""
        for name in ("levels", "unknowns", "seconds", "memory"):
            given = getattr(self, name)
            if given is not None and not given > 0:
                raise InvalidInputError(f"Limits.{name} must be above zero, got {given}: leave it out")


def require_share(relative_error: float) -> None:
    """Reject an accuracy that nobody can ask for."""
    check_numbers(relative_error=relative_error)
    if not 0.0 < relative_error < 1.0:
        raise InvalidInputError(
            f"relative_error must lie between 0 and 1, got {relative_error:g}: 0.01 asks for one percent"
        )


class Estimate(Protocol):
    """What is known of the error of a quantity of a state, see `GoalError`."""

    @property
    def value(self) -> float:
        """The quantity of the state."""

    @property
    def without_adjoint(self) -> str:
        """Why there is no adjoint, in words; empty where there is one."""

    @property
    def known(self) -> float:
        """What the exact value is larger by, as far as that is known."""

    def by_cell(self, body: str) -> np.ndarray:
        """Return the share of each cell of a body. Collective."""


class AccuracyLoop(ABC, Generic[_Problem, _State]):
    """The levels so far: how large errors are, what is refined, and when it ends.

    What is solved on a mesh and estimated there is that of a subclass.
    """

    where = ""  # of what they are, in words for warnings

    def __init__(self, wanted: float, limits: Limits, comm: MPI.Comm) -> None:
        self.wanted, self.limits, self.comm = wanted, limits, comm
        self.levels: list[Level] = []
        self.reason = self.without_adjoint = ""
        self._sums: list[float] = []
        self._corrected: list[float] = []
        self._state: _State
        self._began, self._predicted, self._coming = perf_counter(), float("nan"), 0

    def follow(self, first: _Problem, callback: Callable[[Level], None] | None) -> AccurateResult[_State]:
        """Return the result of all levels from a first problem on. Collective."""
        self._run(first, callback)
        if self.without_adjoint and self.comm.rank == 0:
            safe_log(
                _LOG.warning,
                "the error is judged by the changes between the last three meshes alone: %s",
                self.without_adjoint,
            )
        result = self._result()
        if not result.reached and self.comm.rank == 0:
            safe_log(_LOG.warning, "the accuracy asked for was not reached%s: %s", self.where, result.reason)
        return result

    def _run(self, first: _Problem, callback: Callable[[Level], None] | None) -> None:
        """Add all levels from a first problem on. Collective."""
        with Task("levels", most=self.limits.levels) as task:
            problem: Any = first
            while problem is not None:
                level = self.add(problem)
                if callback is not None:
                    with user_code("the callback of levels"):
                        callback(level)
                problem = self.next_problem(problem)
                task.step(len(self.levels), words=self._progress(problem))

    def add(self, problem: _Problem) -> Level:
        """Solve on the next mesh and estimate its error. Collective."""
        self._state = self._solved(problem)
        state_value, value, error = self._estimated()
        level = Level(
            cells=cells_of(self._scene),
            unknowns=unknowns_of(self._scene),
            value=value,
            error=error,
            products=self._products,
            seconds=self._spent(),
            predicted=self._predicted,
            state_value=state_value,
            size=self._size(value),
        )
        self.levels.append(level)
        return level

    @abstractmethod
    def _solved(self, problem: _Problem) -> _State:
        """Return the state on the next mesh. Collective."""

    @abstractmethod
    def _estimate(self) -> Estimate:
        """Return the quantity of the last state and what is known of its error. Collective."""

    @abstractmethod
    def _next(
        self, problem: _Problem, found: SceneRefinement, partitions: Mapping[str, np.ndarray]
    ) -> _Problem:
        """Return the problem on refined meshes."""

    @property
    @abstractmethod
    def _scene(self) -> Scene:
        """The meshes of the last state with its unknowns."""

    @property
    @abstractmethod
    def _products(self) -> int:
        """Products with F of the last mesh."""

    @property
    def _uncorrected(self) -> bool:
        """Whether estimates correct nothing on the last mesh."""
        return False

    def _size(self, value: float) -> float:
        """Return what errors are relative to."""
        return abs(value)

    def _beyond(self, changes: np.ndarray) -> float:
        """Return what may be missing beyond what changes of the last values, (2,), tell."""
        return 0.0

    def _zero(self, last: Level) -> str:
        """Return why there is no error relative to the quantity, in words; empty if there is."""
        return (
            "" if last.size else "the quantity is zero on this mesh, and no error is small relative to that"
        )

    def _hopeless(self) -> str:
        """Return why no mesh makes the quantity accurate, in words; empty if one may."""
        return ""

    def _remarks(self) -> list[str]:
        """Return what keeps errors large, in words."""
        return []

    def _halved(self, marked: Mapping[str, np.ndarray]) -> SceneRefinement:
        """Return the next meshes, with some cells halved."""
        return refine_scene(self._scene, marked)

    def _memory(self, scene: Scene, partitions: Mapping[str, np.ndarray]) -> float:
        """Return the memory that a mesh needs on all ranks together, [bytes]."""
        return expected_memory(scene, Subdomains.of(scene, partitions), self.comm.size)

    def _estimated(self) -> tuple[float, float, float]:
        """Return the quantity of the state, corrected, and its error. Collective.

        Where an estimate is above the quantity itself, nothing is corrected, and the error is unknown.
        """
        estimate = self._estimate()
        self.without_adjoint = estimate.without_adjoint
        self._shares = {name: estimate.by_cell(name) for name in self._scene.bodies}
        self._sums.append(float(sum(share.sum() for share in self._shares.values())))
        missing = estimate.known
        if abs(missing) > self._size(estimate.value):  # more than the quantity itself is no correction
            self._corrected.append(float("nan"))
            return estimate.value, estimate.value, float("inf")
        value = estimate.value + missing
        self._corrected.append(float("nan") if self._uncorrected else value)
        return estimate.value, value, self._error(missing, value)

    def _spent(self) -> float:
        """Return the wall time since it was last asked for, that of the slowest rank. Collective."""
        began, self._began = self._began, perf_counter()
        return float(self.comm.allreduce(self._began - began, MPI.MAX))

    def _error(self, missing: float, value: float, least: float = 0.5, most: float = 0.9) -> float:
        """Return the error of a corrected value: the estimate, and what estimates have turned out to miss.

        Values J + η, corrected by their estimates η, agree from mesh to mesh where the estimates are right.
        If what they miss falls by the ratio r, r / (1 − r) times the change of J + η is missing on this mesh,
        too. The change counts that is larger: the last one, or what r leaves of the one before, as one may be
        small by chance. r is the ratio of the sums of all cells' shares, or the `_observed` one where that is
        larger. More may be missing, see `_beyond`. As η may be wrong as a whole, it counts once. Without
        adjoint η is zero, and r that of the two changes where that is larger. A mesh without estimate was
        refined at a spot alone, and its change says nothing of the others: three meshes with estimates are
        needed. An error above the size of the value is none. `missing`: η; `value`: J + η; `least`, `most`:
        bounds of r, half of errors are left where cells are halved.
        """
        changes = np.abs(np.diff(self._corrected[-3:]))
        if len(changes) < 2 or np.isnan(changes).any():
            return float("inf")
        (earlier, change), (before, last) = changes, self._sums[-2:]
        ratio = max(last / before if before > 0.0 else 0.0, least)
        if self.without_adjoint:
            ratio = min(max(ratio, change / earlier if earlier > 0.0 else 0.0), most)
        else:
            ratio = max(min(ratio, most), self._observed())
        missed = float(max(ratio * earlier, change)) * ratio / (1.0 - ratio)
        error = abs(missing) + max(missed, self._beyond(changes))
        return error if error <= self._size(value) else float("inf")

    def _observed(self, changes: int = 3, most: float = 0.95) -> float:
        """Return the ratio of the last two changes of corrected values; zero where that may be chance.

        At strong singularities, as where stiff and soft materials cross, estimates miss most of the error,
        and what they miss falls by the same ratio from mesh to mesh: then values have changed to one side so
        many `changes` in a row. `most`: largest ratio.
        """
        steps = np.diff(self._corrected[-changes - 1 :])
        if len(steps) < changes or steps[-2] == 0.0 or not (np.sign(steps) == np.sign(steps[-1])).all():
            return 0.0
        return float(min(steps[-1] / steps[-2], most))

    def next_problem(self, problem: _Problem, growth: float = 1.2) -> _Problem | None:
        """Return the problem on the next mesh, None if this one was the last; tells why. Collective.

        `growth`: exponent of the unknowns by which the time of a level grows.
        """
        last, limits = self.levels[-1], self.limits
        aim = self.wanted * last.size
        self.reason = self._zero(last)
        if self.reason:
            return None
        if last.error <= aim:
            self.reason = f"{error_in_words(last)}, {100 * self.wanted:.3g} % were asked for"
            return None
        self.reason = self._hopeless()
        if not self.reason and len(self.levels) == limits.levels:
            so_far = f"{error_in_words(last)} after {limits.levels} meshes"
            self.reason = f"{so_far}, as many as limits.levels allows"
        if self.reason:
            return None
        with together(self.comm):
            found = self._finer(aim)
            partitions = found.scene.partition(self.comm.size)
            needed = self._memory(found.scene, partitions)
            left = limits.memory or available_memory()
        self._coming = unknowns = unknowns_of(found.scene)
        self._predicted = last.seconds * (unknowns / last.unknowns) ** growth
        next_mesh = f"{error_in_words(last)}, and the next mesh of {unknowns} unknowns would"
        if unknowns > limits.unknowns:
            self.reason = f"{next_mesh} be larger than limits.unknowns allows, {limits.unknowns}"
        elif limits.seconds is not None and self._predicted > limits.seconds:
            self.reason = (
                f"{next_mesh} take about {self._predicted:.2g} s, limits.seconds allows {limits.seconds:g}"
            )
        elif self.comm.bcast(left is not None and needed > left):
            self.reason = f"{next_mesh} need about {needed / 1e9:.2g} GB, {(left or 0.0) / 1e9:.2g} are left"
        return None if self.reason else self._next(problem, found, partitions)

    def _finer(self, aim: float) -> SceneRefinement:
        """Return the next meshes for an error that is aimed at."""
        return self._refined(aim)

    def _refined(
        self,
        aim: float,
        least: float = 0.2,
        most: float = 0.8,
        safety: float = 0.8,
        halved: float = 0.25,
        growth: float = 3.0,
        tries: int = 3,
    ) -> SceneRefinement:
        """Return the next meshes: so many cells are halved that the next error is the one aimed at.

        `aim`: the error asked for; `least`, `most`: bounds of the share of the estimates whose cells are
        halved; `safety`: part of the error asked for that the next mesh aims at; `halved`: what halving
        leaves of the share of a cell; `growth`: largest factor by which the number of cells may grow, so
        that the last mesh is not much larger than it must be; `tries`: meshes that are made for that.
        """
        wanted = (1.0 - safety * aim / self.levels[-1].error) / (1.0 - halved)
        wanted = np.ceil(20.0 * wanted) / 20.0  # rounding of the error, other with other ranks, marks no cell
        share = min((growth - 1.0) / (2.0**self._scene.dim - 1.0), 1.0)
        for _ in range(tries):
            found = self._halved(bulk(self._shares, min(max(wanted, least), most), share))
            grown = cells_of(found.scene) / self.levels[-1].cells
            if grown <= growth:
                break
            share *= (growth - 1.0) / (grown - 1.0)  # meshes need others to be halved, too
        return found

    def _without_limit(self, changes: int = 3) -> bool:
        """Return whether the value has changed by more from mesh to mesh, always to the same side.

        Changes count by the growth of the mesh: one that is hardly refined changes it little.
        """
        estimated = zip(self.levels[2:], self._corrected[2:], strict=True)
        known = [level for level, corrected in estimated if not np.isnan(corrected)][-changes - 1 :]
        steps = np.diff([level.state_value for level in known])
        growths = np.diff(np.log([level.unknowns for level in known]))
        if len(steps) < changes or not (np.sign(steps) == np.sign(steps[0])).all():
            return False
        rates = np.abs(steps) / growths
        return bool((rates[1:] >= rates[:-1]).all())

    def _progress(self, coming: _Problem | None) -> str:
        """Return the last mesh in words, and before the next one begins what is expected of it."""
        last = self.levels[-1]
        words = f"{last.unknowns} unknowns, {last.value:.6g} ± {last.error:.2g}, {last.seconds:.2g} s"
        if coming is None:
            return words
        return f"{words}; next: {self._coming} unknowns, about {self._predicted:.2g} s"

    def _result(self) -> AccurateResult[_State]:
        """Return the result on the last mesh."""
        last = self.levels[-1]
        reached = last.error <= self.wanted * last.size
        found = self._state, last.value, last.error, self.wanted, reached
        reason = "; ".join([self.reason, *([] if reached else self._remarks())])
        return AccurateResult(*found, reason, tuple(self.levels))


def error_in_words(level: Level) -> str:
    """Return the error of a level relative to its size, in words."""
    error = level.relative_error
    return f"an error of {100 * error:.2g} %" if np.isfinite(error) else "an unknown error"


def cells_of(scene: Scene) -> int:
    """Return the number of cells of all bodies."""
    return sum(body.mesh.n_cells for body in scene.bodies.values())


def unknowns_of(scene: Scene) -> int:
    """Return the number of unknowns of all nodes."""
    return scene.components * sum(body.mesh.n_nodes for body in scene.bodies.values())
