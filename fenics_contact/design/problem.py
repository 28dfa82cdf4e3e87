"""A design problem: value and subgradient of an objective as functions of the design variables."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._base.fingerprint import described
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._base.threads import one_thread
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._scene.scene import Scene
from fenics_contact.design.adjoint import WeakChoice, linearise_face, require_from_rest
from fenics_contact.design.adjoint_starts import adjoint_tolerance
from fenics_contact.design.base import SingleProblem, comm_of, with_fewest_weak_points, with_objective
from fenics_contact.design.design import SurfaceDesign
from fenics_contact.design.memory import AdaptiveTolerance, DesignMemory, DesignPoint, Stored, tightest_of
from fenics_contact.design.motion import DesignGeometry
from fenics_contact.design.objective import (
    Objective,
    Partials,
    finite,
    finite_partials,
    finite_value,
    guarded_user_call,
)
from fenics_contact.design.sensitivity import adjoint_of, by_nodes
from fenics_contact.errors import (
    ConvergenceError,
    InfeasibleError,
    InvalidDesignError,
    InvalidInputError,
    collectively,
)
from fenics_contact.errors.kinds import safe_log
from fenics_contact.materials.hyperelastic import has_mean_dilatation
from fenics_contact.materials.plastic import has_history
from fenics_contact.mesh.refinement import Refinement
from fenics_contact.results.adjoint_starts import STORED, NoAdjointStart, restored
from fenics_contact.results.deformed_state import AnyState

logger = logging.getLogger(__name__)


def design_state(
    contact: ContactProblem,
    scene: Scene,
    start: AnyState | None,
    tolerance: float,
    *,
    before: AnyState | None = None,
    refinements: Mapping[str, Refinement] | None = None,
) -> AnyState:
    """Compute the equilibrium of a design, whose surfaces may overlap before they are loaded. Collective.

    `before`: state of the same design after the last load step, or None; `refinements`: body name ->
    refinement of its mesh in ``start`` that led to that of the scene, None where the meshes are the same.
    """
    if scene.is_nonlinear and before is not None:
        raise InvalidInputError(
            "designs of bodies that deform much have one load step, got a state before it: leave out LoadPath"
        )
    solve = partial(contact.solve, scene, before=before, tolerance=tolerance, design=True)
    try:
        return solve(start=start, refinements=refinements)
    except InfeasibleError as error:
        raise InvalidDesignError(f"the design has no equilibrium: {error}") from error
    except ConvergenceError as error:
        if start is None:
            raise
        safe_log(logger.warning, "a warm start failed, a cold one follows: %s", error)
    try:
        return solve(start=None)
    except (ConvergenceError, InfeasibleError) as error:
        raise InvalidDesignError(f"no equilibrium of the design was found: {error}") from error


#: How far beside the first design an objective without a gradient is evaluated, by the size of the scene.
BESIDE = 1e-6


def checked_contact(contact: ContactProblem) -> ContactProblem:
    """Return the contact problem of a shape problem."""
    if not isinstance(contact, ContactProblem):
        raise InvalidInputError(
            f"ShapeProblem needs a ContactProblem(scene, comm), got {type(contact).__name__}: make one"
        )
    _check_differentiable(contact.scene)
    return contact


def _check_differentiable(scene: Scene) -> None:
    """Reject what of torsion and of large deformations has no derivative by the shape."""
    materials = [each for body in scene.bodies.values() for each in body.materials]
    reasons = {
        "bodies without torsion": scene.torsion,
        "bodies without InitialStress": any(load.stresses for load in scene.loads),
        "plane bodies without a thickness": scene.has_thickness,
    }
    if scene.is_nonlinear:
        reasons |= {
            "materials without history": any(map(has_history, materials)),
            "materials without mean_dilatation": any(map(has_mean_dilatation, materials)),
            "pairs of nonlinear bodies without wear": scene.wears,
            "pressures that do not follow their surfaces": bool(scene.following_pressures),
            "nonlinear bodies without ThermalStrain": any(load.temperatures for load in scene.loads),
        }
    for needed, missing in reasons.items():
        if missing:
            raise InvalidInputError(
                f"designs need {needed}, this scene has others: leave them out, or take a SceneResponse"
            )


def require_influence(
    objective: Objective, scene: Scene, point: DesignPoint, evaluate: Callable[[np.ndarray], DesignPoint]
) -> None:
    """Reject an objective that no design variable changes, here or at a design nearby. Collective.

    Where the gradient is rounding the objective may be stationary, as a norm of the pressure is where that is
    even: then it has a gradient nearby.
    """
    size = float(np.ptp(scene.points))
    if _has_influence(point, size):
        return
    number = len(point.gradient)
    way = np.random.default_rng(0).standard_normal(number)
    try:
        if _has_influence(evaluate(point.alpha + BESIDE * size * way), size):
            safe_log(logger.info, "the objective is stationary at the first design, to rounding")
            return
    except InvalidDesignError:
        return  # not known
    raise InvalidInputError(
        f"an objective must change with the design, but {objective!r} is {point.value:.6g} and none of "
        f"{number} variables changes it: choose one that moving surfaces affect, or start elsewhere"
    )


def _has_influence(point: DesignPoint, size: float) -> bool:
    """Return whether a variable changes the objective over the size of the scene."""
    change = float(np.abs(point.gradient).max(initial=0.0) * size)
    return change > LAST_PLACES * abs(point.value)


def check_case(first: Scene, scene: Scene) -> None:
    """Check that a scene is a load case of the same designs."""
    if set(scene.bodies) != set(first.bodies):
        raise InvalidInputError(
            f"load cases must have the same bodies, got {sorted(scene.bodies)} beside {sorted(first.bodies)}"
        )
    for name, body in scene.bodies.items():
        mate = first.bodies[name]
        if body.mesh is not mate.mesh or body.materials != mate.materials:
            raise InvalidInputError(
                f"load cases must share meshes and materials, {name!r} has others: give other loads alone"
            )
        if not scene.holds_as(first, name):
            raise InvalidInputError(
                f"load cases must hold the same components of {name!r}: give values, or a RigidSurface"
            )


@displayed
class ShapeProblem(SingleProblem):
    """J(α) with a subgradient, for one or more moving surfaces of a scene.

    Call it with α to get (J, subgradient): one state, one adjoint, whatever the number of variables. Where no
    contact point is weakly active it is the gradient, where one is, a Clarke subgradient. Where several are
    it may not be a subgradient (`WeakChoice`): such designs `may_be_invalid`, and
    `gradient_near` returns the gradient of a design nearby. Topology, partition and compiled forms are
    reused; each state starts from the one before.

    Attributes:
        contact: The problem that computes the states, to the tolerance given (`tolerance`).
        scene: The scene in its reference shape.
        geometry: How it moves with a design.

    Example:
        >>> designs = SurfaceDesign("link1", links.first.crown, net=(7, 4))  # doctest: +SKIP
        >>> problem = ShapeProblem(ContactProblem(scene, comm), designs, TotalPotential())  # doctest: +SKIP
        >>> value, subgradient = problem(np.zeros(problem.size))  # doctest: +SKIP
        >>> result = minimize(problem, np.zeros(problem.size), bounds=(-1.0, 1.0))  # doctest: +SKIP
    """

    def __init__(
        self,
        contact: ContactProblem,
        designs: tuple[SurfaceDesign, ...] | SurfaceDesign,
        objective: Objective,
        *,
        choice: WeakChoice = WeakChoice.RELEASED,
        tolerance: float | AdaptiveTolerance | None = None,
    ) -> None:
        """Decompose the scene and prepare the mesh motion. Collective.

        Args:
            contact: The problem that computes the states; its scene is the reference shape.
            choice: Branch for weakly active points.
            tolerance: Relative residual of all states, or `AdaptiveTolerance()`, with which an optimiser
                requests the accuracy that it needs; None for that of ``contact``, or of its solver, as a
                balanced state leaves the statuses uncertain on which derivatives depend. The adjoint has ten
                times this as its relative residual, 1e-4 at most, and a tenth of it where points are between
                two statuses; the gradient is off by less than twice that: compare it with difference
                quotients of states with 1e-8 and less.
        """
        self.contact, self.objective, self.choice = checked_contact(contact), objective, choice
        self.scene, self.tolerance = contact.scene, tolerance
        self._tightest = tightest_of(contact, tolerance)
        self._timer = contact.timer
        self._memory: DesignMemory = DesignMemory(self._restored)
        self._adjoint_start = NoAdjointStart()
        self._neighbour: ShapeProblem | None = None
        self._apart = False
        with self._timer.phase("mesh motion"):
            given = (designs,) if isinstance(designs, SurfaceDesign) else designs
            self.geometry = DesignGeometry(self.scene, contact.decomposition, given)

    def _facts(self) -> dict[str, Any]:
        work = f"{self.evaluations} designs, {self.products} products with F"
        return {"variables": self.size, "designs": self.designs, "objective": self.objective,
                "choice": self.choice, "work": work, "contact": self.contact}  # fmt: skip

    @property
    def designs(self) -> tuple[SurfaceDesign, ...]:
        """The moving surfaces; α is the concatenation of their variables."""
        return self.geometry.designs

    @property
    def comm(self) -> MPI.Comm:
        """Communicator over which the subdomains are spread."""
        return self.contact.comm

    @property
    def _parts(self) -> Sequence[ShapeProblem]:
        return (self,)

    @property
    def products(self) -> int:
        """F-products of states and adjoints so far."""
        return self._memory.products

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time of this rank by phase, over all evaluations."""
        return self._timer.seconds

    @property
    def inexact(self) -> bool:
        """Whether an optimiser may ask for less accuracy, see `within`."""
        return isinstance(self.tolerance, AdaptiveTolerance)

    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""
        parts: dict[str, Any] = {
            "scene": self.scene,
            "partitions": self.contact.partitions,
            "designs": self.designs,
            "objective": self.objective,
            "solver": self.contact.solver,
            "tolerance": self.tolerance if self.inexact else self._tightest,
            "choice": self.choice,
        }
        return {key: text for name, part in parts.items() for key, text in described(part, name).items()}

    def memory(self) -> dict[str, np.ndarray]:
        """Return what the next state depends on, and the stored designs. Collective.

        Raises:
            InvalidInputError: If bodies deform much.
        """
        if self.scene.is_nonlinear:
            raise InvalidInputError(
                "checkpoints of designs need linear materials, got others: leave the checkpoint out"
            )
        return self._memory.stored() | self.starts()

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Continue from what `memory` returned, also on another number of ranks. Collective."""
        self._memory.recall({name: memory[name] for name in memory if name != STORED})
        self.start_from(memory)

    def starts(self) -> dict[str, np.ndarray]:
        """Return what the next adjoint starts from, for a checkpoint. Collective."""
        state = self._memory.state
        return {} if state is None else self._adjoint_start.at(state.torn).stored()

    def start_from(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Start the next adjoint from what `starts` returned. Collective."""
        if (state := self._memory.state) is not None:
            self._adjoint_start = restored(arrays, state.torn)

    def points_of(self, alpha: np.ndarray) -> dict[str, np.ndarray]:
        """Return the coordinates of the designed bodies, see `DesignGeometry.points_of`. Collective."""
        return self.geometry.points_of(alpha)

    def scene_of(self, alpha: np.ndarray) -> Scene:
        """Return the scene in the shape of a design; raises as `evaluate` does. Collective."""
        return self.geometry.scene_of(self.scene, alpha)

    @collectively("ShapeProblem.state_of", comm_of)
    def state_of(self, alpha: np.ndarray, after: AnyState | None = None) -> AnyState:
        """Return the equilibrium of a design, started from the one before. Collective.

        Args:
            alpha: Design variables, shape (size,), [length].
            after: State of the same design after the last load step, from which slip is measured, or None.

        Raises:
            InvalidDesignError: If the design inverts a cell or has no equilibrium.
        """
        return self._solved(alpha, self._tightest, after=after)

    @collectively("ShapeProblem.begin", comm_of)
    def begin(self, alpha: np.ndarray, coarse: AnyState, refinements: Mapping[str, Refinement]) -> AnyState:
        """Return the equilibrium of a design, started from that of the same design on coarser meshes.

        The next designs start from it. Collective.

        Args:
            alpha: Design variables, shape (size,), [length].
            coarse: Equilibrium of the design on meshes that were refined into those of this problem.
            refinements: Body name -> refinement of its mesh; bodies that are not named have kept theirs.

        Raises:
            InvalidDesignError: If the design inverts a cell or has no equilibrium.
        """
        scene = self.scene_of(alpha)
        state = design_state(self.contact, scene, coarse, self._tightest, refinements=refinements)
        self._record_state(alpha, state)
        return state

    @collectively("ShapeProblem.on", lambda self, contact, *_: contact.comm)
    def on(self, contact: ContactProblem, designs: tuple[SurfaceDesign, ...]) -> ShapeProblem:
        """Return the problem of the same variables and objective on other meshes. Collective.

        Args:
            contact: The problem that computes the states, on meshes in another reference shape.
            designs: The moving surfaces on these meshes.
        """
        other = ShapeProblem(contact, designs, self.objective, choice=self.choice, tolerance=self.tolerance)
        other._apart = True  # the shape given first was, and these bodies may be in that of a design
        return other

    @collectively("ShapeProblem.value_of", comm_of)
    def value_of(self, alpha: np.ndarray) -> float:
        """Return J(α) alone, without adjoint. Collective."""
        state = self.state_of(alpha)
        with guarded_user_call(self.comm):
            return finite_value(self.objective.value(state, self.geometry.forms))

    @collectively("ShapeProblem.evaluate", comm_of)
    def evaluate(self, alpha: np.ndarray) -> DesignPoint:
        """Solve the state and its adjoint and return value and subgradient. Collective.

        Raises:
            InvalidDesignError: If the design inverts a cell or has no equilibrium.
            InvalidInputError: If bodies of the reference shape overlap, or no variable changes the objective
                at the first design.
        """
        known = self._memory.of_design(alpha) if self.inexact else None
        state = self._solved(alpha, self._tightest, known) if self.inexact else self.state_of(alpha)
        return self._recorded(self._point_at(alpha, state, self._tightest, known))

    @collectively("ShapeProblem.differentiate", comm_of)
    def differentiate(self, state: AnyState, partials: Partials | None = None) -> DesignPoint:
        """Return value and subgradient at a known state of the reference shape, for one adjoint. Collective.

        Args:
            state: Equilibrium of the scene, with the subdomains of this problem (`ContactProblem.following`).
            partials: Derivatives by the state of what is differentiated, by default of the objective.

        Raises:
            InvalidInputError: If only the state is given and it follows another load step.
        """
        if partials is None:
            require_from_rest(state)
            partials = self.partials_of(self.objective, state)
        return self.differentiated(state, partials)[0]

    def differentiated(self, state: AnyState, partials: Partials) -> tuple[DesignPoint, Partials]:
        """Return the same, and the derivatives by the state with those of all it depends on. Collective."""
        return self._adjoint_at(np.zeros(self.size), state, self._tightest, self._adjoint_start, partials)

    def partials_of(self, objective: Objective, state: AnyState) -> Partials:
        """Return an objective and its partial derivatives at a state, checked. Collective."""
        with self._timer.phase("objective"), guarded_user_call(self.comm):
            return finite_partials(objective.partials(state, self.geometry.forms))

    def remarks(self, alpha: np.ndarray) -> tuple[str, ...]:
        """Return what to know of a design beside its value: overlaps before it is loaded. Collective."""
        known = self.known(alpha)
        return self.contact.overlaps(self.state_of(alpha) if known is None else known.state)

    @collectively("ShapeProblem.within", comm_of)
    def within(self, alpha: np.ndarray, value: float, subgradient: float) -> tuple[float, np.ndarray, float]:
        """Return J(α), a subgradient and the estimated error of J, to the requested accuracy. Collective.

        Args:
            alpha: Design variables, shape (size,), [length].
            value: Largest error of J.
            subgradient: Largest relative error of the subgradient, which the tolerance of the state follows.

        Raises:
            InvalidDesignError: If the design inverts a cell or has no equilibrium.
        """
        policy = self.tolerance
        if not isinstance(policy, AdaptiveTolerance):
            point = self.evaluate(alpha)
            return point.value, point.gradient, 0.0
        known = self._memory.of_design(alpha)
        tolerance = policy.first(value, subgradient, self._memory.error_by_tolerance)
        point = self._point_at(alpha, self._solved(alpha, tolerance, known), tolerance, known)
        while point.error > value and tolerance > policy.tightest:
            tolerance = policy.next(tolerance, point.error, value)
            point = self._point_at(alpha, self._solved(alpha, tolerance, point), tolerance, point)
        self._recorded(point)
        return point.value, point.gradient, point.error

    def _recorded(self, point: DesignPoint) -> DesignPoint:
        if not self.evaluations and not point.weak.count:  # at a kink a branch may be flat
            require_influence(self.objective, self.scene, point, self._unrecorded(self._tightest))
        self._memory.record(point)
        return point

    @collectively("ShapeProblem.gradient_near", comm_of)
    def gradient_near(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the gradient of the design near α with the fewest weak points, see the base. Collective."""
        known = self._memory.of_design(alpha)
        evaluate = self._unrecorded(known.tolerance if known else self._tightest)
        return with_fewest_weak_points(alpha, end, evaluate).gradient

    def _unrecorded(self, tolerance: float) -> Callable[[np.ndarray], DesignPoint]:
        """Return what evaluates designs that are not recorded. Collective when called."""
        return lambda near: self._point_at(near, self._solved(near, tolerance), tolerance, None)

    def _solved(
        self,
        alpha: np.ndarray,
        tolerance: float,
        known: DesignPoint | None = None,
        after: AnyState | None = None,
    ) -> AnyState:
        """Compute an equilibrium, from a less accurate one of the same design if known. Collective."""
        previous = self._memory.state if known is None else known.state
        if previous is None and self._neighbour is not None:  # the first state of a load case
            previous = self._neighbour._memory.state
        if not self._apart:  # the shape given, whichever design is the first
            self.contact.check_apart(self.scene)
            self._apart = True
        with self._timer.phase("mesh motion"):
            scene = self.scene_of(alpha) if known is None else known.state.scene
        state = design_state(self.contact, scene, previous, tolerance, before=after)
        self._record_state(alpha, state)
        return state

    def _record_state(self, alpha: np.ndarray, state: AnyState) -> None:
        """Keep what the next state and the next adjoint start from. Collective."""
        self._memory.record_state(alpha, state)
        self._memory.products += state.products
        self._adjoint_start = self._adjoint_start.at(state.torn)

    def _point_at(
        self, alpha: np.ndarray, state: AnyState, tolerance: float, known: DesignPoint | None
    ) -> DesignPoint:
        """Return objective, subgradient and their errors at a state. Collective."""
        start, partials = self._adjoint_start, self.partials_of(self.objective, state)
        if known is not None:
            start = known.state.adjoint_start(known.adjoint_multiplier)
        return self._adjoint_at(alpha, state, tolerance, start, partials)[0]

    def _adjoint_at(
        self, alpha: np.ndarray, state: AnyState, tolerance: float, start: NoAdjointStart, partials: Partials
    ) -> tuple[DesignPoint, Partials]:
        """Return the point of an objective with these derivatives, and all its derivatives. Collective."""
        before = state.products
        with one_thread(self.comm), self._timer.phase("adjoint"):
            linearised = linearise_face(state, self.choice)
            accuracy = adjoint_tolerance(tolerance, linearised.weak)
            adjoint, error, partials = adjoint_of(
                state, partials, linearised, accuracy, start.at(state.torn).direction()
            )
            self._adjoint_start = state.adjoint_start(adjoint.multiplier)
        with one_thread(self.comm), self._timer.phase("gradient"):
            by_points = by_nodes(state, adjoint, partials, linearised, self.geometry.forms)
            gradient = self.geometry.pull_back(by_points)
        spent = max(state.products - before, adjoint.iterations)
        self._memory.products += spent
        value = partials.value + (error.correction if self.inexact else 0.0)
        # Ranks must take the same decisions, whatever the rounding in sums over ranks.
        value, gradient, error = self.comm.bcast((value, gradient, error))
        finite("gradient", gradient)
        safe_log(logger.info, "J = %.9g ± %.1e, %d products", value, error.size, before + spent)
        point = DesignPoint(
            alpha=np.array(alpha, dtype=float), value=value, gradient=gradient, state=state,
            weak=linearised.weak, adjoint_iterations=spent, tolerance=tolerance,
            correction=error.correction, error=error.size, adjoint_multiplier=adjoint.multiplier,
        )  # fmt: skip
        return point, partials

    @collectively("ShapeProblem.case", comm_of)
    def case(self, scene: Scene, objective: Objective | None = None) -> ShapeProblem:
        """Return the problem of another load case of the same designs, see `LoadCases`. Collective.

        The cases share mesh motion, matrices and factors; each starts from its own last state.

        Args:
            scene: The scene with other loads, values of supports, friction or obstacles.
            objective: Objective of the case; by default that of this problem.

        Raises:
            InvalidInputError: If it has other bodies, its supports hold other components, or its pairs or
                loads have no derivative by the designs.
        """
        check_case(self.scene, scene)
        other = with_objective(self, objective or self.objective)
        other.scene, other._neighbour, other._apart = scene, self, False
        other._memory = DesignMemory(other._restored)
        return other

    def shares_with(self, other: ShapeProblem) -> bool:
        """Return whether another problem is a `case` of the same designs."""
        return self.geometry is other.geometry

    @collectively("ShapeProblem.volume", comm_of)
    def volume(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the volume of the designed bodies, in the plane the area, and its gradient. Collective."""
        return self.geometry.volume(self.scene_of(alpha))

    def _restored(self, alpha: np.ndarray, stored: Stored) -> AnyState:
        state = self.contact.restore(stored, self.scene_of(alpha))
        self._memory.products += state.products
        return state
