"""The results of a study, as stored in `study.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact.errors import InvalidInputError
from fenics_contact.output.files import write_json
from fenics_contact.study.study import Parameters, QuantityFacts, SceneFacts


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


@naming_arguments
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
        runs = tuple(
            Run(**{**run, "parameters": Parameters(**run["parameters"]), "spread": tuple(run["spread"])})
            for run in data["runs"]
        )
        return Results(scene, int(data["ranks"]), runs, Parameters(**data["base"]), data["versions"])
    except FileNotFoundError:
        raise InvalidInputError(f"{path} does not exist: run the study first") from None
    except (ValueError, KeyError, TypeError) as reason:
        raise InvalidInputError(
            f"{path} must hold a study, got {reason!r} on reading it: run it again"
        ) from reason


def _scene(data: Mapping[str, Any]) -> SceneFacts:
    known = {name: value for name, value in data.items() if name not in ("spacing", "quantities")}
    quantities = tuple(QuantityFacts(**{**q, "phases": tuple(q["phases"])}) for q in data["quantities"])
    spacing = {int(size): float(h) for size, h in data["spacing"].items()}
    return SceneFacts(**known, spacing=spacing, quantities=quantities)


#: Largest accepted ratio of a certificate to the true error.
LARGEST_FACTOR = 10.0


@dataclass(frozen=True)
class CertificateCheck:
    """The certificates of all runs compared with the true errors.

    `unknown`: number of runs without one of them; `smallest_factor`: smallest ratio of the certificate to the
    true error, 1 or more if it is a bound.
    """

    checked: int
    unknown: int
    smallest_factor: float | None
    largest_factor: float | None
    broken: tuple[str, ...]


def check_certificates(results: Results) -> CertificateCheck:
    """Compare the certificate of every run with its true algebraic error.

    The reference solution has a certificate of its own, which is the uncertainty of the comparison.
    """
    factors, broken, unknown = [], [], 0
    for run in results.good:
        bound = (run.parts or {}).get("algebraic")
        if bound is None or run.true_errors is None:
            unknown += 1
            continue
        true, doubt = run.true_errors["algebraic"], run.true_errors["uncertainty"]
        if bound + doubt < true:
            broken.append(f"{run.parameters}: {bound:.3e} is below the true error {true:.3e}")
        if bound > LARGEST_FACTOR * (true + doubt):
            times = f"more than {LARGEST_FACTOR:g} times the true error"
            broken.append(f"{run.parameters}: {bound:.3e} is {times} {true:.3e}")
        if true > doubt:
            factors.append(bound / true)
    return CertificateCheck(
        len(results.good) - unknown,
        unknown,
        min(factors, default=None),
        max(factors, default=None),
        tuple(broken),
    )


#: Rates between which a sequence counts as converging: beyond them an extrapolated value is meaningless.
RATES = (0.45, 6.0)
#: Relative changes below this are rounding.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Extrapolation:
    """The limit of f(h) = f₀ + C hᵖ through the three finest meshes.

    `value`: f₀; that of the finest mesh where it could not be extrapolated; `rate`: p, None if there is none;
    `refused`: why nothing was extrapolated; empty if it was.
    """

    value: float
    rate: float | None
    refused: str = ""


def extrapolate(spacing: Sequence[float], values: Sequence[float]) -> Extrapolation:
    """Extrapolate to h = 0 by Richardson's rule with the measured rate.

    References:
        P. J. Roache, Quantification of uncertainty in computational fluid dynamics, Annu. Rev. Fluid Mech.
        29 (1997), section on unequal refinement.
    """
    h, f = np.asarray(spacing, dtype=np.float64), np.asarray(values, dtype=np.float64)
    finest = float(f[-1])
    if len(h) < 3:
        return Extrapolation(finest, None, f"three meshes are needed, there are {len(h)}")
    (h1, h2, h3), (f1, f2, f3) = h[-3:], f[-3:]
    before, after = f1 - f2, f2 - f3
    if max(abs(before), abs(after)) <= ROUNDING * abs(finest):
        return Extrapolation(finest, None, "the meshes give the same")
    if before * after <= 0.0:
        return Extrapolation(finest, None, "it does not converge monotonically on the three finest meshes")

    from scipy.optimize import brentq  # commands load this module

    def excess(p: float) -> float:
        return float((h1**p - h2**p) / (h2**p - h3**p) - before / after)

    if excess(RATES[0]) > 0.0:
        return Extrapolation(finest, None, "the changes from mesh to mesh do not fall")
    if excess(RATES[1]) < 0.0:
        return Extrapolation(finest, None, "the changes fall too fast to be a power of the mesh size yet")
    rate = float(brentq(excess, *RATES))
    return Extrapolation(float(f3 - after * h3**rate / (h2**rate - h3**rate)), rate)


def measured_rate(spacing: Sequence[float], errors: Sequence[float]) -> float | None:
    """Return the slope of errors over mesh sizes in logarithms, fitted to the three finest meshes."""
    h, e = np.asarray(spacing, dtype=np.float64)[-3:], np.asarray(errors, dtype=np.float64)[-3:]
    if len(h) < 2 or not np.all(e > 0.0):
        return None
    return float(np.polyfit(np.log(h), np.log(e), 1)[0])


@dataclass(frozen=True)
class Reference:
    """The reference value of a quantity.

    `kind`: "extrapolated", "finest mesh", or the source of the true value, such as "theory"; `value`: its
    value; None for an exact one, which may differ from run to run; `true`: whether it is an exact value,
    which every run stores with its own.
    """

    kind: str
    value: float | Sequence[float] | None = None
    rate: float | None = None
    note: str = ""
    true: bool = False


@dataclass(frozen=True)
class Errors:
    """Relative errors of all runs of a study.

    Attributes:
        results: The study.
    """

    results: Results

    @cached_property
    def references(self) -> dict[str, Reference]:
        """Quantity -> its reference."""
        return {quantity.name: self._reference(quantity) for quantity in self.results.scene.quantities}

    def of(self, run: Run, quantity: str) -> float | None:
        """Return the relative error of a run, None if unknown."""
        quantities = (run.quantities or {}).get(quantity)
        if run.failed or quantities is None:
            return None
        reference = self.references[quantity]
        if reference.true:
            error = quantities.get("error")
            return None if error is None else abs(float(error))
        if reference.value is None or (reference.kind == "finest mesh" and self._is_finest(run)):
            return None
        value, known = np.atleast_1d(quantities["value"]), np.atleast_1d(reference.value)
        scale = float(np.linalg.norm(known))
        if value.shape != known.shape or scale == 0.0:
            return None
        return float(np.linalg.norm(value - known) / scale)

    def sequence(self, parameters: Parameters) -> tuple[Run, ...]:
        """Return the runs that differ from some settings only in the mesh size, coarse ones first."""
        alike = [
            run
            for run in self.results.good
            if replace(parameters, size=run.parameters.size) == run.parameters
        ]
        return tuple(sorted(alike, key=lambda run: run.parameters.size))

    def strictest(self, parameters: Parameters) -> Parameters:
        """Return settings with the smallest tolerance at which the base's method was run."""
        numbers = [
            float(run.parameters.tolerance)
            for run in self.results.good
            if not run.parameters.balanced
            and replace(run.parameters, tolerance=parameters.tolerance, size=parameters.size) == parameters
        ]
        return replace(parameters, tolerance=min(numbers)) if numbers else parameters

    def convergence(self, parameters: Parameters, quantity: str) -> tuple[list[float], list[float]]:
        """Return mesh sizes and errors of a sequence of meshes."""
        pairs = [
            (self.results.scene.spacing[run.parameters.size], error)
            for run in self.sequence(parameters)
            if (error := self.of(run, quantity))
        ]
        return [h for h, _ in pairs], [error for _, error in pairs]

    def rate(self, parameters: Parameters, quantity: str) -> float | None:
        """Return the rate at which the error falls on the finest meshes."""
        return measured_rate(*self.convergence(parameters, quantity))

    def estimate_rate(self, parameters: Parameters) -> float | None:
        """Return the rate at which the estimated error of the displacement falls on the finest meshes."""
        runs = [run for run in self.sequence(parameters) if (run.parts or {}).get("discretisation")]
        spacing = [self.results.scene.spacing[run.parameters.size] for run in runs]
        return measured_rate(spacing, [float((run.parts or {})["discretisation"] or 0.0) for run in runs])

    def _reference(self, quantity: QuantityFacts) -> Reference:
        if quantity.source:
            return Reference(quantity.source, true=True)
        runs = self.sequence(self.strictest(self.results.base))
        known = [(run, run.value(quantity.name)) for run in runs if run.value(quantity.name) is not None]
        if not known:
            return Reference("finest mesh", note="no run knows it")
        finest = known[-1][1]
        if isinstance(finest, list):
            return Reference("finest mesh", finest, note="several numbers are not extrapolated")
        spacing = [self.results.scene.spacing[run.parameters.size] for run, _ in known]
        extrapolation = extrapolate(spacing, [float(value) for _, value in known])
        kind = "finest mesh" if extrapolation.refused else "extrapolated"
        return Reference(kind, extrapolation.value, extrapolation.rate, extrapolation.refused)

    def _is_finest(self, run: Run) -> bool:
        """Return whether a run has the discretisation of the reference on the finest mesh."""
        sequence = self.sequence(self.strictest(self.results.base))
        if not sequence:
            return False
        finest, mine = sequence[-1].parameters, run.parameters
        alike = (mine.cell, mine.discretisation) == (finest.cell, finest.discretisation)
        return alike and mine.size == finest.size
