"""A quantity to the accuracy that is asked for: mesh after mesh, refined where it matters for it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import cast

import numpy as np

from fenics_contact._adaptive.crossings import left_at_crossings, refined_at_crossings
from fenics_contact._adaptive.goal_errors import goal_error, value_of
from fenics_contact._adaptive.locking import locking_in_words
from fenics_contact._adaptive.marking import bulk
from fenics_contact._adaptive.quantities import quantity as named
from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact._adaptive.sticking_ends import depends_on_slip, refined_at_sticking_ends
from fenics_contact._adaptive.underresolved_contact import refined_at_spots, underresolved_pairs
from fenics_contact._base.checks import check_numbers, checked
from fenics_contact._base.display import Table, displayed, tabled
from fenics_contact._base.libraries import MPI
from fenics_contact._base.memory import available_memory
from fenics_contact._base.progress import Task
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._scene.memory import Subdomains, expected_memory
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.true_shapes import sides_without_shape
from fenics_contact.design.objective import Objective, can_be_infinite
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.errors.kinds import safe_log, user_code
from fenics_contact.mesh.refinement import Refinement
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.resolution import BetweenNodes
from fenics_contact.results.state import State

_LOG = logging.getLogger(__name__)


@displayed
@dataclass(frozen=True)
class Level:
    """One mesh of the way to an accuracy.

    Attributes:
        cells: Number of cells of all bodies.
        unknowns: Displacements of all nodes, those on supports included.
        value: The quantity: that of the state, and what its adjoint has for its error.
        error: Estimate of the error of ``value``, ≥ 0, in its unit.
        products: Products of the dual solver with F.
        seconds: Wall time of the level: its mesh, its state and the estimate.
        predicted: What ``seconds`` was expected to be before the level began; NaN for the first.
        state_value: The quantity of the state alone.
    """

    cells: int
    unknowns: int
    value: float
    error: float
    products: int
    seconds: float
    predicted: float
    state_value: float

    @property
    def in_words(self) -> tuple[str, ...]:
        """All numbers but the last in the order of the attributes, the error relative to the value."""
        relative = _relative(self.error, self.value)
        error = f"{100 * relative:.2g} %" if np.isfinite(relative) else "unknown"
        predicted = "" if np.isnan(self.predicted) else f"{self.predicted:.2f}"
        numbers = f"{self.cells}", f"{self.unknowns}", f"{self.value:.6g}", error, f"{self.products}"
        return (*numbers, f"{self.seconds:.2f}", predicted)


@tabled
@dataclass(frozen=True, eq=False)
class AccurateResult:
    """A quantity with its error, and the meshes on the way.

    Attributes:
        state: The state on the last mesh; its scene is ``state.scene``.
        value: The quantity: that of the state, and what its adjoint has for its error; see ``levels`` for
            that of the state alone.
        error: Estimate of the error of ``value``, ≥ 0, in its unit.
        wanted: Relative error that was asked for.
        reached: Whether ``error`` is at most ``wanted`` times ``value``.
        reason: Why the last mesh is the last, in words.
        levels: All meshes, the coarsest first.
    """

    state: State
    value: float
    error: float
    wanted: float
    reached: bool
    reason: str
    levels: tuple[Level, ...]

    @property
    def relative_error(self) -> float:
        """The error relative to the value."""
        return _relative(self.error, self.value)

    def _tables(self) -> list[Table]:
        """Return a table with one line for each mesh, and how it ended."""
        head = ("cells", "unknowns", "value", "error", "products", "seconds", "predicted")
        rows: list[tuple[str, ...]] = [head, *(level.in_words for level in self.levels)]
        return [Table(rows, 0, (self.reason,))]


def _relative(error: float, value: float) -> float:
    if error == 0.0:
        return 0.0
    return error / abs(value) if value != 0.0 else float(np.inf)


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


@collectively("solve_to", lambda scene, quantity, relative_error, comm, **_: comm)
def solve_to(
    scene: Scene,
    quantity: Objective | str,
    relative_error: float,
    comm: MPI.Comm,
    *,
    limits: Limits | None = None,
    solver: DualSolver | None = None,
    tolerance: float = 1e-6,
    callback: Callable[[Level], None] | None = None,
) -> AccurateResult:
    """Compute a quantity of an equilibrium to an accuracy, on meshes that are refined where it pays.

    The scene is solved on its own mesh, the error of the quantity is estimated by its adjoint, the cells that
    hold most of it are halved, and so on until the estimate is small enough. Before the third mesh with an
    estimate the error counts as unknown. While the spot of a contact is smaller than two cells or has but
    one facet's nodes, there is no estimate, and the cells there are halved: until two lie across its half
    width by Hertz's theory, or once where that does not hold. The quantity is that of the state and the
    estimate of `goal_error`, which together are mostly more accurate by far than the state alone. Its
    error is the size of the estimate, and what estimates miss, by what values corrected by them have
    changed by on the last meshes, and by the ratio of these changes where that is known; one above the value
    itself counts as unknown. It is no bound: on random scenes that were not used to choose the rule, with at
    most 1500 unknowns in the plane and 3000 in space, the value on up to two further halvings of all cells,
    extrapolated, was within it in 111 of 114.

    Args:
        scene: The scene on a coarse mesh.
        quantity: The quantity: an objective, or a name that `quantity` knows.
        relative_error: Largest error of the quantity relative to it, between 0 and 1.
        comm: Communicator over which the subdomains are spread.
        limits: What may be spent.
        solver: As for `fenics_contact.solve_scene`.
        tolerance: Largest relative residual of each state. Looser ones save few products, but what is refined
            then depends on the number of ranks.
        callback: Called on all ranks with every level once it is done.

    Returns:
        The result on the last mesh; where the accuracy was not reached, it says so, and a warning.

    Raises:
        InvalidInputError: If the accuracy is not between 0 and 1, the quantity is none of the scene, or the
            cells of its meshes cannot be refined.
        InfeasibleError: If nothing holds some body against its load.
        ConvergenceError: If the solver does not reach its tolerance on some mesh.

    Example:
        >>> result = solve_to(scene, "peak_pressure", 0.01, MPI.COMM_WORLD)  # doctest: +SKIP
        >>> print(result)  # the levels, and why the last is the last  # doctest: +SKIP
    """
    with together(comm):
        require_share(relative_error)
        objective = named(quantity, scene) if isinstance(quantity, str) else quantity
    way = AdaptiveLoop(objective, relative_error, limits or Limits(), comm)
    return followed(way, ContactProblem(scene, comm, solver=solver, tolerance=tolerance), callback)


def require_share(relative_error: float) -> None:
    """Reject an accuracy that nobody can ask for."""
    check_numbers(relative_error=relative_error)
    if not 0.0 < relative_error < 1.0:
        raise InvalidInputError(
            f"relative_error must lie between 0 and 1, got {relative_error:g}: 0.01 asks for one percent"
        )


def followed(
    way: AdaptiveLoop, first: ContactProblem, callback: Callable[[Level], None] | None
) -> AccurateResult:
    """Return the result of all levels from a first problem on. Collective."""
    scene, comm = first.scene, first.comm
    with Task("levels", most=way.limits.levels) as task:
        warnings, problem = first.defer_warnings(), cast("ContactProblem | None", first)
        while problem is not None:
            level = way.add(problem)
            if callback is not None:
                with user_code("the callback of levels"):
                    callback(level)
            problem = way.next_problem(problem)
            task.step(len(way.levels), words=way.progress(problem))
    warnings.tell()
    faceted = faceted_surfaces(scene) if len(way.levels) > 1 else []
    if faceted and comm.rank == 0:
        safe_log(
            _LOG.warning,
            "%s is curved, but its mesh knows no true shape: its facets were refined as facets, and the "
            "quantity is that of a body with facets; give the mesh shapes, or read it from CAD",
            " and ".join(faceted),
        )
    if way.without_adjoint and comm.rank == 0:
        safe_log(
            _LOG.warning,
            "the error is judged by the changes between the last three meshes alone: %s",
            way.without_adjoint,
        )
    result = way.result()
    if not result.reached and comm.rank == 0:
        safe_log(_LOG.warning, "the accuracy asked for was not reached%s: %s", way.where, result.reason)
    return result


class AdaptiveLoop:
    """The levels so far."""

    where = ""  # of what they are, in words for warnings

    def __init__(self, quantity: Objective, wanted: float, limits: Limits, comm: MPI.Comm) -> None:
        self.quantity, self.wanted, self.limits, self.comm = quantity, wanted, limits, comm
        self.levels: list[Level] = []
        self.reason = self.without_adjoint = ""
        self._sums: list[float] = []
        self._corrected: list[float] = []
        self._near_crossings: list[float] = []
        self._beyond_crossings = 0.0
        self._state: State
        self._refinements: Mapping[str, Refinement] = {}
        self._began, self._predicted = perf_counter(), float("nan")

    def add(self, problem: ContactProblem) -> Level:
        """Solve on the next mesh and estimate its error. Collective."""
        self._state = self._solved(problem)
        self._doubted, scene = underresolved_pairs(self._state), self._state.scene
        self._near_crossings.append(left_at_crossings(scene))
        state_value, value, error = self._estimated()
        level = Level(
            cells=cells_of(scene),
            unknowns=unknowns_of(scene),
            value=value,
            error=error,
            products=self._products,
            seconds=self._spent(),
            predicted=self._predicted,
            state_value=state_value,
        )
        self.levels.append(level)
        return level

    @property
    def _missed(self) -> bool:
        """Whether surfaces touch between nodes, so that a quantity may be zero that is not."""
        return any(isinstance(each, BetweenNodes) for each in self._state.peak_uncertainties)

    def _solved(self, problem: ContactProblem) -> State:
        """Return the state on the next mesh. Collective."""
        if not self.levels:
            return problem.solve(adjoint=True)
        return problem.solve(start=self._state, refinements=self._refinements, adjoint=True)

    @property
    def _products(self) -> int:
        """Products with F of the last mesh."""
        return self._state.solution.products

    def _estimated(self) -> tuple[float, float, float]:
        """Return the quantity of the state, corrected, and its error. Collective.

        Where a spot is too small for its cells, or an estimate is above the quantity itself, nothing is
        corrected, and the error is unknown.
        """
        unmet = self._missed and not self._state.contact.normal_force.any()  # quantities may not exist
        value = value_of(self._state, self.quantity) if self._doubted and not unmet else 0.0
        if value != 0.0 or unmet:  # what a single point presses follows from the load, its adjoint is none
            self._sums.append(float("nan"))
            self._corrected.append(float("nan"))
            return value, value, float("inf")
        estimate = goal_error(self._state, self.quantity)
        self.without_adjoint = estimate.without_adjoint
        self._shares = {name: estimate.by_cell(name) for name in self._state.scene.bodies}
        self._sums.append(float(sum(share.sum() for share in self._shares.values())))
        missing = estimate.known
        if abs(missing) > abs(estimate.value):  # more than the quantity itself is no correction
            self._corrected.append(float("nan"))
            return estimate.value, estimate.value, float("inf")
        value = estimate.value + missing
        self._corrected.append(float("nan") if self._doubted else value)
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
        larger. Where materials cross, more may be missing, see `_missed_at_crossings`. As η may be wrong as a
        whole, it counts once. Without adjoint η is zero, and r that of the two changes where that is larger.
        A mesh without estimate was refined at a spot alone, and its change says nothing of the others: three
        meshes with estimates are needed. An error above the value itself is none. `missing`: η; `value`: J +
        η; `least`, `most`: bounds of r, half of errors are left where cells are halved.
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
        self._beyond_crossings = self._missed_at_crossings(changes)
        missed = float(max(ratio * earlier, change)) * ratio / (1.0 - ratio)
        error = abs(missing) + max(missed, self._beyond_crossings)
        return error if error <= abs(value) else float("inf")

    def _missed_at_crossings(self, changes: np.ndarray) -> float:
        """Return what this mesh misses where stiff and soft materials cross, by the theory of such places.

        What is missed there falls by a known ratio from mesh to mesh, see `left_at_crossings`, and not faster
        even if the last meshes look so: the changes are those of a geometric series whose ratio may be 0.9.
        Once the cells there are not halved any more, what they miss stays.
        """
        sizes = self._near_crossings[-3:]
        falls = zip(changes.tolist(), pairwise(sizes), strict=False)
        rests = [change * sizes[-1] / (before - after) for change, (before, after) in falls if before > after]
        return max(rests, default=self._beyond_crossings)

    def _crossing_in_words(self) -> str:
        if (
            2.0 * self._beyond_crossings < self.wanted * abs(self.levels[-1].value)
            or not self._beyond_crossings
        ):
            return ""
        return (
            "most of what is not known lies where stiff and soft materials cross in a point, or a clamp ends "
            "at a soft one beside a stiff one, in cells smaller than any: part the stiff ones there, or let "
            "them overlap"
        )

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

    def next_problem(self, problem: ContactProblem, growth: float = 1.2) -> ContactProblem | None:
        """Return the problem on the next mesh, None if this one was the last; tells why. Collective.

        `growth`: exponent of the unknowns by which the time of a level grows.
        """
        last, limits = self.levels[-1], self.limits
        aim = self.wanted * abs(last.value)
        if last.state_value == 0.0 and not self._missed:
            self.reason = (
                "the quantity is zero on this mesh, and no error is small relative to that: ask for another "
                "one, or start on a finer mesh if surfaces touch on that"
            )
            return None
        if last.error <= aim:
            self.reason = f"{_percent(last)}, {100 * self.wanted:.3g} % were asked for"
            return None
        self.reason = self._singular()
        if not self.reason and len(self.levels) == limits.levels:
            self.reason = f"{_percent(last)} after {limits.levels} meshes, as many as limits.levels allows"
        if self.reason:
            return None
        with together(self.comm):
            found = self._refined(aim)
            scene, self._refinements = found.scene, found.refinements
            partitions = scene.partition(self.comm.size)
            needed = expected_memory(scene, Subdomains.of(scene, partitions), self.comm.size)
            left = limits.memory or available_memory()
        unknowns = unknowns_of(scene)
        self._predicted = last.seconds * (unknowns / last.unknowns) ** growth
        next_mesh = f"{_percent(last)}, and the next mesh of {unknowns} unknowns would"
        if unknowns > limits.unknowns:
            self.reason = f"{next_mesh} be larger than limits.unknowns allows, {limits.unknowns}"
        elif limits.seconds is not None and self._predicted > limits.seconds:
            self.reason = (
                f"{next_mesh} take about {self._predicted:.2g} s, limits.seconds allows {limits.seconds:g}"
            )
        elif self.comm.bcast(left is not None and needed > left):
            self.reason = f"{next_mesh} need about {needed / 1e9:.2g} GB, {(left or 0.0) / 1e9:.2g} are left"
        return None if self.reason else problem.on(scene, partitions)

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
        if self._doubted:
            return self._at_spots()
        wanted = (1.0 - safety * aim / self.levels[-1].error) / (1.0 - halved)
        wanted = np.ceil(20.0 * wanted) / 20.0  # rounding of the error, other with other ranks, marks no cell
        share = min((growth - 1.0) / (2.0**self._state.scene.dim - 1.0), 1.0)
        for _ in range(tries):
            marked = bulk(self._shares, min(max(wanted, least), most), share)
            found = self._halved(marked)
            grown = cells_of(found.scene) / self.levels[-1].cells
            if grown <= growth:
                break
            share *= (growth - 1.0) / (grown - 1.0)  # meshes need others to be halved, too
        return self._at_points(found)

    def _at_spots(self) -> SceneRefinement:
        """Return the next meshes where spots are smaller than their cells."""
        return refined_at_spots(self._state, self._doubted)

    def _at_points(self, found: SceneRefinement) -> SceneRefinement:
        """Return the next meshes with smaller cells where materials cross and ends of contacts may slip."""
        if depends_on_slip(self.quantity):
            found = refined_at_sticking_ends(self._state, found)
        return refined_at_crossings(found)

    def _halved(self, marked: Mapping[str, np.ndarray]) -> SceneRefinement:
        """Return the next meshes, with some cells halved."""
        return refine_scene(self._state.scene, marked)

    def _singular(self, changes: int = 3) -> str:
        """Say so if the value has changed by more from mesh to mesh, always to the same side.

        Changes count by the growth of the mesh: one that is hardly refined changes it little.
        """
        if not can_be_infinite(self.quantity):
            return ""
        estimated = zip(self.levels[2:], self._corrected[2:], strict=True)
        known = [level for level, corrected in estimated if not np.isnan(corrected)][-changes - 1 :]
        steps = np.diff([level.state_value for level in known])
        growths = np.diff(np.log([level.unknowns for level in known]))
        if len(steps) < changes or not (np.sign(steps) == np.sign(steps[0])).all():
            return ""
        rates = np.abs(steps) / growths
        if not (rates[1:] >= rates[:-1]).all():
            return ""
        faceted = faceted_surfaces(self._state.scene)
        corners, remedy = "as stress does at sharp corners", "round the corner"
        if faceted:
            corners += f", which {faceted[0]} has between its facets, as its mesh knows no true shape"
            remedy = "give the mesh shapes"
        return (
            f"{_percent(self.levels[-1])}, and the value grows without limit as cells get smaller, by more "
            f"from mesh to mesh, {corners}: ask for another quantity or {remedy}"
        )

    def progress(self, coming: ContactProblem | None) -> str:
        """Return the last mesh in words, and before the next one begins what is expected of it."""
        last = self.levels[-1]
        words = f"{last.unknowns} unknowns, {last.value:.6g} ± {last.error:.2g}, {last.seconds:.2g} s"
        if coming is None:
            return words
        return f"{words}; next: {unknowns_of(coming.scene)} unknowns, about {self._predicted:.2g} s"

    def result(self) -> AccurateResult:
        """Return the result on the last mesh."""
        last = self.levels[-1]
        reached = last.error <= self.wanted * abs(last.value)
        found = self._state, last.value, last.error, self.wanted, reached
        causes = [] if reached else [self._crossing_in_words(), locking_in_words(self._state.scene)]
        reason = "; ".join([self.reason, *filter(None, causes)])
        return AccurateResult(*found, reason, tuple(self.levels))


def _percent(level: Level) -> str:
    error = _relative(level.error, level.value)
    return f"an error of {100 * error:.2g} %" if np.isfinite(error) else "an unknown error"


def cells_of(scene: Scene) -> int:
    """Return the number of cells of all bodies."""
    return sum(body.mesh.n_cells for body in scene.bodies.values())


def unknowns_of(scene: Scene) -> int:
    """Return the number of displacements of all nodes."""
    return scene.components * sum(body.mesh.n_nodes for body in scene.bodies.values())


def faceted_surfaces(scene: Scene) -> list[str]:
    """Return in words the curved surfaces of contacts that are refined as facets: their shape is unknown."""
    return [
        f"{side.body} {side.name}" for pair in scene.contacts for side in sides_without_shape(scene, pair)
    ]
