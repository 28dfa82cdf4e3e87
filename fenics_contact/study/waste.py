"""What settings cost that buy nothing, in words that follow from the runs."""

from __future__ import annotations

from dataclasses import replace

from fenics_contact.study.errors import Errors
from fenics_contact.study.parameters import BALANCED
from fenics_contact.study.results import Run
from fenics_contact.study.words import joined, percent, plural, seconds


def waste(errors: Errors) -> list[str]:
    """Return sentences about tolerance, law of friction, subdomains, cells and discretisation of contact."""
    return [*_strictness(errors), *_fixed_points(errors), *_subdomains(errors), *_ways(errors)]


def _strictness(errors: Errors) -> list[str]:
    """Say what a strict tolerance costs beside the balanced one, and what it changes, on the finest mesh."""
    base, name = errors.results.base, errors.results.scene.size_name
    balanced = {run.parameters.size: run for run in errors.sequence(replace(base, tolerance=BALANCED))}
    strict = {run.parameters.size: run for run in errors.sequence(errors.strictest(base))}
    common = [size for size in balanced if size in strict and balanced[size] is not strict[size]]
    if not common:
        return []
    loose, tight = balanced[max(common)], strict[max(common)]
    changes = []
    for quantity in errors.results.scene.quantities:
        first, second = loose.value(quantity.name), tight.value(quantity.name)
        if isinstance(first, float | int) and isinstance(second, float | int) and second:
            changes.append(f"the {quantity.name} by {abs(first / second - 1):.0e}")
    return [
        f"Tolerance {tight.parameters.tolerance:.0e} instead of balanced, at {max(common)} {name}, costs "
        f"{_ratios(tight, loose)} and changes {joined(changes)}."
    ]


def _fixed_points(errors: Errors) -> list[str]:
    """Say what the fixed point costs beside Newton's method, at the strictest tolerance of both."""
    good = errors.results.good
    loops = [run for run in good if run.parameters.solver == "fixed point"]
    newton = {run.parameters: run for run in good}
    pairs = [
        (run, newton[other]) for run in loops if (other := replace(run.parameters, solver="newton")) in newton
    ]
    if not pairs:
        return []
    loop, direct = min(pairs, key=lambda pair: float(pair[0].parameters.tolerance))
    return [
        f"A fixed point instead of the law of friction in every Newton step, at tolerance "
        f"{loop.parameters.tolerance:.0e}, costs {_ratios(loop, direct)}."
    ]


def _subdomains(errors: Errors) -> list[str]:
    """Say which numbers of subdomains were fast and slow on the base's mesh."""
    base = errors.results.base
    runs = [run for run in errors.results.good if replace(run.parameters, subdomains=base.subdomains) == base]
    if len(runs) < 2:
        return []
    counted = sorted((run.seconds, (run.counts or {}).get("subdomains", 0)) for run in runs)
    (least, fast), (most, slow) = counted[0], counted[-1]
    numbers = [str(number) for number in sorted({number for _, number in counted})]
    words = (
        f"Of {joined(numbers)} subdomains {fast} take the least time, {seconds(least)}, and {slow} the most, "
    )
    words += f"{seconds(most)}"
    own = next((run for run in runs if run.parameters == base), None)
    if own is not None and base.subdomains is None:
        words += f"; left open, {(own.counts or {}).get('subdomains', 0)} are taken: {seconds(own.seconds)}"
    return [f"{words}."]


def _ways(errors: Errors) -> list[str]:
    """Say what other cells and another discretisation of contact give on the finest mesh that both have."""
    base, scene = errors.results.base, errors.results.scene
    own = {run.parameters.size: run for run in errors.sequence(base)}
    main, sentences = scene.quantities[0].name, []
    for setting in ("cell", "discretisation"):
        values = {getattr(run.parameters, setting): None for run in errors.results.good}
        for value in values:
            others = errors.sequence(replace(base, **{setting: value}))  # type: ignore[arg-type]
            common = [run for run in others if run.parameters.size in own]
            if value == getattr(base, setting) or not common:
                continue
            other, this = common[-1], own[common[-1].parameters.size]
            first, second = errors.of(other, main), errors.of(this, main)
            if first is not None and second is not None:
                sentences.append(
                    f"{plural(value).capitalize()} instead of {plural(getattr(base, setting))}, at "
                    f"{other.parameters.size} {scene.size_name}: {percent(first)} error in {main} instead of "
                    f"{percent(second)}, {other.seconds / this.seconds:.2g} times the time."
                )
    return sentences


def _ratios(run: Run, other: Run) -> str:
    """Return how many times the time and the products of another run a run takes."""
    products = [(each.counts or {}).get("f_products", 0) for each in (run, other)]
    words = f"{run.seconds / other.seconds:.2g} times the time"
    return f"{words} and {products[0] / products[1]:.2g} times the products" if products[1] else words
