"""The table of a study in Markdown: what every run cost and how wrong it was."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fenics_contact.io import write_text
from fenics_contact.study.certificates import CertificateCheck
from fenics_contact.study.errors import Errors
from fenics_contact.study.progress import described
from fenics_contact.study.results import Run
from fenics_contact.study.words import table


def write_table(path: Path, errors: Errors, advice: Sequence[str], check: CertificateCheck) -> Path:
    """Write advice, rates, certificates and all runs of a study."""
    parts = [
        _heading(errors),
        _advice(advice),
        "## Rates\n",
        rates_table(errors),
        _certificates(check),
        _runs(errors),
        _failures(errors),
    ]
    write_text(path, "\n".join(filter(None, parts)))
    return path


def _heading(errors: Errors) -> str:
    results = errors.results
    repeats = sorted({run.repeats for run in results.good}) or [0]
    load = max((run.load_average for run in results.good), default=0.0)
    between = f"{repeats[0]} to {repeats[-1]}" if len(repeats) > 1 else f"{repeats[0]}"
    return (
        f"# {results.scene.title}\n\n{results.scene.about}\n\n"
        f"{len(results.good)} runs of {len(results.runs)} have an answer, each on {results.ranks} "
        f"rank{'s' if results.ranks > 1 else ''} in a process of its own. Times are from the mesh to the "
        f"state, the median of {between} repeats; the machine's load over the minute before a run was "
        f"{load:.1f} at most.\n"
    )


def _advice(advice: Sequence[str]) -> str:
    return "## Advice\n\n" + "\n".join(f"- {sentence}" for sentence in advice) + "\n"


def rates_table(errors: Errors) -> str:
    """Tell, for each quantity, what it is compared with and how fast its error falls, beside theory."""
    strict = errors.strictest(errors.results.base)
    head, body = ("quantity", "compared with", "value", "rate found", "rate of theory"), []
    for quantity in errors.results.scene.quantities:
        reference = errors.references[quantity.name]
        kind = reference.kind + (f": {reference.note}" if reference.note else "")
        value = f"{reference.value:.6g} {quantity.unit}" if isinstance(reference.value, float) else ""
        found, theory = errors.rate(strict, quantity.name), quantity.rate
        body.append((quantity.name, kind, value, _number(found), _number(theory)))
    found, theory = errors.estimate_rate(strict), errors.results.scene.energy_rate
    body.append(("error of the displacement", "its own estimate", "", _number(found), _number(theory)))
    return f'{table(head, body)}\n\nOf the runs that differ from "{described(strict)}" in size alone.\n'


def _certificates(check: CertificateCheck) -> str:
    if check.smallest_factor is None or check.largest_factor is None:
        return ""
    words = (
        f"## Certificates\n\nThe certificate of the algebraic error lies between {check.smallest_factor:.2f} "
        f"and {check.largest_factor:.2f} times the true error in {check.checked} runs; "
    )
    words += f"of {check.unknown} runs it is not known.\n" if check.unknown else "it is known of every run.\n"
    return words + "".join(f"- Broken: {line}.\n" for line in check.broken)


def _runs(errors: Errors) -> str:
    quantities = [quantity.name for quantity in errors.results.scene.quantities]
    head = [
        "size",
        "cells",
        "contact",
        "tolerance",
        "solver",
        "unknowns",
        "subdomains",
        "products",
        "s",
        "MiB",
    ]
    head += [f"{name}, error" for name in quantities]
    head += ["solver's error ≤", "true", "friction", "mesh"]
    return f"## Runs\n\n{table(head, [_row(errors, run, quantities) for run in errors.results.good])}\n"


def _row(errors: Errors, run: Run, quantities: Sequence[str]) -> list[str]:
    parameters, counts, parts = run.parameters, run.counts or {}, run.parts or {}
    cells = [str(parameters.size), parameters.cell, parameters.discretisation]
    cells += ["balanced" if parameters.balanced else f"{parameters.tolerance:.0e}", parameters.solver]
    cells += [str(counts.get(name, "")) for name in ("torn_unknowns", "subdomains", "f_products")]
    cells += [f"{run.seconds:.2f}", "" if run.memory is None else f"{run.memory / 2**20:.0f}"]
    cells += [_relative(errors.of(run, name)) for name in quantities]
    true = (run.true_errors or {}).get("algebraic")
    return (
        cells
        + [_relative(value) for value in (parts.get("algebraic"), true, parts.get("friction"))]
        + [_relative(parts.get("discretisation"))]
    )


def _failures(errors: Errors) -> str:
    failed = [run for run in errors.results.runs if run.failed]
    if not failed:
        return ""
    lines = [f"- {described(run.parameters)}: {' '.join(run.failed.split())[:300]}" for run in failed]
    return "## Failed runs\n\n" + "\n".join(lines) + "\n"


def _relative(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
