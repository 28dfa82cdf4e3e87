"""Scenes and designs as functions of parameters, for programs that call plain functions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact._base.libraries import MPI
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._scene.scene import Scene
from fenics_contact.design.problem import ShapeProblem
from fenics_contact.errors import (
    ConvergenceError,
    InfeasibleError,
    InvalidDesignError,
    InvalidInputError,
    collective,
    collectively,
    together,
)
from fenics_contact.errors.kinds import user_code
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.state import State


@dataclass(frozen=True)
class Answer:
    """Quantities of interest at one set of parameters, bitwise equal on all ranks.

    Attributes:
        values: Quantity to value; nan where there is no state.
        subgradients: Quantity to a subgradient by the parameters, shape (n_parameters,), where it is known.
        failure: Why there is no state; empty where there is one.
        products: Number of products with the dual operator.
    """

    parameters: Mapping[str, float]
    values: Mapping[str, float]
    subgradients: Mapping[str, np.ndarray] = field(default_factory=dict)
    failure: str = ""
    products: int = 0

    def __getitem__(self, quantity: str) -> float:
        """Return the value of a quantity."""
        return self.values[quantity]

    @property
    def array(self) -> np.ndarray:
        """Values in the order of the quantities, shape (n_quantities,)."""
        return np.array(list(self.values.values()), dtype=float)


Parameters = Mapping[str, float] | ArrayLike
"""All parameters in their order, or some by name."""
Quantity = Callable[[State], Any]
"""Takes a state, returns a number. Called by all ranks together."""
Failures = Literal["raise", "nan"]

#: Errors that mean that there is no answer at these parameters, rather than a mistake in the program.
NO_ANSWER = (InvalidDesignError, InfeasibleError, ConvergenceError)


class Response(ABC):
    """A function of named numbers.

    Attributes:
        nominal: Parameter to its default value.
        evaluations: Number of answers so far, failed ones included.
        products: Products with the dual operator so far.
    """

    def __init__(self, nominal: Mapping[str, float], comm: MPI.Comm, failures: Failures) -> None:
        """Check the parameters and the failure mode."""
        if failures not in ("raise", "nan"):
            raise InvalidInputError(f"failures must be 'raise' or 'nan', got {failures!r}")
        if not nominal:
            raise InvalidInputError("a response needs at least one parameter, got none: name them in nominal")
        self.nominal = {name: float(value) for name, value in nominal.items()}
        self.comm, self._failures = comm, failures
        self.evaluations, self.products = 0, 0

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of arrays."""
        return tuple(self.nominal)

    @property
    @abstractmethod
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities of interest, in the order of arrays."""

    @collectively("a response", lambda self, *_, **__: self.comm)
    def __call__(self, parameters: Parameters | None = None, **named: float) -> Answer:
        """Evaluate at a set of parameters; the others keep their nominal values. Collective.

        Args:
            parameters: All of them in their order, shape (n_parameters,), or a mapping from names.
            **named: Some by name, which override the others.

        Raises:
            InvalidInputError: If a name is unknown, the shape does not fit or a number is not finite.
            InvalidDesignError: If the design does not exist (``failures="raise"``).
            InfeasibleError: If there is no equilibrium (``failures="raise"``).
            ConvergenceError: If the solver fails (``failures="raise"``).
        """
        with together(self.comm):
            values = self._values(parameters, named)
        self.evaluations += 1
        try:
            results, subgradients, products = self._answer(values)
        except NO_ANSWER as error:
            if self._failures == "raise":
                raise
            nothing = dict.fromkeys(self.quantities, np.nan)
            return Answer(values, nothing, failure=str(error) or type(error).__name__)
        self.products += products
        # Outer tools on different ranks must see bitwise equal values.
        results, subgradients = self.comm.bcast((results, subgradients))
        return Answer(values, results, subgradients, products=products)

    def table(self, samples: ArrayLike) -> np.ndarray:
        """Evaluate at many sets of parameters, in their order. Collective.

        Args:
            samples: One row per set, shape (n, n_parameters).

        Returns:
            Shape (n, n_quantities).
        """
        rows = np.array(samples, dtype=float)
        if rows.ndim != 2:
            raise InvalidInputError(
                f"samples must have shape (n, {len(self.nominal)}), one column for each of "
                f"{list(self.parameters)}, got {rows.shape}"
            )
        return np.array([self(row).array for row in rows]).reshape(len(rows), len(self.quantities))

    @abstractmethod
    def _answer(self, values: dict[str, float]) -> tuple[dict[str, float], dict[str, np.ndarray], int]:
        """Return the quantities, the known subgradients, and the number of products. Collective."""

    def _values(self, given: Parameters | None, named: Mapping[str, float]) -> dict[str, float]:
        """Return every parameter's value."""
        if given is not None and not isinstance(given, Mapping):
            array = np.array(given, dtype=float)
            if array.shape != (len(self.nominal),):
                raise InvalidInputError(
                    f"parameters must have shape ({len(self.nominal)},), one number for each of "
                    f"{list(self.parameters)}, got {array.shape}: give all, or some by name"
                )
            given = {name: float(value) for name, value in zip(self.parameters, array, strict=True)}
        chosen = {**(given or {}), **named}
        unknown = [name for name in chosen if name not in self.nominal]
        if unknown:
            raise InvalidInputError(f"parameters must be some of {list(self.parameters)}, got {unknown}")
        values = {**self.nominal, **{name: float(value) for name, value in chosen.items()}}
        bad = [name for name, value in values.items() if not np.isfinite(value)]
        if bad:
            raise InvalidInputError(f"parameters must be finite, got {values[bad[0]]} for {bad[0]!r}")
        return values


class SceneResponse(Response):
    """Quantities of the equilibrium of a scene that depends on parameters.

    A state starts from the one before, and what a parameter does not affect is reused: factors where only
    loads change, forms and numbering where meshes stay. So let ``build`` reuse the same mesh objects.

    Example:
        >>> def build(friction, load):  # doctest: +SKIP
        ...     pair = ContactPair(Surface("block", "z0"), floor, Coulomb(friction))
        ...     return Scene(bodies, loads=[Pressure("block", "z1", load)], contacts=[pair])
        >>> peak = {"largest pressure": lambda state: state.contact.pressure.max()}  # doctest: +SKIP
        >>> response = SceneResponse(build, {"friction": 0.3, "load": 10.0}, peak, comm)  # doctest: +SKIP
        >>> response(load=12.0)["largest pressure"]  # doctest: +SKIP
    """

    def __init__(
        self,
        build: Callable[..., Scene],
        nominal: Mapping[str, float],
        quantities: Mapping[str, Quantity],
        comm: MPI.Comm,
        *,
        partitions: Mapping[str, np.ndarray] | None = None,
        solver: DualSolver | None = None,
        tolerance: float | None = None,
        failures: Failures = "raise",
        warm: bool = True,
    ) -> None:
        """Prepare; nothing is built before the first answer.

        Args:
            build: Takes the parameters by name, returns the scene, the same on every rank.
            nominal: Parameter to its default value.
            quantities: Name to a function of the state, called by all ranks together.
            comm: Communicator over which the subdomains are spread.
            partitions: As for `solve_scene`.
            solver: As for `solve_scene`.
            tolerance: Relative residual of every state; None for that of the solver, see
                `ContactProblem.number`.
            failures: Whether a state that does not exist or does not converge raises, or makes all quantities
                nan with the reason in `Answer.failure`. Other errors always raise.
            warm: Whether a state starts from the one before; answers then depend on the order of evaluation,
                within the tolerance.

        Raises:
            InvalidInputError: If there is no parameter or no quantity.
        """
        super().__init__(nominal, comm, failures)
        if not quantities:
            raise InvalidInputError("a response needs at least one quantity of interest, got none: name one")
        self._build, self._of_state, self._warm = build, dict(quantities), warm
        self._partitions = partitions
        self._problem_of = partial(
            ContactProblem, comm=comm, partitions=partitions, solver=solver, tolerance=tolerance
        )
        self._problem: ContactProblem | None = None

    @property
    def state(self) -> State | None:
        """The last state, None before the first."""
        return None if self._problem is None else self._problem.state

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities of interest, in the order of arrays."""
        return tuple(self._of_state)

    def _answer(self, values: dict[str, float]) -> tuple[dict[str, float], dict[str, np.ndarray], int]:
        with together(self.comm), user_code("the function that builds the scene of a response"):
            scene = self._build(**values)
        with together(self.comm):
            if self._problem is None:
                self._problem = self._problem_of(scene)
            elif not _alike(scene, self._problem.scene):
                self._problem = self._problem.on(scene, self._partitions)
        problem = self._problem
        wanted = problem.number(scene) if problem.tolerance is None else problem.tolerance
        state = problem.solve(scene, start="last" if self._warm else None, tolerance=wanted)
        return evaluated(self._of_state, state, self.comm), {}, state.solution.products


class DesignResponse(Response):
    """The objective of a design problem with its subgradient, and other quantities of its state.

    Parameters are the design variables, called "alpha 0" and so on.

    Example:
        >>> response = DesignResponse(problem)  # doctest: +SKIP
        >>> answer = response(np.zeros(problem.size))  # doctest: +SKIP
        >>> answer["objective"], answer.subgradients["objective"]  # doctest: +SKIP
    """

    def __init__(
        self,
        problem: ShapeProblem,
        quantities: Mapping[str, Quantity] | None = None,
        *,
        failures: Failures = "raise",
    ) -> None:
        """Wrap the problem.

        Args:
            problem: The design problem.
            quantities: Further quantities of the state, in addition to "objective".
            failures: As for `SceneResponse`.
        """
        super().__init__({f"alpha {k}": 0.0 for k in range(problem.size)}, problem.comm, failures)
        self.problem, self._of_state = problem, dict(quantities or {})

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities of interest, in the order of arrays."""
        return ("objective", *self._of_state)

    def _answer(self, values: dict[str, float]) -> tuple[dict[str, float], dict[str, np.ndarray], int]:
        before = self.problem.products
        point = self.problem.evaluate(np.array(list(values.values())))
        more = evaluated(self._of_state, point.state, self.comm)
        results = {"objective": point.value, **more}
        return results, {"objective": point.gradient}, self.problem.products - before


def evaluated(quantities: Mapping[str, Quantity], state: State, comm: MPI.Comm) -> dict[str, float]:
    """Return the quantities of a state. Collective."""
    values: dict[str, float] = {}
    for name, quantity in quantities.items():
        with collective(comm, f"quantity {name!r} of a response", closed=True, users=True):
            values[name] = _number(name, quantity(state))
    return values


def _number(name: str, value: Any) -> float:
    """Return the value of a quantity as a number."""
    array = np.asarray(value)
    if array.size != 1:
        raise InvalidInputError(
            f"a quantity must be one number, {name!r} has shape {array.shape}: take its largest entry or norm"
        )
    try:
        return float(array.item())
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            f"a quantity must be one number, {name!r} is {value!r}: return a float, the same on every rank"
        ) from error


def _alike(scene: Scene, other: Scene) -> bool:
    """Return whether two scenes can share a decomposition."""
    if scene.body_names != other.body_names:
        return False
    return all(
        np.array_equal(scene.bodies[name].mesh.cells, other.bodies[name].mesh.cells)
        and scene.holds_as(other, name)
        for name in scene.body_names
    )
