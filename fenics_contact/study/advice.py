"""What to do for an accuracy, in words that follow from the runs."""

from __future__ import annotations

from collections.abc import Sequence

from fenics_contact.study.errors import Errors
from fenics_contact.study.parameters import Parameters
from fenics_contact.study.protocol import QuantityFacts
from fenics_contact.study.results import Run
from fenics_contact.study.words import percent, plural, seconds

#: Relative errors that users ask for.
TARGETS = (0.1, 0.05, 0.02, 0.01, 0.005)
#: Times that differ by less are the same.
AS_FAST = 1.1


def advice(errors: Errors, targets: Sequence[float] = TARGETS) -> list[str]:
    """Return a sentence for every quantity and accuracy: the cheapest way to it."""
    sentences: list[str] = []
    for quantity in errors.results.scene.quantities:
        ways: dict[str, list[str]] = {}
        for target in targets:
            ways.setdefault(_way(errors, quantity, target), []).append(percent(target))
        sentences += [f"For {', '.join(goals)} in {quantity.name}: {way}." for way, goals in ways.items()]
    return sentences


def reliable(errors: Errors, run: Run, quantity: str, target: float) -> bool:
    """Tell whether a run meets a target, and so does every run that solves finer and stricter.

    An error that passes through zero is small by chance on one mesh, and larger again on the next.
    """
    error = errors.of(run, quantity)
    if error is None or error > target:
        return False
    better = [other for other in errors.results.good if _refines(other.parameters, run.parameters)]
    return all((errors.of(other, quantity) or 0.0) <= target for other in better)


def _refines(other: Parameters, this: Parameters) -> bool:
    """Tell whether settings discretise alike, at least as fine, and are solved at least as strictly."""
    alike = (other.cell, other.discretisation) == (this.cell, this.discretisation)
    if not alike or other.size < this.size:
        return False
    if isinstance(other.tolerance, str) or isinstance(this.tolerance, str):
        return other.tolerance == this.tolerance
    return other.tolerance <= this.tolerance


def _way(errors: Errors, quantity: QuantityFacts, target: float) -> str:
    """Say how a target is reached, or that it is not."""
    known = [(run, e) for run in errors.results.good if (e := errors.of(run, quantity.name)) is not None]
    if not known:
        return "not known, there is nothing to compare with"
    reached = [(run, error) for run, error in known if reliable(errors, run, quantity.name, target)]
    if reached:
        run, error = _cheapest(errors, quantity, reached)
        return f"{settings(errors, run)}; the error is {percent(error)}"
    run, error = max(known, key=lambda pair: (pair[0].parameters.size, -pair[1]))
    return f"not reached by this sweep; the finest mesh gives {percent(error)} with {settings(errors, run)}"


def _cheapest(
    errors: Errors, quantity: QuantityFacts, runs: Sequence[tuple[Run, float]]
) -> tuple[Run, float]:
    """Return the fastest run; of those that are as fast, to the accuracy of clocks, the most usual one."""
    fastest = min(run.seconds_of(quantity) for run, _ in runs)
    alike = [pair for pair in runs if pair[0].seconds_of(quantity) <= AS_FAST * fastest]
    base = errors.results.base
    return min(alike, key=lambda pair: (len(pair[0].parameters.differences(base)), pair[1]))


def settings(errors: Errors, run: Run) -> str:
    """Return the settings and the cost of a run in words."""
    parameters, scene = run.parameters, errors.results.scene
    words = [
        f"{parameters.size} {scene.size_name}",
        plural(parameters.cell),
        plural(parameters.discretisation),
    ]
    words.append("balanced tolerance" if parameters.balanced else f"tolerance {parameters.tolerance:.0e}")
    if parameters.solver != "newton":
        words.append(f"by a {parameters.solver}")
    if parameters.subdomains is not None:
        words.append(f"about {parameters.subdomains} subdomains")
    ranks = errors.results.ranks
    return f"{', '.join(words)}: {seconds(run.seconds)} on {ranks} rank{'s' if ranks > 1 else ''}"
