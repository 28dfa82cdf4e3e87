"""The tables of a page, from the record of a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from fenics_contact.display import force_units, name_in_words
from fenics_contact.io import listed_forces, scales_of
from fenics_contact.viz import Units

Record = Mapping[str, Any]


def sections(record: Record, units: Units) -> str:
    """Return the tables of a result as HTML, each under its heading; nothing for what the record lacks."""
    parts = {
        "Summary": _rows(_summary(record, units)),
        "Contact": _contact(record, units),
        "Load steps": _steps(record, units),
        "Rigid surfaces": _rows(_motions(record, units)),
        "Forces and moments": _forces(record, units),
        "Errors and residuals": _rows(_accuracy(record)),
        "Computed with": _rows(_origin(record)),
    }
    return "".join(f"<section><h2>{name}</h2>{part}</section>\n" for name, part in parts.items() if part)


def number(value: Any) -> str:
    """Return a value for readers: numbers with five digits, a dash for None."""
    if value is None:
        return "–"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    text = f"{value:,}" if isinstance(value, int) else f"{value:.5g}"
    return text.replace(",", "\u202f").replace("-", "\u2212")


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]], words: int) -> str:
    """Return a table of which the first columns are text; one of many columns is a list on narrow screens."""
    body = "".join(f"<tr>{_line('td', row, words, head or row)}</tr>\n" for row in rows)
    top = f"<thead><tr>{_line('th', head, words, head)}</tr></thead>" if head else ""
    kind = ' class="many"' if len(head) > 4 else ""
    return f'<div class="wide"><table{kind}>{top}<tbody>\n{body}</tbody></table></div>'


def _line(tag: str, cells: Sequence[Any], words: int, head: Sequence[Any]) -> str:
    texts = [escape(number(cell)) for cell in cells]
    names = [f' class="number" data-name="{escape(str(name))}"' for name in head]
    return "".join(
        f"<{tag}{'' if place < words else names[place]}>{text}</{tag}>" for place, text in enumerate(texts)
    )


def _rows(facts: Mapping[str, Any]) -> str:
    """Return a table of names and what they are."""
    kept = [(name, value) for name, value in facts.items() if value not in (None, "")]
    return _table((), kept, words=2) if kept else ""


def _summary(record: Record, units: Units) -> dict[str, Any]:
    scene, counts, solver = (record.get(name) or {} for name in ("scene", "counts", "solver"))
    energies, (_, work) = record.get("energies") or {}, _force_units(record, units)
    facts: dict[str, Any] = {
        f"body {name}": f"{number(body['cells'])} cells ({body['cell_type']}), {number(body['nodes'])} nodes"
        for name, body in (scene.get("bodies") or {}).items()
    }
    facts |= {name.replace("f_", "F-").replace("_", " "): value for name, value in counts.items()}
    facts |= {
        f"energy, {name.replace('_', ' ')}": f"{number(value)} {work}"
        for name, value in energies.items()
        if value is not None
    }
    facts["solver"] = ", ".join([*solver.get("methods", ()), solver.get("reason") or ""]).strip(", ")
    facts["tolerance"] = _tolerance(solver.get("tolerance"))
    facts["held by nothing"] = "; ".join(record.get("unheld") or ())
    objective = (record.get("optimisation") or {}).get("objective") or {}
    return facts | {f"objective, {name.replace('_', ' ')}": value for name, value in objective.items()}


def _tolerance(given: Any) -> Any:
    """Return a tolerance; one that follows the mesh in words."""
    if not isinstance(given, Mapping) or "share" not in given:
        return given
    return f"solver's error at most {100 * given['share']:.3g} % of the discretisation's"


def _force_units(record: Record, units: Units) -> tuple[str, str]:
    """Return the units of forces, and of moments and energies."""
    return force_units(units.force, units.length, 2 if _plane(record) else 3)


def _accuracy(record: Record) -> dict[str, Any]:
    errors = record.get("errors") or {}
    facts = {f"residual, {name}": value for name, value in (record.get("residuals") or {}).items()}
    facts |= {
        f"error, {name.replace('_', ' ')}": "not estimated" if value is None else value
        for name, value in errors.items()
        if not isinstance(value, Mapping)
    }
    facts |= {f"error of {name}": value for name, value in (errors.get("by_body") or {}).items()}
    if facts and not errors:
        facts["errors"] = "not computed"
    return facts


def _contact(record: Record, units: Units) -> str:
    entries, (force, _) = record.get("contact") or [], _force_units(record, units)
    names = (record.get("scene") or {}).get("contacts") or [{}] * len(entries)
    rows: list[tuple[str, str]] = []
    for pair, entry in zip(names, entries, strict=True):
        rows.append(("contact", f"{_side(pair.get('slave'))} on {_side(pair.get('master'))}"))
        named = zip(("open", "stick", "slip"), status_words([pair]), strict=True)
        states = [f"{entry[name]} {word}" for name, word in named if word and name in entry]
        rows.append(("points", f"{number(entry.get('points'))}: {', '.join(states)}"))
        rows += [
            (words, f"{number(entry[name])} {unit}")
            for name, words, unit in (
                ("normal_force", "normal force", force),
                ("peak_pressure", "largest pressure", units.stress),
                ("peak_nominal_pressure", "largest nominal pressure", units.stress),
                ("area", "area in contact", units.length if _plane(record) else f"{units.length}²"),
                ("smallest_gap", "smallest gap", units.length),
                ("largest_slip", "largest slip of the last step", units.length),
            )
            if entry.get(name) is not None
        ]
    return _table((), rows, words=2) if rows else ""


def status_words(pairs: Sequence[Record]) -> tuple[str, str, str]:
    """Return what open, sticking and slipping points of contact pairs are called, "" what there is none of.

    Without friction closed points count as slipping, which none of them is.
    """
    laws = [pair.get("friction") or {} for pair in pairs]
    rub = [any(value for name, value in law.items() if name != "type") for law in laws]
    if all(rub):
        return "open", "stick", "slip"
    return ("open", "stick", "slip or closed") if any(rub) else ("open", "", "closed")


def _side(side: Any) -> str:
    if not isinstance(side, Mapping):
        return "?"
    if "surface" in side:
        return f"{side['body']} {side['surface']}"
    return name_in_words(str(side.get("type", "obstacle")))


def _plane(record: Record) -> bool:
    return (record.get("scene") or {}).get("dimension") == 2


def _steps(record: Record, units: Units) -> str:
    steps = (record.get("more") or {}).get("steps")
    if not isinstance(steps, Mapping) or "name" not in steps:
        return ""
    force, _ = _force_units(record, units)
    named = {
        "number": "", "name": "step", "iterations": "iterations", "products": "products", "open": "open",
        "stick": "stick", "slip": "slip", "normal_force": f"normal force ({force})",
        "friction_force": f"friction ({force})", "peak_pressure": f"largest pressure ({units.stress})",
    }  # fmt: skip
    columns = [name for name in named if name in steps]
    rows = list(zip(*(steps[name] for name in columns), strict=True))
    return _table([named[name] for name in columns], rows, words=2)


def _motions(record: Record, units: Units) -> dict[str, str]:
    """Return displacement and rotation of the points of rigid surfaces."""
    facts: dict[str, str] = {}
    for place, entry in enumerate(record.get("rigid_motions") or ()):
        move, turn, about = (
            ", ".join(map(number, _several(entry[name]))) for name in ("displacement", "rotation", "about")
        )
        name = f"{place} {_side(entry)}, point {about}"
        facts |= {name: f"displacement {move} {units.length}; rotation {turn} rad"}
    return facts


def _forces(record: Record, units: Units) -> str:
    """Two rows for each force: itself and its moment, so that narrow screens hold them."""
    forces = record.get("forces") or {}
    if not forces:
        return ""
    scales, imbalance = scales_of(forces), forces["balance"]["imbalance"]
    names = _force_units(record, units)
    entries = [
        (f"{what} {_side(entry)}" if "surface" in entry else what, entry)
        for what, entry in listed_forces(forces)
    ]
    rows = [row for name, entry in entries for row in _force_rows(name, entry, scales, names)]
    words = f"<p>Imbalance of all forces and moments: {escape(number(imbalance))}.</p>"
    return _table(("", "", "x", "y", "z"), rows, words=2) + words


def _force_rows(
    name: str, entry: Record, given: Mapping[str, float], units: tuple[str, str], rounding: float = 1e-8
) -> list[tuple[Any, ...]]:
    """Return a row for a force and one for its moment; none if both are zero but for rounding."""
    scales = {**given, "about": given["moment"] / given["force"] if given["force"] else 0.0}
    force, moment, about = (
        [0 if abs(part) <= rounding * scale else part for part in _several(entry[kind])]
        for kind, scale in scales.items()
    )
    if not any([*force, *moment]):
        return []
    # In the plane a moment is one number, about the axis across it.
    return [
        (name, f"force ({units[0]})", *force, *[""] * (3 - len(force))),
        (
            f"about {', '.join(map(number, about))}",
            f"moment ({units[1]})",
            *[""] * (3 - len(moment)),
            *moment,
        ),
    ]


def _several(value: Any) -> list[Any]:
    return list(value) if isinstance(value, Sequence) else [value]


def _origin(record: Record) -> dict[str, Any]:
    facts = {"written": record.get("written"), "ranks": record.get("ranks")}
    seconds = record.get("seconds") or {}
    facts["seconds"] = ", ".join(f"{name} {spent:.2f}" for name, spent in seconds.items())
    return facts | dict(record.get("versions") or {})
