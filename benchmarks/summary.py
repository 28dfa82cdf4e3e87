"""From repeated measurements to one: medians of what varies, and the exact equality of what must not."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Any

Record = dict[str, Any]


def summarise(name: str, records: Sequence[Record]) -> Record:
    """Return one record for all repetitions of a run.

    Seconds, memory and load become medians, also by phase; everything else is the first repetition's.

    Args:
        name: Of the run, for errors.
        records: At least one.

    Raises:
        ValueError: If counts differ between repetitions.
    """
    first = records[0]
    for key in ("counts", "refused"):
        for record in records[1:]:
            if record.get(key) != first.get(key):
                raise ValueError(
                    f"{key} of {name} must be equal in all repetitions, got {first.get(key)} and "
                    f"{record.get(key)}: find out what is not deterministic"
                )
    result = dict(first)
    for key, value in first.items():
        if key == "phases":
            result[key] = {phase: median(r[key].get(phase, 0.0) for r in records) for phase in value}
        elif key == "ratio" or key.endswith(("seconds", "memory", "load_average")):
            result[key] = median(record[key] for record in records)
    result["repeats"] = len(records)
    return result
