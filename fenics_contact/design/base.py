"""What all design problems have, and other objectives as functions of the same designs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, Generic, TypeVar

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._base.fingerprint import described
from fenics_contact._base.libraries import MPI
from fenics_contact._scene.scene import Scene
from fenics_contact.design.design import SurfaceDesign
from fenics_contact.design.memory import DesignPoint, DesignRecord, JointPoint
from fenics_contact.design.objective import Objective
from fenics_contact.errors import InvalidDesignError, collectively
from fenics_contact.results.adjoint_starts import NoAdjointStart
from fenics_contact.results.deformed_state import AnyState

Point = TypeVar("Point", DesignPoint, JointPoint)
Single = TypeVar("Single", bound="SingleProblem")


def comm_of(problem: DesignProblem[Any], *_: Any, **__: Any) -> MPI.Comm:
    """Return the communicator of a call of a method."""
    return problem.comm


class DesignProblem(ABC, Generic[Point]):
    """J(α) with a subgradient over the designs of a scene, as `minimize` and checkpoints take it.

    It keeps the first, the best and the last design with their states. A problem of several states or meshes
    consists of problems of one each, its parts.
    """

    _memory: DesignRecord[Point]

    @property
    @abstractmethod
    def _parts(self) -> Sequence[SingleProblem]:
        """The problems that it consists of; all have the designs of the first."""

    @abstractmethod
    def evaluate(self, alpha: np.ndarray) -> Point:
        """Solve the state and its adjoint, or all of them, and return value and subgradient. Collective.

        Raises:
            InvalidDesignError: If the design inverts a cell or has no equilibrium.
        """

    @abstractmethod
    def scene_of(self, alpha: np.ndarray) -> Scene:
        """Return the scene in the shape of a design; raises as `evaluate` does. Collective."""

    @abstractmethod
    def remarks(self, alpha: np.ndarray) -> tuple[str, ...]:
        """Return what to know of a design beside its value: overlaps before it is loaded. Collective."""

    @abstractmethod
    def gradient_near(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the gradient of the design between two, near α, with the fewest weak points. Collective.

        Args:
            alpha: Design variables, shape (size,), [length].
            end: A design nearby in a generic direction, shape (size,), [length].

        Raises:
            InvalidDesignError: If no design between them has an equilibrium.
        """

    @abstractmethod
    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""

    @property
    def designs(self) -> tuple[SurfaceDesign, ...]:
        """The moving surfaces, of several meshes on the first; α is the concatenation of their variables."""
        return self._parts[0].designs

    @property
    def size(self) -> int:
        """Number of design variables."""
        return sum(design.size for design in self.designs)

    @property
    def comm(self) -> MPI.Comm:
        """Communicator over which the subdomains are spread."""
        return self._parts[0].comm

    @property
    def inexact(self) -> bool:
        """Whether an optimiser may ask for less accuracy, see `ShapeProblem.within`."""
        return False

    @property
    def evaluations(self) -> int:
        """Number of designs evaluated, without those for `gradient_near`."""
        return self._memory.evaluations

    @property
    def products(self) -> int:
        """F-products of all states and adjoints so far."""
        return sum(part.products for part in self._parts)

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time of this rank by phase, over all evaluations."""
        return self._parts[0].seconds

    @property
    def first(self) -> Point | None:
        """The design evaluated first. Collective after a run was resumed, as it is rebuilt then."""
        return self._memory.point("first")

    @property
    def best(self) -> Point | None:
        """The design with the smallest objective so far, feasible or not. Collective after a run resumed."""
        return self._memory.point("best")

    @property
    def last(self) -> Point | None:
        """The design evaluated last. Collective after a run was resumed."""
        return self._memory.point("last")

    def __call__(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return J(α) and a subgradient; raises as `evaluate` does. Collective."""
        point = self.evaluate(alpha)
        return point.value, point.gradient

    def known(self, alpha: np.ndarray) -> Point | None:
        """Return the first, best or last design if it is exactly this one. Collective."""
        return self._memory.of_design(alpha)

    def at(self, alpha: np.ndarray) -> Point:
        """Return a design as evaluated, again unless it is `known`, such as the x of a result. Collective."""
        return self.known(alpha) or self.evaluate(alpha)

    @collectively("DesignProblem.may_be_invalid", comm_of)
    def may_be_invalid(self, alpha: np.ndarray) -> bool:
        """Return whether the last result, at α, may not be a subgradient. Collective."""
        return (known := self.known(alpha)) is not None and known.weak.may_be_invalid

    def volume(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the volume of the designed bodies, in the plane the area, and its gradient. Collective."""
        return self._parts[0].volume(alpha)

    def memory(self) -> dict[str, np.ndarray]:
        """Return what the next states depend on, and the stored designs. Collective."""
        own = {f"own.{name}": values for name, values in self._memory.stored().items()}
        return own | {
            f"{number}/{name}": values
            for number, part in enumerate(self._parts)
            for name, values in part.memory().items()
        }

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Continue from what `memory` returned, also on another number of ranks. Collective."""
        own = {name.removeprefix("own."): memory[name] for name in memory if name.startswith("own.")}
        self._memory.recall(own)
        for number, part in enumerate(self._parts):
            head = f"{number}/"
            names = (name for name in memory if name.startswith(head))
            part.recall({name.removeprefix(head): memory[name] for name in names})


class SingleProblem(DesignProblem[DesignPoint]):
    """A design problem with one state a design."""

    objective: Objective
    #: What the next adjoint starts from.
    _adjoint_start: NoAdjointStart

    @abstractmethod
    def state_of(self, alpha: np.ndarray) -> AnyState:
        """Return the equilibrium of a design; raises as `evaluate` does. Collective."""

    @abstractmethod
    def differentiate(self, state: AnyState) -> DesignPoint:
        """Return value and subgradient at a known state, for one adjoint. Collective."""

    def starts(self) -> dict[str, np.ndarray]:
        """Return what the next adjoint starts from, for a checkpoint. Collective."""
        return {}

    def start_from(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Start the next adjoint from what `starts` returned. Collective."""

    def function(self, objective: Objective, name: str | None = None) -> DesignFunction:
        """Return another objective as a function α -> (value, subgradient), for a constraint.

        At a design evaluated before it uses the state and costs one adjoint.
        """
        return DesignFunction(self, objective, name)


def with_objective(problem: Single, objective: Objective) -> Single:
    """Return a copy of a problem with another objective; products are counted by both."""
    other = copy(problem)
    other.objective, other._adjoint_start = objective, NoAdjointStart()
    return other


@displayed
class DesignFunction:
    """c(α) of another objective, with a subgradient, at the states of a `ShapeProblem`.

    For constraints: the problem solves the state of a design when its own objective is evaluated, and this
    function costs one adjoint more. At a design whose state is not known it is solved first. Products with F
    are counted by the problem.
    """

    def __init__(self, problem: SingleProblem, objective: Objective, name: str | None = None) -> None:
        """Use `ShapeProblem.function`."""
        self._problem, self._own = problem, with_objective(problem, objective)
        self.name, self.objective = name or type(objective).__name__, objective
        self._last: DesignPoint | None = None

    def _facts(self) -> dict[str, Any]:
        return {"name": self.name, "objective": self.objective}

    @property
    def comm(self) -> MPI.Comm:
        """Communicator over which the subdomains are spread."""
        return self._problem.comm

    @property
    def inexact(self) -> bool:
        """Whether an optimiser may ask for less accuracy, see `within`."""
        return self._problem.inexact

    def fingerprint(self) -> dict[str, str]:
        """Identify the function, for a checkpoint."""
        return described(self.objective, f"function {self.name}")

    def starts(self) -> dict[str, np.ndarray]:
        """Return what its next adjoint starts from, for a checkpoint. Collective."""
        return self._own.starts()

    def start_from(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Start from what `starts` returned; the problem has recalled its memory before. Collective."""
        self._own.start_from(arrays)

    def __call__(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return c(α) and a subgradient, as accurately as the problem can. Collective."""
        point = self._solved_anew(alpha) if self.inexact else self._at_known_state(alpha)
        return point.value, point.gradient

    def within(self, alpha: np.ndarray, value: float, subgradient: float) -> tuple[float, np.ndarray, float]:
        """Return c(α), a subgradient and the estimated error of c. Collective.

        The known state, which is as accurate as its subgradient needs, is used if its effect on c is small
        enough, else it is solved to the smallest tolerance.
        """
        point = self._at_known_state(alpha)
        if point.error > value:
            point = self._solved_anew(alpha)
        return point.value, point.gradient, point.error

    def may_be_invalid(self, alpha: np.ndarray) -> bool:
        """Return whether the last result, at α, may not be a subgradient."""
        last = self._last
        return last is not None and np.array_equal(last.alpha, alpha) and last.weak.may_be_invalid

    def gradient_near(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the gradient of a design near α, see `ShapeProblem.gradient_near`. Collective."""
        return self._own.gradient_near(alpha, end)

    def _at_known_state(self, alpha: np.ndarray) -> DesignPoint:
        known = self._problem.known(alpha)
        if known is None:
            return self._solved_anew(alpha)
        if self._last is not None and self._last.state is known.state:
            return self._last
        return self._differentiated(alpha, known.state)

    def _solved_anew(self, alpha: np.ndarray) -> DesignPoint:
        return self._differentiated(alpha, self._problem.state_of(alpha))

    def _differentiated(self, alpha: np.ndarray, state: AnyState) -> DesignPoint:
        point = replace(self._own.differentiate(state), alpha=np.array(alpha, dtype=float))
        self._last = point
        return point


def with_fewest_weak_points(
    alpha: np.ndarray,
    end: np.ndarray,
    evaluate: Callable[[np.ndarray], Point],
    *,
    parts: tuple[float, ...] = (1e-2, 1.0),
) -> Point:
    """Return the design with the fewest weak points of a few on the way from one to another. Collective.

    In a generic direction, points leave their switches, and their branches together are those of an actual
    design. A point that is still on its switch far away does not depend on the design to first order: either
    branch gives the same derivative. `end`: A design nearby.
    """
    best: Point | None = None
    refused: InvalidDesignError | None = None
    for part in parts:
        try:
            point = evaluate(alpha + part * (end - alpha))
        except InvalidDesignError as error:
            refused = error
            continue
        if best is None or point.weak.count < best.weak.count:
            best = point
        if best.weak.count == 0:
            break
    if best is None:
        raise InvalidDesignError(f"no design near one with weak points can be evaluated: {refused}")
    return best
