"""The study: its jobs, one for each room of the package, and the tables of its page."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.constants.listed import NOT_RUN, Constant, constants
from benchmarks.study import ROOT, Records, Study, filled, unfilled
from fenics_contact.output import write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

HOME, NAME = ROOT / "docs" / "studies", "constants"
#: Differences below this are rounding.
ROUNDING = 1e-9
#: What constants do, the strongest last.
CLASSES = ("not reached", "no effect", "work only", "within tolerance", "changes the answer")
#: A room and scenes of the quick study.
QUICK_ROOM, QUICK_SCENES = "mesh", ("mortar blocks",)

#: Key of a constant -> its value, meaning and what factors on it do.
Found = Mapping[str, Mapping[str, Any]]


def class_of(found: Mapping[str, Any]) -> str:
    """Return one of `CLASSES` for a constant."""
    if not found["reached"]:
        return CLASSES[0]
    return max(
        (_class_of(change) for change in found["factors"].values()), key=CLASSES.index, default=CLASSES[1]
    )


def _class_of(change: Mapping[str, Any]) -> str:
    if change.get("failed") or change["excess"] > 1.0:
        return "changes the answer"
    if _largest(change) > ROUNDING:
        return "within tolerance"
    return "no effect" if change["products"] == 1.0 else "work only"


def _parts(change: Mapping[str, Any]) -> dict[str, float]:
    kinds = ("energy", "force", "gradient", "estimate", "certificate")
    return {kind: change[kind] for kind in kinds if change[kind] > ROUNDING}


def _largest(change: Mapping[str, Any]) -> float:
    return max(_parts(change).values(), default=0.0)


def tables(found: Found) -> dict[str, str]:
    """Return the tables of the page by their names."""
    rooms = sorted({_room(key) for key in found})
    parts = [f"### {room}\n\n{_of_room(room, found)}" for room in rooms]
    return {"classes": _classes(rooms, found), "constants": "\n\n".join(parts), "not run": _not_run()}


def _room(key: str) -> str:
    return key.partition(":")[0].partition(".")[0]


def _classes(rooms: list[str], found: Found) -> str:
    counts = {
        room: Counter(class_of(each) for key, each in found.items() if _room(key) == room) for room in rooms
    }
    counts["all"] = sum(counts.values(), Counter())
    rows = [(room, *(str(count[name] or "") for name in CLASSES)) for room, count in counts.items()]
    return table(("part", *CLASSES), rows)


def _of_room(room: str, found: Found) -> str:
    rows = [
        (f"`{key}`", _value(each["value"]), each["meaning"], _by(each, "0.5"), _by(each, "2"), class_of(each))
        for key, each in found.items()
        if _room(key) == room
    ]
    head = ("constant", "value", "what it is for", "halved", "doubled", "class")
    return table(head, rows)


def _value(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_value(each) for each in value)
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_value(each)}" for key, each in value.items())
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _by(found: Mapping[str, Any], factor: str) -> str:
    """Return in words what a factor does."""
    if factor not in found["factors"]:
        return ""
    change = found["factors"][factor]
    words = [f"{kind} {value:.0e}" for kind, value in _parts(change).items()]
    words += [f"products × {change['products']:.2f}"] if change.get("products", 1.0) != 1.0 else []
    words += [f"{scene}: {words.partition(':')[0]}" for scene, words in change.get("failed", {}).items()]
    return ", ".join(words) or ("same bits" if change["same"] else "rounding")


def _not_run() -> str:
    rows = []
    for room, about in NOT_RUN.items():
        own = [each for each in constants() if each.room == room]
        rows.append(
            (room, about, ", ".join(f"`{each.module.partition('.')[2]}:{each.name}`" for each in own))
        )
    return table(("part", "what its constants are about", "constants"), [row for row in rows if row[2]])


def jobs(quick: bool) -> list[Job]:
    """Return a job for each room; the quick study has one room and one scene."""
    rooms = Counter(each.room for each in constants() if each.room not in NOT_RUN)
    function = "benchmarks.constants.measuring:run"
    if quick:
        return [Job(QUICK_ROOM, function, {"room": QUICK_ROOM, "scenes": QUICK_SCENES})]
    measured = [
        Job(room, function, {"room": room}, limit=7200.0, weight=2.0 + count) for room, count in rooms.items()
    ]
    return [Job("answers", "benchmarks.constants.measuring:answers"), *measured]


def described(constant: Constant) -> dict[str, Any]:
    """Return what the record says of a constant beside what factors do."""
    value = constant.value
    named = {str(key): each for key, each in value.items()} if isinstance(value, dict) else value
    return {"value": named, "meaning": constant.meaning}


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers and page; rooms that were not measured keep their numbers."""
    before = {} if quick else json.loads((HOME / f"{NAME}.json").read_text())
    measured = [record[0] for record in records.values()]
    answers = [record["answers"] for record in measured if "answers" in record]
    new = dict(before.get("constants", {}))
    for record in measured:
        new |= record.get("constants", {})
    # The value is the one that was measured, the comment the present one.
    found = {
        each.key: described(each) | new[each.key] | {"meaning": each.meaning}
        for each in constants()
        if each.key in new
    }
    # As a reader of the file has it: tuples are lists there.
    found = json.loads(json.dumps(found))
    known = {"answers": answers[0] if answers else before.get("answers", {}), "constants": found}
    write_json(folder / f"{NAME}.json", known)
    page = (HOME / f"{NAME}.md").read_text(encoding="utf-8")
    write_text(folder / f"{NAME}.md", unfilled(tables(found)) if quick else filled(page, tables(found)))


study = Study(jobs, write, HOME, (Path(__file__).parent,))
