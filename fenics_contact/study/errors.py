"""Errors of every run in every quantity: relative to an exact value, an extrapolation, or the finest mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fenics_contact.study.parameters import Parameters
from fenics_contact.study.protocol import QuantityFacts
from fenics_contact.study.results import Results, Run
from fenics_contact.study.richardson import extrapolate, measured_rate


@dataclass(frozen=True)
class Reference:
    """The reference value of a quantity.

    Attributes:
        kind: "extrapolated", "finest mesh", or the source of the true value, such as "theory".
        value: Its value; None for an exact one, which may differ from run to run.
        rate: Rate of the extrapolation, None without one.
        note: Why nothing was extrapolated.
        true: Whether it is an exact value, which every run stores with its own.
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
