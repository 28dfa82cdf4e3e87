"""The page of all studies: how to read the figures, and what was found, every number from the results."""

from __future__ import annotations

from pathlib import Path

from fenics_contact.errors import InvalidInputError
from fenics_contact.io import write_text
from fenics_contact.study.advice import advice
from fenics_contact.study.certificates import check_certificates
from fenics_contact.study.errors import Errors
from fenics_contact.study.results import read_study
from fenics_contact.study.table import rates_table
from fenics_contact.study.waste import waste

PICTURES = ("accuracy", "convergence", "parts", "phases")

GUIDE = """\
# What accuracy costs in time

Written by `make studies`, which runs `python -m fenics_contact accuracy SCENE` for every scene; all numbers
are from the `study.json` beside the figures. Every run is a process of its own; a time is that from the
mesh to the state.

## How to read the figures

**`accuracy.png`**: error against time, both logarithmic, for every quantity; further left is faster,
further down is better. Along a line only the mesh becomes finer. The dashed line with rings is the Pareto
front: for everything above it some other run is both faster and more accurate. Two lines on top of each
other say that the setting in which they differ does not matter; a line far above the others, that it does.

**`convergence.png`**: the same errors against the mesh size, with the slope that theory gives as a dashed
line. The last panel shows the estimate that every state carries of its own error in energy norm. A quantity
is compared with theory or with far finer meshes where there are such, else with the limit of the meshes
(Richardson's extrapolation of the three finest), and where they do not converge monotonically with the last.

**`parts.png`**: what the error consists of: mesh (an estimate), solver (a certificate; with Coulomb's law
for the slip bounds of the state; true errors are marked by crosses), and law of friction (an estimate).
Left, at the balanced tolerance, the solver's part must stay below a tenth of that of the mesh; right it is
seen how a tolerance changes the solver's part alone.

**`phases.png`**: where the time goes.

The advice names the fastest run that reaches an accuracy and whose finer and stricter companions all reach
it, too: an error that passes through zero is no merit. Times that differ by less than a tenth count as
equal.
"""


def write_overview(folder: str | Path) -> Path:
    """Write `README.md` of a folder that holds studies, each in a folder of its own.

    Args:
        folder: The folder.

    Raises:
        InvalidInputError: If it holds no study.
    """
    target = Path(folder) / "README.md"
    found = sorted(Path(folder).glob("*/study.json"))
    if not found:
        raise InvalidInputError(
            f"a page of studies needs some, {folder} holds none: run a study into it first"
        )
    write_text(target, "\n".join([GUIDE, *map(_section, found)]))
    return target


def _section(file: Path) -> str:
    errors = Errors(read_study(file))
    name, scene = file.parent.name, errors.results.scene
    check = check_certificates(errors.results)
    lines = [f"## {scene.title}", "", scene.about, ""]
    lines += [f"![{picture}]({name}/{picture}.png)" for picture in PICTURES]
    lines += [
        "",
        *(f"- {sentence}" for sentence in (*advice(errors), *waste(errors))),
        "",
        rates_table(errors),
    ]
    if check.smallest_factor is not None and check.largest_factor is not None:
        between = f"{check.smallest_factor:.2f} to {check.largest_factor:.2f}"
        lines.append(
            f"Certificates of the solver's error: {between} times the true error in {check.checked} runs, "
            f"{len(check.broken)} of them out of bounds. [All runs]({name}/table.md)."
        )
    runs = len(errors.results.runs)
    failed = runs - len(errors.results.good)
    lines.append(f"\n{failed} of {runs} runs failed; the table says why.\n" if failed else "")
    return "\n".join(lines)
