"""Options of `fenics-contact accuracy`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from fenics_contact.study import BALANCED, BUILT_IN, DISCRETISATIONS, RunTolerance

NAMES = ", ".join(BUILT_IN)
#: Value of an option given without one.
NOTHING = ""


def _positive(text: str) -> int | None:
    if text == NOTHING:
        return None
    if not text.isdecimal() or int(text) < 1:
        raise typer.BadParameter(f"needs a positive integer, got {text!r}")
    return int(text)


def _number(text: str) -> float | None:
    if text == NOTHING:
        return None
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"needs a number, got {text!r}") from None


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not value > 0.0:
        raise typer.BadParameter(f"needs a positive number of seconds, got {text!r}")
    return value


def _tolerance(text: str) -> RunTolerance | None:
    if text in (NOTHING, BALANCED):
        return BALANCED if text else None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1.0:
        raise typer.BadParameter(f'a tolerance is a number between 0 and 1, or "balanced", got {text!r}')
    return value


def _discretisation(text: str) -> str | None:
    if text and text not in DISCRETISATIONS:
        raise typer.BadParameter(f"needs one of {list(DISCRETISATIONS)}, got {text!r}")
    return text or None


SceneArgument: TypeAlias = Annotated[
    str, typer.Argument(metavar="SCENE", help=f"{NAMES}, or a file that ends in .py", show_default=False)
]
QuickOption: TypeAlias = Annotated[
    bool, typer.Option("--quick", help="About a minute: coarse meshes, one repeat.")
]
OutputOption: TypeAlias = Annotated[
    Path | None, typer.Option("--output", help="Folder of the results (output/studies/NAME).")
]
RunsOption: TypeAlias = Annotated[
    Path | None, typer.Option("--runs", help="Folder in which runs are stored (OUTPUT/runs).")
]
RanksOption: TypeAlias = Annotated[
    Any, typer.Option("--ranks", parser=_positive, metavar="N", help="MPI ranks of every run.")
]
RepeatsOption: TypeAlias = Annotated[
    Any,
    typer.Option(
        "--repeats", parser=_positive, metavar="N", help="Measurements of runs under 10 s (3; quick: 1)."
    ),
]
LimitOption: TypeAlias = Annotated[
    Any, typer.Option("--limit", parser=_seconds, metavar="S", help="Seconds that a run may take.")
]
ReportOption: TypeAlias = Annotated[
    bool, typer.Option("--report", help="Measure nothing, write the results again.")
]
NoFiguresOption: TypeAlias = Annotated[bool, typer.Option("--no-figures", help="Write no pictures.")]
PageOption: TypeAlias = Annotated[
    bool, typer.Option("--page", help="Also write README.md of all studies beside it.")
]
SizesOption: TypeAlias = Annotated[
    list[Any] | None,
    typer.Option("--sizes", parser=_positive, metavar="N...", help="Meshes, larger is finer."),
]
TolerancesOption: TypeAlias = Annotated[
    list[Any] | None,
    typer.Option("--tolerances", parser=_tolerance, metavar="T...", help='Numbers or "balanced".'),
]
CellsOption: TypeAlias = Annotated[
    list[str] | None, typer.Option("--cells", metavar="CELL...", help="Cell types beside the base's.")
]
DiscretisationsOption: TypeAlias = Annotated[
    list[Any] | None,
    typer.Option("--discretisations", parser=_discretisation, metavar="KIND...", help="Beside the base's."),
]
FixedPointsOption: TypeAlias = Annotated[
    list[Any] | None,
    typer.Option(
        "--fixed-points", parser=_number, metavar="T...", help="Tolerances of the fixed point of Coulomb."
    ),
]
SubdomainsOption: TypeAlias = Annotated[
    list[Any] | None,
    typer.Option("--subdomains", parser=_positive, metavar="N...", help="Numbers of subdomains."),
]
