"""The page of all studies of what accuracy costs in time: `python -m benchmarks.studies_page FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path

from fenics_contact.errors import InvalidInputError
from fenics_contact.output.files import write_text
from fenics_contact.study import Errors, read_study
from fenics_contact.study.report import PICTURES, findings_of

GUIDE = """\
# What accuracy costs in time

Written by `make studies`, which runs `python -m fenics_contact accuracy SCENE` for every scene; all numbers
are from the `study.json` beside the figures. Every run is a process of its own; a time is that from the
mesh to the state.

## How to read the figures and tables

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

**What an accuracy takes**: the fastest run that reaches it and whose finer and stricter companions all reach
it, too: an error that passes through zero is no merit. Times that differ by less than a tenth count as
equal. Where no run reaches it, the finest one is shown.

**What a setting costs**: runs that differ from each other in one setting alone, on the finest mesh that both
have; ratios above one are dearer.
"""


def studies_page(folder: Path) -> str:
    """Return the page of the studies in a folder, each in its own folder."""
    files = sorted(folder.glob("*/study.json"))
    if not files:
        raise InvalidInputError(
            f"a page of studies needs some, {folder} holds none: run a study into it first"
        )
    parts = [GUIDE]
    for file in files:
        errors, name = Errors(read_study(file)), file.parent.name
        title, answers, rates, certificates = findings_of(errors)
        pictures = "\n".join(f"![{picture}]({name}/{picture}.png)" for picture in PICTURES)
        more = f"[All {len(errors.results.runs)} runs]({name}/table.md).\n"
        parts += [title, pictures + "\n", answers, rates, certificates, more]
    return "\n".join(parts)


if __name__ == "__main__":
    place = Path(sys.argv[1])
    write_text(place / "README.md", studies_page(place))
