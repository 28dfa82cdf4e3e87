"""The output of a study: results, table, figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import counted
from fenics_contact.output.files import write_text
from fenics_contact.study.results import (
    CertificateCheck,
    Errors,
    Results,
    Run,
    check_certificates,
    write_results,
)
from fenics_contact.study.study import Parameters, QuantityFacts

#: Relative errors of interest.
TARGETS = (0.1, 0.05, 0.02, 0.01, 0.005)
#: Times that differ by less count as equal.
AS_FAST = 1.1
#: Columns that identify a run, and its cost.
SETTINGS = ("size", "cells", "contact", "tolerance", "solver", "subdomains")


def table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [f"| {' | '.join(line)} |" for line in (head, *body)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


def percent(value: float | None) -> str:
    """Format a relative number in percent with two digits, empty for None."""
    return "" if value is None else f"{100 * value:.2g} %"


def seconds(value: float) -> str:
    """Format a time, [s], with at least two digits."""
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def settings(run: Run) -> tuple[str, ...]:
    """Return the settings of a run, one for each of `SETTINGS`."""
    known, subdomains = run.parameters, (run.counts or {}).get("subdomains", "")
    return (
        str(known.size), known.cell, known.discretisation, known.tolerance_words, known.solver,
        str(subdomains),
    )  # fmt: skip


@naming_arguments
def accuracy_table(errors: Errors, targets: Sequence[float] = TARGETS) -> str:
    """Tabulate for every quantity and accuracy the fastest run that reaches it, see `reliable`.

    Args:
        errors: Errors of a study's runs.
        targets: Required relative errors.

    Returns:
        A table in Markdown.
    """
    body = []
    for quantity in errors.results.scene.quantities:
        ways: dict[tuple[str, ...], list[str]] = {}
        for target in targets:
            ways.setdefault(_way(errors, quantity, target), []).append(percent(target))
        body += [(quantity.name, ", ".join(goals), *way) for way, goals in ways.items()]
    return table(("quantity", "error wanted", *SETTINGS, "s", "error"), body)


def _way(errors: Errors, quantity: QuantityFacts, target: float) -> tuple[str, ...]:
    """Return settings, seconds and error of the fastest run; of the finest one where none reaches it."""
    known = [(run, e) for run in errors.results.good if (e := errors.of(run, quantity.name)) is not None]
    reached = [(run, e) for run, e in known if reliable(errors, run, quantity.name, target)]
    if reached:
        run, error = _cheapest(errors, quantity, reached)
        return (*settings(run), seconds(run.seconds_of(quantity)), percent(error))
    if not known:
        return (*[""] * len(SETTINGS), "", "nothing to compare with")
    run, error = max(known, key=lambda pair: (pair[0].parameters.size, -pair[1]))
    return (*settings(run), seconds(run.seconds_of(quantity)), f"{percent(error)}: not reached")


def reliable(errors: Errors, run: Run, quantity: str, target: float) -> bool:
    """Return whether a run and every finer and stricter one reach a target.

    An error that passes through zero is small by chance on one mesh, and larger again on the next.
    """
    error = errors.of(run, quantity)
    if error is None or error > target:
        return False
    better = [other for other in errors.results.good if _refines(other.parameters, run.parameters)]
    return all((errors.of(other, quantity) or 0.0) <= target for other in better)


def _refines(other: Parameters, this: Parameters) -> bool:
    """Return whether settings have the same discretisation, and mesh and tolerance are at least as fine."""
    alike = (other.cell, other.discretisation) == (this.cell, this.discretisation)
    if not alike or other.size < this.size:
        return False
    if isinstance(other.tolerance, str) or isinstance(this.tolerance, str):
        return other.tolerance == this.tolerance
    return other.tolerance <= this.tolerance


def _cheapest(
    errors: Errors, quantity: QuantityFacts, runs: Sequence[tuple[Run, float]]
) -> tuple[Run, float]:
    """Return the fastest run; of those that are equally fast, to timing accuracy, the most usual one."""
    fastest = min(run.seconds_of(quantity) for run, _ in runs)
    alike = [pair for pair in runs if pair[0].seconds_of(quantity) <= AS_FAST * fastest]
    base = errors.results.base
    return min(alike, key=lambda pair: (len(pair[0].parameters.differences(base)), pair[1]))


@naming_arguments
def cost_table(errors: Errors) -> str:
    """Tabulate cost and effect of other values of settings than the base's, on the finest common mesh.

    Args:
        errors: Errors of a study's runs.

    Returns:
        A table in Markdown.
    """
    quantities = [quantity.name for quantity in errors.results.scene.quantities]
    head, body = ["setting", "instead of", "size", "s", "time, ratio", "products, ratio"], []
    head += [f"error in {quantities[0]}", "instead of", *(f"{name} changes by" for name in quantities)]
    for setting, run, other in compared(errors):
        products = [(each.counts or {}).get("f_products", 0) for each in (run, other)]
        body.append(
            (*(_value(each, setting) for each in (run, other)), str(run.parameters.size),
             seconds(run.seconds),
             f"{run.seconds / other.seconds:.2f}", f"{products[0] / products[1]:.2f}" if products[1] else "",
             *(percent(errors.of(each, quantities[0])) for each in (run, other)),
             *(_change(run.value(name), other.value(name)) for name in quantities))
        )  # fmt: skip
    return table(head, body)


def compared(errors: Errors) -> list[tuple[str, Run, Run]]:
    """Return setting, run and twin: the twin has the base's value of that setting and equals it otherwise.

    Among runs with the same value that of the finest mesh and the strictest tolerance is used.
    """
    base, known = errors.results.base, {run.parameters: run for run in errors.results.good}
    twins: dict[tuple[str, object], tuple[str, Run, Run]] = {}
    for setting in ("tolerance", "solver", "subdomains", "cell", "discretisation"):
        for run in sorted(errors.results.good, key=lambda run: run.parameters.rank()):
            usual: dict[str, Any] = {setting: getattr(base, setting)}
            value = getattr(run.parameters, setting)
            twin = known.get(replace(run.parameters, **usual))
            if twin is not None and value != usual[setting]:
                twins[setting, value] = setting, run, twin
    return list(twins.values())


def _value(run: Run, setting: str) -> str:
    if setting == "tolerance":
        return run.parameters.tolerance_words
    if setting == "solver":
        return f"{run.parameters.solver}, {run.parameters.tolerance_words}"
    if setting == "subdomains":
        return f"{(run.counts or {}).get('subdomains', 0)} subdomains"
    return str(getattr(run.parameters, setting))


def _change(value: object, before: object) -> str:
    numbers = isinstance(value, float | int) and isinstance(before, float | int) and before
    return f"{abs(value / before - 1):.0e}" if numbers else ""  # type: ignore[operator]


PICTURES = ("accuracy", "convergence", "parts", "phases")


@naming_arguments
def write_report(folder: str | Path, results: Results, *, figures: bool = True) -> str:
    """Write ``study.json``, ``table.md`` and the figures of a study, also of an incomplete one.

    Args:
        folder: Output folder; created.
        results: The measurements.
        figures: Whether to draw; needs matplotlib.

    Returns:
        The costs of accuracies and of settings, as Markdown.
    """
    target, errors = Path(folder), Errors(results)
    findings = {"references": errors.references, "certificates": check_certificates(results)}
    write_results(target / "study.json", results, findings)
    write_text(target / "table.md", table_page(errors))
    if figures and results.good:
        from fenics_contact.study import figures as drawing  # needs matplotlib

        for picture in PICTURES:
            getattr(drawing, f"plot_{picture}")(errors, target / f"{picture}.png")
    return _answers(errors)


def findings_of(errors: Errors, level: int = 2) -> tuple[str, str, str, str]:
    """Return title, costs, rates and certificates of a study, as Markdown."""
    title = f"{'#' * level} {errors.results.scene.title}\n\n{errors.results.scene.about}\n"
    check = check_certificates(errors.results)
    return title, _answers(errors), rates_table(errors), _certificates(check)


def table_page(errors: Errors) -> str:
    """Return ``table.md``: the findings, and every run."""
    title, answers, rates, certificates = findings_of(errors, 1)
    parts = [title, _measured(errors.results), answers, "## Rates\n"]
    parts += [rates, "## Certificates\n", certificates, "## Runs\n", _runs(errors)]
    reasons = {run.parameters: " ".join(run.failed.split()) for run in errors.results.runs if run.failed}
    failed = [f"- {parameters}: {reason[:300]}" for parameters, reason in reasons.items()]
    return "\n".join([*parts, "## Failed runs\n", *failed, ""] if failed else parts)


def _measured(results: Results) -> str:
    """Describe how it was measured."""
    repeats = sorted({run.repeats for run in results.good}) or [0]
    load = max((run.load_average for run in results.good), default=0.0)
    between = f"{repeats[0]} to {repeats[-1]}" if len(repeats) > 1 else f"{repeats[0]}"
    return (
        f"{len(results.good)} runs of {len(results.runs)} have an answer, each on "
        f"{counted(results.ranks, 'rank')} in a process of its own. Times are from the mesh to the "
        f"state, the median of {between} repeats; the machine's load over the minute before a run was "
        f"{load:.1f} at most.\n"
    )


def _answers(errors: Errors) -> str:
    """Return the costs of accuracies and of settings."""
    scene, ranks = errors.results.scene, errors.results.ranks
    of = f"size: {scene.size_name}; on {counted(ranks, 'rank')}"
    return (
        f"**What an accuracy takes** ({of})\n\n{accuracy_table(errors)}\n\n"
        f"**What a setting costs**\n\n{cost_table(errors)}\n"
    )


def rates_table(errors: Errors) -> str:
    """Return, for each quantity, its reference and its measured and theoretical convergence rates."""
    strict = errors.strictest(errors.results.base)
    head, body = ("quantity", "compared with", "value", "rate found", "rate of theory"), []
    for quantity in errors.results.scene.quantities:
        reference = errors.references[quantity.name]
        kind = reference.kind + (f": {reference.note}" if reference.note else "")
        value = f"{reference.value:.6g} {quantity.unit}" if isinstance(reference.value, float) else ""
        rate, theory = errors.rate(strict, quantity.name), quantity.rate
        body.append((quantity.name, kind, value, _number(rate), _number(theory)))
    rate, theory = errors.estimate_rate(strict), errors.results.scene.energy_rate
    body.append(("error of the displacement", "its own estimate", "", _number(rate), _number(theory)))
    return f'{table(head, body)}\n\nOf the runs that differ from "{strict}" in size alone.\n'


def _certificates(check: CertificateCheck) -> str:
    if check.smallest_factor is None or check.largest_factor is None:
        return f"The certificate of the solver's error is not known in {check.unknown} runs.\n"
    words = (
        f"The certificate of the solver's error lies between {check.smallest_factor:.2f} and "
        f"{check.largest_factor:.2f} times the true error in {check.checked} runs; "
    )
    words += f"of {check.unknown} runs it is not known.\n" if check.unknown else "it is known of every run.\n"
    return words + "".join(f"- Broken: {line}.\n" for line in check.broken)


def _runs(errors: Errors) -> str:
    names = [quantity.name for quantity in errors.results.scene.quantities]
    head = (*SETTINGS, "unknowns", "products", "s", "MiB", *(f"{name}, error" for name in names))
    head = (*head, "solver's error ≤", "true", "friction", "mesh")
    return table(head, [_row(errors, run, names) for run in errors.results.good]) + "\n"


def _row(errors: Errors, run: Run, names: list[str]) -> tuple[str, ...]:
    counts, parts = run.counts or {}, run.parts or {}
    true = (run.true_errors or {}).get("algebraic")
    relative = [errors.of(run, name) for name in names]
    relative += [parts.get("algebraic"), true, parts.get("friction"), parts.get("discretisation")]
    return (
        *settings(run), *(str(counts.get(name, "")) for name in ("torn_unknowns", "f_products")),
        f"{run.seconds:.2f}", "" if run.memory is None else f"{run.memory / 2**20:.0f}",
        *("" if value is None else f"{value:.1e}" for value in relative),
    )  # fmt: skip


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
