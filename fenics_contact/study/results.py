"""The results of a study, as stored in `study.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from fenics_contact.errors import InvalidInputError
from fenics_contact.io import write_json
from fenics_contact.study.parameters import Parameters, parameters_from
from fenics_contact.study.protocol import QuantityFacts, SceneFacts


@dataclass(frozen=True)
class Run:
    """The measurements of one set of parameters.

    Attributes:
        parameters: The settings.
        failed: Why there is no result; empty if there is one.
        seconds: Wall time from the mesh to the state, median of the repeats, [s].
        spread: Smallest and largest of the repeats, [s].
        repeats: Number of repeats.
        phases: Seconds by phase of the median repeat, slowest rank.
        phases_after: The same for work after the state: objective, adjoint, gradient.
        memory: Peak resident memory of all ranks together, [byte]; None if unknown.
        load_average: Largest load of the machine over the minute before a repeat.
        counts: Sizes, products and statuses.
        residual: Largest relative residual that was reached.
        quantities: Name -> value, and exact value and relative error where there is one.
        parts: Errors by solver, friction law and mesh, relative energy norms.
        true_errors: The true errors, `TrueErrors`; None where no exact solution was computed.
    """

    parameters: Parameters
    failed: str = ""
    seconds: float = 0.0
    spread: Sequence[float] = (0.0, 0.0)
    repeats: int = 0
    phases: Mapping[str, float] = field(default_factory=dict)
    phases_after: Mapping[str, float] = field(default_factory=dict)
    memory: int | None = None
    load_average: float = 0.0
    counts: Mapping[str, int] | None = None
    residual: float | None = None
    quantities: Mapping[str, Any] | None = None
    parts: Mapping[str, float | None] | None = None
    true_errors: Mapping[str, float] | None = None

    def value(self, quantity: str) -> Any:
        """Return the value of a quantity, None if the run does not have it."""
        entry = (self.quantities or {}).get(quantity)
        return None if entry is None else entry["value"]

    def seconds_of(self, quantity: QuantityFacts) -> float:
        """Return the time to compute a quantity: that of the state and the phases after it, [s]."""
        return self.seconds + sum(self.phases_after.get(phase, 0.0) for phase in quantity.phases)


@dataclass(frozen=True)
class Results:
    """All runs of a study.

    Attributes:
        scene: The studied scene.
        ranks: MPI ranks of every run.
        runs: The runs, coarse ones first.
        base: Settings around which one at a time was varied.
        versions: Versions of the software.
    """

    scene: SceneFacts
    ranks: int
    runs: tuple[Run, ...]
    base: Parameters
    versions: Mapping[str, str]

    @property
    def good(self) -> tuple[Run, ...]:
        """The runs that have a result."""
        return tuple(run for run in self.runs if not run.failed)


def write_results(path: Path, results: Results, findings: Mapping[str, Any]) -> Path:
    """Write results and findings as JSON."""
    scene = results.scene
    facts = {f.name: getattr(scene, f.name) for f in fields(scene)}
    facts["spacing"] = {str(size): h for size, h in scene.spacing.items()}
    return write_json(
        path,
        {
            "scene": facts,
            "ranks": results.ranks,
            "base": results.base,
            "versions": dict(results.versions),
            "findings": findings,
            "runs": results.runs,
        },
    )


def read_study(folder: str | Path) -> Results:
    """Read the results of a study.

    Args:
        folder: Folder of a study, or its ``study.json``.

    Raises:
        InvalidInputError: If there is none, or it cannot be read.
    """
    path = Path(folder)
    path = path / "study.json" if path.is_dir() or not path.suffix else path
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        scene = _scene(data["scene"])
        runs = tuple(_run(run) for run in data["runs"])
        return Results(scene, int(data["ranks"]), runs, parameters_from(data["base"]), data["versions"])
    except FileNotFoundError:
        raise InvalidInputError(
            f"a study's results are in {path}, which does not exist: run the study first"
        ) from None
    except (ValueError, KeyError, TypeError) as reason:
        raise InvalidInputError(
            f"{path} must hold the results of a study, got {reason!r} on reading it: run the study again"
        ) from reason


def _scene(data: Mapping[str, Any]) -> SceneFacts:
    known = {name: value for name, value in data.items() if name not in ("spacing", "quantities")}
    quantities = tuple(QuantityFacts(**{**q, "phases": tuple(q["phases"])}) for q in data["quantities"])
    spacing = {int(size): float(h) for size, h in data["spacing"].items()}
    return SceneFacts(**known, spacing=spacing, quantities=quantities)


def _run(data: Mapping[str, Any]) -> Run:
    return Run(**{**data, "parameters": parameters_from(data["parameters"]), "spread": tuple(data["spread"])})
