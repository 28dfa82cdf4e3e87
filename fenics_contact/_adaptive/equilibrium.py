"""A quantity of an equilibrium to the accuracy that is asked for."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np

from fenics_contact._adaptive.crossings import left_at_crossings, refined_at_crossings
from fenics_contact._adaptive.goal_errors import goal_error, value_of
from fenics_contact._adaptive.levels import (
    AccuracyLoop,
    AccurateResult,
    Estimate,
    Level,
    Limits,
    error_in_words,
    require_share,
)
from fenics_contact._adaptive.locking import locking_in_words
from fenics_contact._adaptive.quantities import quantity as named
from fenics_contact._adaptive.refined_scene import SceneRefinement
from fenics_contact._adaptive.sticking_ends import depends_on_slip, refined_at_sticking_ends
from fenics_contact._adaptive.underresolved_contact import refined_at_spots, underresolved_pairs
from fenics_contact._base.libraries import MPI
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.true_shapes import sides_without_shape
from fenics_contact.design.objective import Objective, can_be_infinite
from fenics_contact.errors import collectively, together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.mesh.refinement import Refinement
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.resolution import BetweenNodes
from fenics_contact.results.state import State

_LOG = logging.getLogger(__name__)


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
) -> AccurateResult[State]:
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
    extrapolated, was within it in 111 of 114. Where materials are nonlinear or bodies slide far, the value on
    graded meshes of quadratic cells was within it in 70 of 73; see `goal_error` for what is not estimated.

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
    return way.follow(ContactProblem(scene, comm, solver=solver, tolerance=tolerance), callback)


class AdaptiveLoop(AccuracyLoop[ContactProblem, State]):
    """The levels so far of a quantity of an equilibrium."""

    def __init__(self, quantity: Objective, wanted: float, limits: Limits, comm: MPI.Comm) -> None:
        super().__init__(wanted, limits, comm)
        self.quantity = quantity
        self._near_crossings: list[float] = []
        self._beyond_crossings = 0.0
        self._refinements: Mapping[str, Refinement] = {}

    def _run(self, first: ContactProblem, callback: Callable[[Level], None] | None) -> None:
        """Add all levels from a first problem on; the last state alone warns. Collective."""
        warnings = first.defer_warnings()
        super()._run(first, callback)
        warnings.tell()
        faceted = faceted_surfaces(first.scene) if len(self.levels) > 1 else []
        if faceted and self.comm.rank == 0:
            safe_log(
                _LOG.warning,
                "%s is curved, but its mesh knows no true shape: its facets were refined as facets, and the "
                "quantity is that of a body with facets; give the mesh shapes, or read it from CAD",
                " and ".join(faceted),
            )

    @property
    def _scene(self) -> Scene:
        """The scene of the last state."""
        return self._state.scene

    @property
    def _missed(self) -> bool:
        """Whether surfaces touch between nodes, so that a quantity may be zero that is not."""
        return any(isinstance(each, BetweenNodes) for each in self._state.peak_uncertainties)

    def _solved(self, problem: ContactProblem) -> State:
        """Return the state on the next mesh. Collective."""
        if not self.levels:
            return problem.solve(adjoint=True)
        return problem.solve(start=self._state, refinements=self._refinements, adjoint=True)

    def _next(
        self, problem: ContactProblem, found: SceneRefinement, partitions: Mapping[str, np.ndarray]
    ) -> ContactProblem:
        """Return the problem on refined meshes."""
        self._refinements = found.refinements
        return problem.on(found.scene, partitions)

    @property
    def _products(self) -> int:
        """Products with F of the last mesh."""
        return self._state.solution.products

    @property
    def _uncorrected(self) -> bool:
        """Whether the spot of a contact is smaller than its cells."""
        return bool(self._doubted)

    def _estimate(self) -> Estimate:
        """Return the quantity of the last state and what is known of its error. Collective."""
        return goal_error(self._state, self.quantity)

    def _estimated(self) -> tuple[float, float, float]:
        """Return the quantity of the state, corrected, and its error. Collective.

        Where a spot is too small for its cells nothing is corrected, and the error is unknown.
        """
        self._doubted = underresolved_pairs(self._state)
        self._near_crossings.append(left_at_crossings(self._scene))
        unmet = self._missed and not self._state.contact.normal_force.any()  # quantities may not exist
        value = value_of(self._state, self.quantity) if self._doubted and not unmet else 0.0
        if value != 0.0 or unmet:  # what a single point presses follows from the load, its adjoint is none
            self._sums.append(float("nan"))
            self._corrected.append(float("nan"))
            return value, value, float("inf")
        return super()._estimated()

    def _beyond(self, changes: np.ndarray) -> float:
        """Return what this mesh misses where stiff and soft materials cross, by the theory of such places.

        What is missed there falls by a known ratio from mesh to mesh, see `left_at_crossings`, and not faster
        even if the last meshes look so: the changes are those of a geometric series whose ratio may be 0.9.
        Once the cells there are not halved any more, what they miss stays.
        """
        sizes = self._near_crossings[-3:]
        falls = zip(changes.tolist(), pairwise(sizes), strict=False)
        rests = [change * sizes[-1] / (before - after) for change, (before, after) in falls if before > after]
        self._beyond_crossings = max(rests, default=self._beyond_crossings)
        return self._beyond_crossings

    def _zero(self, last: Level) -> str:
        """Return why there is no error relative to the quantity, in words; empty if there is."""
        if last.state_value != 0.0 or self._missed:
            return ""
        return (
            "the quantity is zero on this mesh, and no error is small relative to that: ask for another "
            "one, or start on a finer mesh if surfaces touch on that"
        )

    def _remarks(self) -> list[str]:
        """Return what keeps errors large, in words."""
        return [each for each in (self._crossing_in_words(), locking_in_words(self._scene)) if each]

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

    def _finer(self, aim: float) -> SceneRefinement:
        """Return the next meshes: where spots are smaller than their cells those there alone are halved."""
        return self._at_spots() if self._doubted else self._at_points(super()._finer(aim))

    def _at_spots(self) -> SceneRefinement:
        """Return the next meshes where spots are smaller than their cells."""
        return refined_at_spots(self._state, self._doubted)

    def _at_points(self, found: SceneRefinement) -> SceneRefinement:
        """Return the next meshes with smaller cells where materials cross and ends of contacts may slip."""
        if depends_on_slip(self.quantity):
            found = refined_at_sticking_ends(self._state, found)
        return refined_at_crossings(found)

    def _hopeless(self) -> str:
        """Say so if the value grows without limit, as stresses do at corners."""
        if not can_be_infinite(self.quantity) or not self._without_limit():
            return ""
        faceted = faceted_surfaces(self._scene)
        corners, remedy = "as stress does at sharp corners", "round the corner"
        if faceted:
            corners += f", which {faceted[0]} has between its facets, as its mesh knows no true shape"
            remedy = "give the mesh shapes"
        return (
            f"{error_in_words(self.levels[-1])}, and the value grows without limit as cells get smaller, by "
            f"more from mesh to mesh, {corners}: ask for another quantity or {remedy}"
        )


def faceted_surfaces(scene: Scene) -> list[str]:
    """Return in words the curved surfaces of contacts that are refined as facets: their shape is unknown."""
    return [
        f"{side.body} {side.name}" for pair in scene.contacts for side in sides_without_shape(scene, pair)
    ]
