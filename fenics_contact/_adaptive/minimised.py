"""A shape optimisation to an accuracy: it starts on a coarse mesh and refines it as it converges."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact._adaptive.equilibrium import AdaptiveLoop
from fenics_contact._adaptive.goal_errors import goal_error, value_of
from fenics_contact._adaptive.levels import AccurateResult, Level, Limits, require_share
from fenics_contact._adaptive.refined_designs import refined_design, refined_for_designs
from fenics_contact._adaptive.refined_scene import SceneRefinement
from fenics_contact._adaptive.underresolved_contact import refined_at_spots, underresolved_pairs
from fenics_contact._base.display import Table, tabled
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._optimize.bundle_trust import BundleTrust, minimize
from fenics_contact._optimize.constraints import Box, Constraints
from fenics_contact._optimize.nonlinear import is_nonlinear
from fenics_contact._optimize.problem import pose
from fenics_contact._optimize.result import Result, StepKind
from fenics_contact.design.memory import DesignPoint
from fenics_contact.design.problem import ShapeProblem
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.errors.kinds import user_code
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.results.state import State

#: Constraints on every mesh, or what makes them for the problem on a mesh.
ConstraintsOf: TypeAlias = "Constraints | Callable[[ShapeProblem], Constraints]"


@tabled
@dataclass(frozen=True, eq=False)
class AccurateDesign(AccurateResult[State]):
    """An optimised design with the error of its objective, and the meshes on the way.

    Attributes:
        state: The state of the design on the last mesh; its scene has the shape of the design.
        value: The objective of the design, with what its adjoint has for its error; ``levels`` have that of
            its state alone, too, which the table shows.
        error: Estimate of the error of ``value`` as the least objective, by mesh and optimiser, ≥ 0.
        problems: The problem on each mesh; all have the same variables. Files of designed surfaces in space,
            whose nodes must form a grid, are written with the first.
        optimisations: What `minimize` returned on each mesh.
    """

    problems: tuple[ShapeProblem, ...]
    optimisations: tuple[Result, ...]

    @property
    def x(self) -> np.ndarray:
        """The design variables, shape (size,), [length]."""
        return self.optimisations[-1].x

    def _tables(self) -> list[Table]:
        """Return a table with one line for each mesh, and how it ended."""
        head = ("cells", "unknowns", "start", "least", "error", "designs", "products", "seconds", "predicted")
        rows: list[tuple[str, ...]] = [head]
        for level, result in zip(self.levels, self.optimisations, strict=True):
            cells, unknowns, _, error, *cost = level.in_words
            both = (f"{result.history[0].value:.6g}", f"{level.state_value:.6g}")
            rows.append((cells, unknowns, *both, error, f"{result.evaluations}", *cost))
        return [Table(rows, 0, (self.reason,))]


@collectively("minimize_to", lambda problem, x0, relative_error, *_, **__: problem.comm)
def minimize_to(
    problem: ShapeProblem,
    x0: ArrayLike,
    relative_error: float,
    method: BundleTrust | None = None,
    *,
    bounds: Box | None = None,
    constraints: ConstraintsOf | None = None,
    scale: ArrayLike | None = None,
    restore: bool = False,
    limits: Limits | None = None,
    callback: Callable[[Level], None] | None = None,
) -> AccurateDesign:
    """Minimise the objective of a design to an accuracy: coarse meshes first, refined as it converges.

    On each mesh the bundle method runs until what it can still gain is small compared with the error of the
    objective by the mesh, which the adjoint estimates at the design where it begins: what is smaller cannot
    be distinguished. Then the cells that hold most of the error at the design found are halved, in its
    reference shape, and the method starts anew there: its planes belong to another function, so that the
    design and the length of the last step alone are kept. The error of a level is that of `solve_to` for the
    least objectives of the last three meshes, and what the method was allowed to leave.

    The variables mean the same on all meshes: new nodes of the design surfaces have the parameters and
    directions between those of the old ones. The strip of boundary around a design surface, which follows it,
    follows as the cells there allow; what is not flat there may differ a little from mesh to mesh. Bodies of
    quadrilaterals or hexahedra are halved everywhere where a cell of them is to be.

    Args:
        problem: Designs and objective on the coarse mesh.
        x0: Feasible start, shape (size,), [length].
        relative_error: Largest error of the least objective relative to it, between 0 and 1.
        method: Parameters of the bundle method; its tolerance is replaced by what the accuracy needs.
        bounds: As for `fenics_contact.minimize`.
        constraints: Linear ones; or a function that takes the problem on a mesh and returns any constraints,
            such as ``lambda p: NonlinearConstraint(p.volume, v, v)``, whose values depend on the mesh.
        scale: As for `fenics_contact.minimize`.
        restore: Whether x0 may violate nonlinear constraints. A design of the mesh before always may.
        limits: What may be spent; a level is the minimisation on one mesh.
        callback: Called on all ranks with every level once it is done.

    Returns:
        The design on the last mesh; where the accuracy was not reached, it says so, and a warning.

    Raises:
        InvalidInputError: If the accuracy is not between 0 and 1, the problem has several states a design, or
            materials without adjoint, nonlinear constraints do not follow the mesh, or as `minimize` does.
        InvalidDesignError: If a design cannot be computed on the next mesh.
        NotConvergedError: If the method stops on some mesh before its tolerance is met, unless its
            ``raise_on_failure`` is False: then the next mesh starts from the best design.

    References:
        R. E. Bank, T. Dupont, An optimal order process for solving finite element equations, Math. Comp. 36
        (1981) 35-51 (nested iteration). J. C. Ziems, S. Ulbrich, Adaptive multilevel inexact SQP methods for
        PDE-constrained optimization, SIAM J. Optim. 21 (2011) 1-40 (refine where the error of the mesh is
        larger than what is left to gain).

    Example:
        >>> found = minimize_to(problem, np.zeros(problem.size), 0.01, bounds=(-0.1, 0.1))  # doctest: +SKIP
        >>> print(found)  # the levels, and why the last is the last  # doctest: +SKIP
    """
    with together(problem.comm):
        require_share(relative_error)
        _check(problem, constraints)
    problem.contact.check_apart(problem.scene)
    settings = {"bounds": bounds, "scale": scale, "restore": restore}
    start = np.array(x0, dtype=float)
    way = _Descent(problem, start, relative_error, limits or Limits(), method or BundleTrust(), settings)
    way.constrained = partial(_constraints_on, constraints)
    found = way.follow(problem.contact.on(problem.scene, problem.contact.partitions), callback)
    return AccurateDesign(**vars(found), problems=tuple(way.problems), optimisations=tuple(way.optimisations))


def _check(problem: ShapeProblem, constraints: ConstraintsOf | None) -> None:
    """Reject what cannot be carried from mesh to mesh."""
    if not isinstance(problem, ShapeProblem):
        raise InvalidInputError(
            f"minimize_to needs a ShapeProblem, got {type(problem).__name__}: give the problem of one load "
            "case, or minimise this one on a mesh that is fine enough for it"
        )
    if problem.scene.is_nonlinear:
        raise InvalidInputError(
            "minimize_to needs linear materials, as errors of quantities of others have no adjoint: use "
            "minimize on a mesh that is fine enough"
        )
    given = () if constraints is None or callable(constraints) else constraints
    for one in given if isinstance(given, Sequence) else (given,):
        if is_nonlinear(one):
            raise InvalidInputError(
                "nonlinear constraints must follow the mesh, got one of the first mesh: give a function that "
                "makes them, such as lambda problem: NonlinearConstraint(problem.volume, volume, volume)"
            )


def _constraints_on(given: Any, shape: ShapeProblem) -> Any:
    """Return constraints on a mesh."""
    if not callable(given):
        return given
    with user_code("the constraints of minimize_to"):
        return given(shape)


class _Descent(AdaptiveLoop):
    """The levels so far of an optimisation, each from the design of the one before.

    `constrained`: returns the constraints on a mesh.
    """

    constrained: Callable[[ShapeProblem], Any]

    def __init__(
        self,
        given: ShapeProblem,
        start: np.ndarray,
        wanted: float,
        limits: Limits,
        method: BundleTrust,
        settings: dict[str, Any],
    ) -> None:
        super().__init__(given.objective, wanted, limits, given.comm)
        self.problems: list[ShapeProblem] = []
        self.optimisations: list[Result] = []
        self._given, self._x, self._method, self._settings = given, start, method, settings
        self._best: DesignPoint
        self._first_step, self._left, self._earlier = method.first_step, 0.0, 0

    def _solved(self, problem: ContactProblem) -> State:
        """Return the state of the best design on the next mesh. Collective."""
        shape = self._on(problem)
        self.problems.append(shape)
        if self.optimisations:
            state = shape.begin(self._x, self._best.state, self._refinements)
        else:
            state = shape.state_of(self._x)
        before = state.products
        tolerance = self._enough(state)
        estimated = state.products - before
        result = self._minimised(shape, tolerance)
        self.optimisations.append(result)
        self._x, self._settings["restore"] = result.x, True
        self._best = shape.at(result.x)
        self._earlier = shape.products + estimated - self._best.state.products
        return self._best.state

    def _on(self, contact: ContactProblem) -> ShapeProblem:
        """Return the designs on the next mesh. Collective."""
        if not self.problems:
            return self._given.on(contact, self._given.designs)
        last = self.problems[-1]
        designs = tuple(
            refined_design(
                each,
                last.scene.bodies[each.body].mesh,
                self._refinements.get(each.body),
                contact.scene.bodies[each.body].mesh,
            )
            for each in last.designs
        )
        return last.on(contact, designs)

    def _enough(self, state: State, share: float = 0.25, loosest: float = 0.1) -> float:
        """Return the relative tolerance of the method: what is smaller is not worth a step on this mesh.

        `share`: of the estimated error, or of the error asked for where that is larger; `loosest`: largest
        part of the objective, also where a spot is too small for its cells.
        """
        if underresolved_pairs(state):
            value, error = value_of(state, self.quantity), np.inf
        else:
            estimate = goal_error(state, self.quantity)
            value, error = estimate.value, abs(estimate.known)
        size = abs(value)
        enough = min(share * max(error, self.wanted * size), loosest * size)
        return enough / (self._method.size_of(value) + size) if size else self._method.tolerance

    def _minimised(self, shape: ShapeProblem, tolerance: float) -> Result:
        """Run the method on a mesh. Collective."""
        reach = self._method.reach or 2.0
        method = replace(self._method, tolerance=tolerance, first_step=self._first_step, reach=reach)
        result = minimize(shape, self._x, method, constraints=self.constrained(shape), **self._settings)
        steps = [record.step_length for record in result.history if record.kind is StepKind.SERIOUS]
        if steps:
            length = pose(shape, result.x, self._settings["bounds"], scale=self._settings["scale"]).length
            self._first_step = min(self._method.first_step, steps[-1] / length)
        self._left = tolerance * (method.size_of(result.history[0].value) + abs(result.value))
        return result

    @property
    def _products(self) -> int:
        """Products with F of states, adjoints and estimates of the last mesh."""
        return self._earlier + self._state.products

    def _error(self, missing: float, value: float, *bounds: float) -> float:
        """Return the error of the least objective: of its mesh, and what the method was allowed to leave."""
        return super()._error(missing, value, *bounds) + self._left

    def _at_spots(self) -> SceneRefinement:
        """Return the reference shape on the next meshes where spots are smaller than their cells."""
        scene = self.problems[-1].scene
        simplices = all(CELL_TYPES[body.mesh.cell_type].is_simplex for body in scene.bodies.values())
        others = {} if simplices else {"most": 1}  # all cells of a body are halved
        return refined_at_spots(self._state, self._doubted, scene=scene, refine=refined_for_designs, **others)

    def _at_points(self, found: SceneRefinement) -> SceneRefinement:
        """Return the next meshes as they are: cells of designs keep their sizes relative to each other."""
        return found

    def _halved(self, marked: Mapping[str, np.ndarray]) -> SceneRefinement:
        """Return the reference shape on the next meshes, with some cells halved."""
        return refined_for_designs(self.problems[-1].scene, marked)
