"""From the [design] of a scene file to a shape problem and its minimisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact.checkpoint import Checkpoint
from fenics_contact.contact import ContactProblem
from fenics_contact.errors import InvalidInputError, scene_file_code, together
from fenics_contact.optimize import (
    BundleTrust,
    Callback,
    LinearConstraints,
    NonlinearConstraint,
    Result,
    minimize,
)
from fenics_contact.scene import LoadStep
from fenics_contact.scene_file.constraints import ObjectiveConstraint, VolumeConstraint
from fenics_contact.scene_file.design import DesignPart
from fenics_contact.scene_file.design_surfaces import design_surface
from fenics_contact.scene_file.document import Document
from fenics_contact.scene_file.objectives import in_words, objective_of
from fenics_contact.scene_file.own_python import is_reference, load
from fenics_contact.scene_file.placing import Shaped
from fenics_contact.scene_file.source import Source
from fenics_contact.shape import AdaptiveTolerance, LoadPath, Objective, ShapeProblem, SurfaceDesign


@dataclass(frozen=True, eq=False)
class ShapeTask:
    """A shape optimisation, ready to run.

    Attributes:
        problem: J(α) with its subgradient.
        start: Design variables at the start, [length].
        bounds: Least and largest values of the variables, [length].
        constraints: The linear ones in one, volumes, and limits of other objectives.
        method: The optimiser.
        restore: Whether the start may violate limits of other objectives.
    """

    problem: ShapeProblem | LoadPath
    start: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]
    constraints: tuple[LinearConstraints | NonlinearConstraint, ...]
    method: BundleTrust
    restore: bool = False

    def minimize(self, *, callback: Callback | None = None, checkpoint: Checkpoint | None = None) -> Result:
        """Run it. Collective; a stop before the tolerance is met is reported by the result's reason.

        Args:
            callback: Called after every evaluation, see `fenics_contact.optimize.minimize`.
            checkpoint: File from which an interrupted run continues, or None.
        """
        return minimize(
            self.problem,
            self.start,
            self.method,
            bounds=self.bounds,
            constraints=self.constraints,
            restore=self.restore,
            callback=callback,
            checkpoint=checkpoint,
        )


def shape_task(
    source: Source,
    document: Document,
    contact: ContactProblem,
    shapes: Mapping[str, Shaped],
    steps: Sequence[LoadStep],
) -> ShapeTask:
    """Pose the optimisation of a scene file. Collective.

    Args:
        source: Source of the document.
        document: The file; it has a design.
        contact: Problem that computes the states of its scene.
        shapes: Body name -> its mesh with its shape.
        steps: All load steps; none where everything acts at once.

    Raises:
        InvalidInputError: If a surface cannot be designed or numbers do not fit the number of variables.
    """
    design = document.design
    assert design is not None
    moving = tuple(
        SurfaceDesign(
            part.body, design_surface(shapes[part.body], part.surface, part.body), part.net, part.transition
        )
        for part in design.surfaces
    )
    with together(contact.comm):
        objective = _objective(design.objective, source)
    adaptive = AdaptiveTolerance() if design.adaptive else None
    alone = ShapeProblem(contact, moving, objective, tolerance=adaptive)
    problem = _over_steps(alone, design, steps)
    lower, upper = (
        np.concatenate([np.full(move.size, getattr(part, side)) for move, part in _paired(moving, design)])
        for side in ("lower", "upper")
    )
    start = np.zeros(problem.size) if design.start is None else _fitting("start", design.start, problem.size)
    method = design.made(raise_on_failure=False)
    constraints = _constraints(design, problem, start, source)
    return ShapeTask(problem, start, (lower, upper), constraints, method, design.restore)


def _over_steps(
    problem: ShapeProblem, design: DesignPart, steps: Sequence[LoadStep]
) -> ShapeProblem | LoadPath:
    """Return the problem whose objective is added over load steps, if there are any. Collective."""
    if not steps:
        if design.over_steps is not None or any(getattr(part, "step", None) for part in design.constraints):
            raise InvalidInputError(
                "over_steps and step are names of load steps, but the file has none: give [[steps]], or "
                "leave them out"
            )
        return problem
    if design.over_steps is None:
        return LoadPath(problem, steps)
    return LoadPath(problem, steps, dict.fromkeys(design.over_steps, problem.objective))


def _paired(moving: tuple[SurfaceDesign, ...], design: DesignPart) -> Any:
    return zip(moving, design.surfaces, strict=True)


def _objective(name: Any, source: Source) -> Objective:
    if not is_reference(name):
        return objective_of(name)
    given: Any = load(name, source.folder)
    with scene_file_code(f"objective {name!r}"):
        missing = [part for part in ("value", "partials") if not hasattr(given, part)]
    if missing or isinstance(given, type):
        raise InvalidInputError(
            f"objective {name!r} must be an object with value and partials, got {given!r}: see "
            "fenics_contact.shape.Objective, and give an instance, not a class"
        )
    objective: Objective = given
    return objective


def _constraints(
    design: DesignPart, problem: ShapeProblem | LoadPath, start: np.ndarray, source: Source
) -> tuple[LinearConstraints | NonlinearConstraint, ...]:
    """Return the constraints of a design, all linear ones in one. Collective."""
    rows: list[np.ndarray] = []
    limits: list[float] = []
    others: list[NonlinearConstraint] = []
    for part in design.constraints:
        if isinstance(part, VolumeConstraint):
            upper, lower = _limits(part, problem.volume(start)[0])
            others.append(NonlinearConstraint(problem.volume, upper, lower, "volume"))
        elif isinstance(part, ObjectiveConstraint):
            others.append(_limited(part, problem, source))
        else:
            rows.append(_fitting("coefficients", part.coefficients, problem.size))
            limits.append(part.at_most)
    return (*([LinearConstraints(np.array(rows), np.array(limits))] if rows else []), *others)


def _limited(
    part: ObjectiveConstraint, problem: ShapeProblem | LoadPath, source: Source
) -> NonlinearConstraint:
    """Return the limits of an objective. Collective."""
    with together(problem.comm):
        objective = _objective(part.objective, source)
    name = part.name or in_words(part.objective)
    if isinstance(problem, LoadPath):
        step = part.step or list(problem.problems)[-1]
        return NonlinearConstraint(problem.function({step: objective}), *_limits(part), name)
    return NonlinearConstraint(problem.function(objective, name), *_limits(part), name)


def _limits(part: VolumeConstraint | ObjectiveConstraint, unit: float = 1.0) -> tuple[float, float]:
    """Return the upper and the lower limit, infinite where it is not given."""
    return (
        np.inf if part.at_most is None else part.at_most * unit,
        -np.inf if part.at_least is None else part.at_least * unit,
    )


def _fitting(name: str, values: tuple[float, ...], size: int) -> np.ndarray:
    if len(values) != size:
        raise InvalidInputError(
            f"{name} must have {size} entries, one for each design variable, got {len(values)}: the nets of "
            "design.surfaces have so many control points"
        )
    return np.array(values)
