"""The table of hard cases: one row a case under the headings of groups, written as a page of Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fenics_contact.output.files import replacing

INTRODUCTION = """\
# Hard cases

What makes contact problems fail, one case a row: what came out, how exact it is and what it cost. Every
case is a test of `tests/hard/`; `make test-hard` runs them all and writes this page from their records,
only if all of them ran and none failed. Where the outcome is a refusal or a failure, the test requires that
very error: no case ends in a wrong answer.

Of every solved scene is checked, recomputed on the bodies in one piece from displacements and contact
forces, with no figure of the solver's:

- *natural*: ‖λ − P(λ − r/diag F)‖ relative to the normal forces, with a fresh product, at most the
  tolerance;
- *balance*: resultant and moment of load and contact forces along every motion that no support of the body
  resists, and the balance of every single node, relative to the forces that cancel there (the larger one);
- *cone*: the largest tension or excess of friction over its bound, relative to the largest normal force;
- *contact law*: the largest of penetration, normal force × gap, and what friction does not oppose of the
  slip, bound × ‖slip‖ + friction · slip, relative to the largest force and displacement;
- *same*: the largest relative difference of contact forces and displacements when the scene is given in
  other units of length and force, when its bodies are cut otherwise, and when it is solved on two (some on
  four) ranks.

All but *cone* and *natural* may be ten times the tolerance, *same* 1e-6; where little holds nodes apart from
their neighbours (flat cells, belts, contrasts of 1e6) ten thousand times and 1e-3, which the rows show.

"Unknowns" are torn displacements; products are those with the dual operator F. A *rescue* is a call of
proximal points, without a preconditioner of SMALSE, where the active set cycled or the residual stagnated;
a *cut* is a Newton step that was shortened.
"""

#: Groups in the order of the page: key to heading and advice.
GROUPS: dict[str, tuple[str, str]] = {
    "floating": (
        "Bodies that only contact and friction hold",
        "A body that nothing holds is refused before anything is factored, and the message names body and "
        "motion: support that motion, or give the pair friction. What rigid bodies could hold and elastic "
        "ones cannot, only the solver finds out, and says that it did not converge.",
    ),
    "touching": (
        "Contact that is nowhere, everywhere, or only just",
        "Gaps of any size do no harm unless all displacements are rounding to them. A body that rolls "
        "by far more than it deforms is the hardest of these: give it a support that keeps it from "
        "rolling, or shape and mesh that touch at more than one row of nodes.",
    ),
    "friction": (
        "Friction from none to ten",
        "Far beyond one there may be several equilibria, and which one is found depends on rounding. A "
        "coefficient of a thousandth that alone holds a stack of bodies costs ten times as many products: "
        "guide such bodies by a support. A floating body exactly at the limit of its friction has no unique "
        "slide and is refused; one that is dragged by a support has, and is solved.",
    ),
    "stiffness": (
        "Stiff beside soft, thin, nearly incompressible",
        "Any contrast between bodies, or between layers, costs next to nothing. Soft and stiff side by "
        "side in the same subdomains on a friction floor cost much: cut along the boundary of the "
        "materials, or make bodies of them and tie them. Let the softer or the finer surface be the "
        "slave. Linear cells lock as Poisson's ratio nears one half, the errors are in the outcomes: take "
        "quadratic hexahedra, whose contact radius stays right while the pressures of single nodes "
        "oscillate. Solid cells ten times as long as thick do no harm, a hundred times cost many "
        "products, and a thousand times are beyond what the dual solvers manage; belts that slide round a "
        "disc take some hundred.",
    ),
    "units": (
        "Units",
        "Any consistent units serve: forces of the same scene differ by rounding, and every case of this "
        "page is solved in two systems.",
    ),
    "partition": (
        "Partitions, supports and shared nodes",
        "Any partition gives the same answer. Subdomains may be jagged, tiny, or have no contact at all; "
        "ones of a cell or two cost time, not products. Supports may overlap where they agree, and nodes "
        "may belong to several pairs; forces at nodes with more multipliers than displacements are not "
        "unique one by one, their sum is.",
    ),
    "meshes": (
        "Meshes turned, mirrored, renumbered, distorted",
        "The answer does not depend on how a mesh is turned or numbered, and cells that are nearly flat "
        "do no harm to the solver. Cells that are flat or inverted are refused with their place when the "
        "mesh is made.",
    ),
    "deformed": (
        "Large deformations",
        "Rubber under contact that slides over rims, turns and keeps its volume. `balance` is that of every "
        "free node of whole bodies, their internal forces assembled again from the displacement; `same` "
        "compares displacements with those of another partition, and some with other units or "
        "another place. A load beyond the last equilibrium ends the path.",
    ),
    "published": (
        "Published friction problems",
        "Problems (W, q, μ) of the collection of Siconos, solved as F = W, d = −q without bodies or a "
        "preconditioner. `natural` is the residual by which they are judged, `rels`: the distance of the "
        "natural map of De Saxcé's form with ρ = 1/‖W‖, relative to max(‖r‖, ρ‖q‖). These are eleven of "
        "the 33 on which Siconos's own solvers reach 1e-8 this often: nonsmooth Newton of Alart and Curnier "
        "(NSN_AC) 30, nonsmooth Gauss-Seidel (NSGS) 27, its fixed point of Tresca problems 25; the other 22 "
        "were not at hand, and the figures do not compare. Where W is singular, forces are not unique and "
        "the residual alone is judged. Take FaceNewton; a fixed point is the safe second choice, and damps "
        "itself where it cycles.",
    ),
    "optimisation": (
        "Shape optimisation",
        "A trial design without mesh or equilibrium is rejected, the trust region shrinks, and the history "
        "says why. Figures are those of the last design; products are those of all designs, steps are "
        "evaluations. Near the limit of friction a state can cost any number of products: give the solver a "
        "`max_products`.",
    ),
    "interrupted": (
        "Interrupted runs",
        "A checkpoint is replaced at once or not at all. What cannot be read or belongs to another problem "
        "is refused; nothing starts anew where a checkpoint was expected.",
    ),
}

COLUMNS = {
    "case": "case",
    "scene": "unknowns / subdomains / contacts",
    "tolerance": "tolerance",
    "work": "products (steps)",
    "natural": "natural",
    "balance": "balance",
    "cone": "cone",
    "law": "contact law",
    "same": "same",
    "status": "open / stick / slip",
}


@dataclass(frozen=True)
class Row:
    """One case. Figures that a case does not have stay None or empty.

    Attributes:
        group: Key of `GROUPS`.
        case: The case in words.
        outcome: "solved", "refused: message" or "fails: cause".
        scene: Its size.
        tolerance: Relative residual asked for.
        products: Products with F.
        steps: Steps of the solver.
        natural: Recomputed natural residual.
        balance: Largest relative imbalance.
        cone: Largest relative violation of a bound.
        law: Largest relative violation of contact and friction law.
        same: Largest relative difference between answers that should be one.
        status: Counts of open, sticking and slipping points.
        fallbacks: What had to help, in words; empty if nothing.
    """

    group: str
    case: str
    outcome: str = "solved"
    scene: str = ""
    tolerance: float | None = None
    products: int | None = None
    steps: int | None = None
    natural: float | None = None
    balance: float | None = None
    cone: float | None = None
    law: float | None = None
    same: float | None = None
    status: str = ""
    fallbacks: str = ""

    def __post_init__(self) -> None:
        """Refuse a group that is not on the page."""
        if self.group not in GROUPS:
            raise ValueError(f"group must be one of {list(GROUPS)}, got {self.group!r}")

    @property
    def work(self) -> str:
        """Products and steps."""
        if self.products is None:
            return ""
        return f"{self.products}" if self.steps is None else f"{self.products} ({self.steps})"


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return "0" if value == 0.0 else f"{value:.0e}"
    return str(value).replace("|", "\\|").replace("\n", " ")


def page(rows: Sequence[Row]) -> str:
    """Return the page of Markdown."""
    parts = [INTRODUCTION]
    refused = sum(row.outcome.startswith("refused") for row in rows)
    failed = sum(row.outcome.startswith("fails") for row in rows)
    parts.append(
        f"{len(rows)} cases: {len(rows) - refused - failed} solved, {refused} refused with their reason, "
        f"{failed} that fail.\n"
    )
    for key, (heading, advice) in GROUPS.items():
        own = [row for row in rows if row.group == key]
        if own:
            parts.append(
                "\n".join([f"## {heading}", "", *([advice, ""] if advice else []), *_section(own)]) + "\n"
            )
    return "\n".join(parts)


def _section(rows: Sequence[Row]) -> list[str]:
    """Return the lines of a group: a table of the cases with figures, and what is to say of single cases."""
    tolerance, *others = {row.tolerance for row in rows}
    one = [] if others or tolerance is None else [f"Tolerance {_cell(tolerance)} in all cases.", ""]
    shown = [replace(row, tolerance=None) if one else row for row in rows]
    measured = [row for row in shown if row.outcome == "solved" or row.scene or row.products]
    told = [f"- {_cell(row.case)}: *{words}*" for row in rows if (words := _remark(row))]
    return [*one, *(_table(measured) if measured else []), *([""] if measured and told else []), *told]


def _remark(row: Row) -> str:
    """Return what is to say of a case: how it ended other than solved, and what had to help."""
    return "; ".join(_cell(words) for words in (row.outcome, row.fallbacks) if words not in ("solved", ""))


def _table(rows: Sequence[Row]) -> list[str]:
    """Return the lines of one table, without columns that are empty in all rows."""
    shown = {name: title for name, title in COLUMNS.items() if any(_cell(getattr(row, name)) for row in rows)}
    lines = ["| " + " | ".join(shown.values()) + " |", "|---" * len(shown) + "|"]
    lines += ["| " + " | ".join(_cell(getattr(row, name)) for name in shown) + " |" for row in rows]
    return lines


def write(path: Path, rows: Sequence[Row]) -> None:
    """Write the page; it appears whole."""
    with replacing(path) as (hidden,):
        hidden.write_text(page(rows), encoding="utf-8")
