"""Records as the cases leave them, made up: enough for every row of the table."""

from __future__ import annotations

from typing import Any

from benchmarks.plan import runs


def record(**changes: Any) -> dict[str, Any]:
    """Return the record of a state, with some entries changed."""
    return {
        "counts": {"torn_unknowns": 1000, "f_products": 50, "linear_products": 25, "newton_steps": 5},
        "total_potential": -2.0,
        "seconds": 2.0,
        "ratio": 0.3,
        "phases": {"factor": 0.5, "solve": 1.5},
        "forces": [[0.0, 0.0, 3.0], [0.0, 4.0, 0.0]],
        "ranks": 2,
        "peak_memory": 5_000_000,
        "import_memory": 1_000_000,
        "load_average": 0.5,
        "repeats": 3,
        **changes,
    }


def all_summaries() -> dict[str, Any]:
    """Return a summary of every run."""
    summaries = {run.name: record(ranks=max(1, run.ranks)) for run in runs()}
    refused = record(refused="InfeasibleError", message="not held")
    for key in ("counts", "total_potential", "seconds", "phases", "forces"):
        refused.pop(key)
    summaries["chain-friction-0"] = refused
    summaries["demo"] = {key: value for key, value in record().items() if key != "counts"}
    return summaries
