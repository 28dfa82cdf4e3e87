"""Everything that a study leaves: results, table, figures."""

from __future__ import annotations

from pathlib import Path

from fenics_contact.study.advice import advice
from fenics_contact.study.certificates import check_certificates
from fenics_contact.study.errors import Errors
from fenics_contact.study.results import Results, write_results
from fenics_contact.study.table import write_table
from fenics_contact.study.waste import waste


def write_report(folder: str | Path, results: Results, *, figures: bool = True) -> list[str]:
    """Write ``study.json``, ``table.md`` and the figures of a study, also of one that is not complete.

    Args:
        folder: Where to; created.
        results: What was measured.
        figures: Whether to draw; needs matplotlib.

    Returns:
        The advice, one sentence each.
    """
    target, errors = Path(folder), Errors(results)
    words, check = [*advice(errors), *waste(errors)], check_certificates(results)
    findings = {"references": errors.references, "advice": words, "certificates": check}
    write_results(target / "study.json", results, findings)
    write_table(target / "table.md", errors, words, check)
    if figures and results.good:
        from fenics_contact.study import figures as drawing  # needs matplotlib

        drawing.plot_accuracy(errors, target / "accuracy.png")
        drawing.plot_convergence(errors, target / "convergence.png")
        drawing.plot_parts(errors, target / "parts.png")
        drawing.plot_phases(errors, target / "phases.png")
    return words
